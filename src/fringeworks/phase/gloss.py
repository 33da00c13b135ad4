"""Light that reaches a pixel by way of other surfaces, seen by the modulation of two periods.

The point spread of projector and camera weakens fringes of period P by ``exp(-2 pi^2 s^2 / P^2)``,
so the log of the ratio of the modulations of a fine and a coarse period is
``-2 pi^2 s^2 (1 / P_fine^2 - 1 / P_coarse^2)`` whatever the surface reflects and the room adds.
Its s varies little and smoothly: with the place, and with the coordinate's slope, across which the
camera blurs. Light that bounces between surfaces or runs inside them carries coarse fringes and
hardly any fine ones (Nayar and others, ACM Trans. Graph. 25, 935, 2006). It adds ``B G exp(i psi)``
to coarse fringes ``B exp(i Phi)``: G cos(psi - Phi) changes the ratio, and G sin(psi - Phi) the
coarse phase against the one that the fine coordinate asks for. Both are looked at, for the one
vanishes where the other is largest. Pixels whose G exceeds noise and the scene's own smooth ratio
are told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import (
    AXES,
    CodedAxis,
    Finding,
    FloatMap,
    Fringe,
    PatternSet,
    Void,
    WrappedPhase,
)

Array: TypeAlias = NDArray[np.float64]
Bits: TypeAlias = NDArray[np.bool_]

LEAST_PERIODS = 1.5
"""Ratio of two periods from which their modulations tell anything."""

LEAST_KEPT = 0.9
"""Of the coarse modulation; of the rest a defocused part of the scene may lose as much again."""

WINDOW_PX = 9
"""Camera px over which the ratio is averaged: well below a fringe, and noise falls ninefold."""

LEAST_FILLED = 0.5
"""Of the window, that must be known."""

EDGE_TURNS = 0.08
EDGE_PX = 3
"""Where the coordinate steps by so much of the fine period more than about it, or is void, there is
an edge; so near to it pixels are mixed, and the ratio is theirs."""

LEAST_CHANGE = 0.04
"""Change of the log ratio that no blur of a clean scene of the twin reaches beyond the fit."""

SIGMAS = 5.0
LEAST_PIXELS = 1000
MOST_PIXELS = 20_000
ROUNDS = 12


@dataclass(frozen=True, slots=True, eq=False)
class RatioTest:
    """Fine against coarse fringes of an axis.

    Attributes
    ----------
    change
        ``(H, W)`` G, the other light's share of the coarse modulation, as far as blur and place do
        not explain it; NaN where it is not known.
    lifted
        ``(H, W)``: the change is beyond noise and blur.
    """

    change: FloatMap
    lifted: Bits

    @property
    def share(self) -> float:
        """Of the pixels at which the change is known."""
        known = np.count_nonzero(np.isfinite(self.change))
        return float(np.count_nonzero(self.lifted) / known) if known else 0.0


def compare_modulations(phases: Sequence[WrappedPhase], coordinate: FloatMap) -> RatioTest | None:
    """Fine and coarse fringes of an axis, one exposure each; None if nothing is told.

    `coordinate` is what they were decoded to, ``(H, W)`` projector px, NaN where void. It takes two
    periods that differ by `LEAST_PERIODS`; the fine ones are the finest that blur hardly weakens.
    """
    coarse = max(phases, key=lambda item: item.fringe.period_px)
    fine = _finest_sharp(phases, coarse)
    if fine is None:
        return None
    known = np.isfinite(fine.phase) & np.isfinite(coarse.phase) & np.isfinite(coordinate)
    known &= ~_edges(coordinate, fine.fringe.period_px)
    ratio = _log_ratio(fine, coarse)
    parts, variance, known = _average(
        (ratio, _disagreement(coarse, coordinate)), known, fine, coarse
    )
    if np.count_nonzero(known) < LEAST_PIXELS:
        return None
    design = _design(fine, known)
    left = parts[0][known] - design @ _fit(design, parts[0][known])
    size = np.hypot(left, parts[1][known])
    change, lifted = np.full(known.shape, np.nan, np.float32), np.zeros(known.shape, bool)
    change[known] = size
    lifted[known] = size > np.hypot(SIGMAS * np.sqrt(variance[known]), LEAST_CHANGE)
    return RatioTest(change, lifted)


def _finest_sharp(phases: Sequence[WrappedPhase], coarse: WrappedPhase) -> WrappedPhase | None:
    """The finest fringes that keep `LEAST_KEPT` of the coarse ones' modulation; None if none do.

    Finer ones tell by their modulation how blur goes with depth, whatever light bounces.
    """
    for fine in sorted(phases, key=lambda item: item.fringe.period_px):
        if coarse.fringe.period_px < LEAST_PERIODS * fine.fringe.period_px:
            return None
        ratio = _log_ratio(fine, coarse)[np.isfinite(fine.phase) & np.isfinite(coarse.phase)]
        if len(ratio) and np.median(ratio) > np.log(LEAST_KEPT):
            return fine
    return None


def _log_ratio(fine: WrappedPhase, coarse: WrappedPhase) -> FloatMap:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(fine.modulation / coarse.modulation), np.float32)


def _disagreement(coarse: WrappedPhase, coordinate: FloatMap) -> FloatMap:
    """``(H, W)`` rad, coarse phase less that of the coordinate."""
    fringe = coarse.fringe
    asked = 2 * np.pi * (coordinate - fringe.zero_px) / fringe.period_px
    return np.asarray(np.angle(np.exp(1j * (coarse.phase - asked))), np.float32)


def _average(
    values: Sequence[FloatMap], known: Bits, fine: WrappedPhase, coarse: WrappedPhase
) -> tuple[list[FloatMap], FloatMap, Bits]:
    """Values and their variance, averaged over the window; where it is filled well enough.

    ``sigma(B) / B`` is the phase's sigma.
    """
    import cv2

    def box(item: NDArray[np.floating] | Bits) -> FloatMap:
        size = (WINDOW_PX, WINDOW_PX)
        return np.asarray(cv2.boxFilter(item.astype(np.float32), -1, size, normalize=False))

    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where(known, 1 / (fine.sigma**2 + coarse.sigma**2), 0).astype(np.float32)
        filled = [np.where(known, item, np.float32(0)) for item in values]
    total = box(weight)
    known = known & (box(known) >= LEAST_FILLED * WINDOW_PX**2)
    total = np.where(known, total, 1).astype(np.float32)
    means = [np.asarray(box(weight * item) / total, np.float32) for item in filled]
    return means, np.asarray(1 / total, np.float32), known


def _design(fine: WrappedPhase, known: Bits) -> Array:
    """What s^2 may go with, at the known pixels: place, and the square of the phase's slope."""
    y, x = np.nonzero(known)
    height, width = known.shape
    slope = _slope_squared(np.where(known, fine.phase, np.float32(np.nan)))[known]
    slope /= max(float(np.median(slope)), 1e-9)
    return np.column_stack([np.ones(len(x)), x / width - 0.5, y / height - 0.5, slope])


def _slope_squared(phase: FloatMap) -> Array:
    """``(H, W)`` square of the wrapped phase's gradient, averaged over the window; 0 if unknown."""
    total = np.zeros(phase.shape)
    for step in _steps(phase):
        total += np.angle(_smoothed(step)) ** 2
    return total


def _edges(coordinate: FloatMap, period_px: float) -> Bits:
    """``(H, W)``: near a void, or a step of the coordinate beyond those about it."""
    import cv2

    torn = np.isnan(coordinate)
    for axis in (0, 1):
        step = np.diff(np.nan_to_num(coordinate), axis=axis)
        beyond = np.abs(step - cv2.blur(step, (WINDOW_PX, WINDOW_PX))) > EDGE_TURNS * period_px
        np.moveaxis(torn, axis, 0)[1:] |= np.moveaxis(beyond, axis, 0)
    kernel = np.ones((2 * EDGE_PX + 1,) * 2, np.uint8)
    return np.asarray(cv2.dilate(torn.astype(np.uint8), kernel) > 0)


def _steps(phase: FloatMap) -> Iterator[NDArray[np.complex128]]:
    """``exp(i step)`` from the pixel above and from the one to the left; 0 where not known."""
    turn = np.where(np.isfinite(phase), np.exp(1j * phase), 0).astype(np.complex128)
    for axis in (0, 1):
        step = turn * np.conj(np.roll(turn, 1, axis))
        np.moveaxis(step, axis, 0)[0] = 0
        yield step


def _smoothed(step: NDArray[np.complex128]) -> NDArray[np.complex128]:
    import cv2

    size = (WINDOW_PX, WINDOW_PX)
    real, imaginary = (
        cv2.boxFilter(np.ascontiguousarray(part), -1, size) for part in (step.real, step.imag)
    )
    return np.asarray(real + 1j * imaginary)


def _fit(design: Array, ratio: NDArray[np.floating]) -> Array:
    """Least absolute values, by weights, on some of the pixels: up to half may be lifted."""
    step = 1 + len(ratio) // MOST_PIXELS
    design, values = design[::step], ratio[::step].astype(np.float64)
    weight: Array = np.ones(len(values))
    solved: Array = np.zeros(design.shape[1])
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        found = np.linalg.lstsq(design * root[:, None], values * root, rcond=None)[0]
        solved = np.asarray(found, np.float64)
        weight = np.asarray(1 / np.maximum(np.abs(values - design @ solved), LEAST_CHANGE / 10))
    return solved


def without_other_light(axis: CodedAxis, phases: Sequence[WrappedPhase]) -> CodedAxis:
    """The axis, void where its fringes tell of light by way of other surfaces."""
    found = compare_modulations(phases, axis.coordinate)
    if found is None:
        return axis
    bad, nan = found.lifted & (axis.void == Void.VALID), np.float32(np.nan)
    return replace(
        axis,
        coordinate=np.where(bad, nan, axis.coordinate),
        sigma=np.where(bad, nan, axis.sigma),
        void=np.where(bad, np.uint8(Void.OTHER_LIGHT), axis.void),
    )


def notice_one_period(sets: Sequence[PatternSet]) -> Iterator[Finding]:
    """A warning for each axis whose fringes can tell nothing of other light."""
    for axis in AXES:
        periods = [
            item.pattern.period_px
            for item in sets
            if isinstance(item.pattern, Fringe) and item.pattern.axis == axis
        ]
        if periods and max(periods) < LEAST_PERIODS * min(periods):
            yield Finding(
                "warning",
                f"axis {axis}: light by way of other surfaces was not looked for, since its "
                f"fringes have no two periods {LEAST_PERIODS:g} times apart.",
                "Show coarser fringes too (`--periods`).",
                name="other light",
            )
