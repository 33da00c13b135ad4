"""Phases of a capture and what they should be: the samples that terms are fitted to."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import (
    AXES,
    Axis,
    Capture,
    FloatMap,
    Fringe,
    GrayCode,
    PhaseTerms,
    Sequence,
    WrappedPhase,
)
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.demodulate import MaskRules, demodulate
from fringeworks.phase.gray import read_gray
from fringeworks.phase.response import ORDERS

Array: TypeAlias = NDArray[np.float64]

MOST_SAMPLES = 200_000
LEAST_SAMPLES = 2_000
CELLS_PER_WAVE = 2.0
"""Gray cells per wave of the highest term: coarser ones look like waves themselves."""

MANY_STEPS = 2
"""Steps of the reference, in those of the fringes that are held against it."""

ANY_RESIDUAL = MaskRules(residual_sigmas=math.inf)
"""Frames of a curved response fit no sinusoid: that is what is looked for."""

OUTLIER_SIGMAS = 4.0
ROUNDS = 6
NORMAL_SCALE = 1.4826
PHASE_BINS, FULL_BINS = 24, 0.9
"""Share of the phase's bins that samples must fill."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One set of fringes: its phase, and what it should be where that is known.

    Attributes
    ----------
    wrapped
        As demodulated.
    true
        ``(H, W)`` absolute phase, rad; NaN where not known.
    """

    wrapped: WrappedPhase
    true: FloatMap

    @property
    def fringe(self) -> Fringe:
        return self.wrapped.fringe

    def error(self) -> Array:
        """``(H, W)`` measured less true phase, rad, within half a turn; NaN where not known."""
        error = self.wrapped.phase.astype(np.float64) - self.true
        return np.asarray(np.angle(np.exp(1j * error)))


def see_sets(capture: Capture, axis: Axis) -> list[WrappedPhase]:
    """Demodulated fringe sets of an axis, in the capture's order."""
    return [
        demodulate(frames, fringe, capture.sensor, repeats=repeats, rules=ANY_RESIDUAL)
        for fringe, frames, repeats in capture.find(Fringe)
        if fringe.axis == axis
    ]


def against(wrapped: WrappedPhase, coordinate: FloatMap) -> Seen:
    """A set against projector coordinates ``(H, W)``."""
    fringe = wrapped.fringe
    true = 2 * np.pi * (coordinate - fringe.zero_px) / fringe.period_px
    return Seen(wrapped, true.astype(np.float32))


def gray_is_fine(capture: Capture, fringe: Fringe) -> bool:
    """Whether cells of a Gray code along the fringes' axis are small beside the error's waves."""
    codes = [code for code, *_ in capture.find(GrayCode) if code.axis == fringe.axis]
    waves = CELLS_PER_WAVE * ORDERS * fringe.frame_count
    return any(code.code_px * waves <= fringe.period_px for code in codes)


def see_by_gray(capture: Capture) -> Iterator[Seen]:
    """Sets of fringes against the cells of a Gray code, edges of cells left out."""
    for axis in AXES:
        sets = [w for w in see_sets(capture, axis) if gray_is_fine(capture, w.fringe)]
        if not sets:
            continue
        reading = read_gray(capture, axis, fringes=sets[0], least_modulation=0.0)
        if reading is not None:
            cells = np.where(reading.at_edge, np.float32(np.nan), reading.coordinate)
            yield from (against(wrapped, cells) for wrapped in sets)


def many_steps(capture: Capture, axis: Axis) -> Fringe | None:
    """Fringes along an axis of so many steps that others can be held against them."""
    fringes = [fringe for fringe, *_ in capture.find(Fringe) if fringe.axis == axis]
    if not fringes:
        return None
    most = max(fringes, key=lambda fringe: (fringe.frame_count, -fringe.period_px))
    fewest = min(fringe.frame_count for fringe in fringes)
    return most if most.frame_count >= MANY_STEPS * fewest else None


def see_by_steps(capture: Capture) -> Iterator[Seen]:
    """Sets of fringes against those of the same axis with twice their steps or more.

    Raises
    ------
    DecodeError
        The reference cannot be decoded by itself.
    """
    for axis in AXES:
        reference = many_steps(capture, axis)
        if reference is None:
            continue
        coordinate = coordinate_of(_only(capture, reference), axis)
        for wrapped in see_sets(capture, axis):
            if wrapped.fringe.frame_count * MANY_STEPS <= reference.frame_count:
                yield against(wrapped, coordinate)


def coordinate_of(capture: Capture, axis: Axis) -> FloatMap:
    """``(H, W)`` projector coordinate along an axis, px; NaN where void.

    Raises
    ------
    DecodeError
        The axis is not coded.
    """
    decoding = decode_phases(capture, rules=ANY_RESIDUAL)
    for coded in decoding.coded:
        if coded.axis == axis:
            return coded.coordinate
    why = "; ".join(reason for wrapped, reason in decoding.relative if wrapped.fringe.axis == axis)
    raise DecodeError(f"{capture.name}: axis {axis} has no absolute phase ({why})")


def _only(capture: Capture, fringe: Fringe) -> Capture:
    """The capture without any other fringes than these."""
    kept = [
        place
        for place, item in enumerate(capture.sequence.sets)
        if not isinstance(item.pattern, Fringe) or item.pattern == fringe
    ]
    old = capture.sequence
    sequence = Sequence(old.width, old.height, tuple(old.sets[place] for place in kept))
    return replace(capture, sequence=sequence, frames=tuple(capture.frames[n] for n in kept))


def sample(good: NDArray[np.bool_], *, what: str) -> NDArray[np.intp]:
    """Flat indices of at most `MOST_SAMPLES` of the good pixels, evenly spread.

    Raises
    ------
    DecodeError
        There are too few.
    """
    places = np.flatnonzero(good)
    if len(places) < LEAST_SAMPLES:
        raise DecodeError(
            f"{what}: {len(places)} pixels tell the response, at least {LEAST_SAMPLES} are needed"
        )
    return places[:: 1 + len(places) // MOST_SAMPLES]


def solve_robustly(design: Array, values: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Least squares without what lies far from the rest, and which rows were used.

    By the normal equations: waves and Chebyshev terms are far from alike, and rows are many.
    """
    used = np.ones(len(values), np.bool_)
    found: Array = np.zeros(design.shape[1])
    for _ in range(ROUNDS):
        rows = design[used]
        solved = np.linalg.lstsq(rows.T @ rows, rows.T @ values[used], rcond=None)[0]
        found = np.asarray(solved, np.float64)
        rest = np.abs(values - design @ found)
        used = rest <= OUTLIER_SIGMAS * NORMAL_SCALE * np.median(rest)
    return found, used


def make_terms(seen: Seen, coefficients: Array) -> PhaseTerms:
    """Terms with these coefficients, cosine and sine of k = 1, 2, ...

    Raises
    ------
    DecodeError
        With them the phase would run backwards.
    """
    fringe = seen.fringe
    terms = PhaseTerms(
        axis=fringe.axis,
        period_px=fringe.period_px,
        shifts_rad=fringe.shifts_rad,
        cos=tuple(coefficients[0::2].tolist()),
        sin=tuple(coefficients[1::2].tolist()),
    )
    if terms.folds:
        raise DecodeError(
            f"fringes of {fringe.period_px:.4g} px along {fringe.axis}: the error found is so "
            "steep that phases would fold over: look at exposure and at the frames' order"
        )
    return terms


def check_phases(phase: Array, fringe: Fringe) -> None:
    """Refuse samples that leave parts of a period unseen.

    Raises
    ------
    DecodeError
        They do, so that waves of the period cannot be told.
    """
    counts, _ = np.histogram(phase, PHASE_BINS, (-np.pi, np.pi))
    if np.mean(counts > 0) < FULL_BINS:
        raise DecodeError(
            f"fringes of {fringe.period_px:.4g} px along {fringe.axis}: the scene shows "
            f"{np.mean(counts > 0):.0%} of a period; the response needs a whole one"
        )
