"""Fringes shown at several exposures: each demodulated by itself, then fused pixel by pixel.

Of independent phases phi_i with standard deviation sigma_i the best estimate is the weighted mean,
here ``arg sum w_i exp(j phi_i)`` with ``w_i = 1 / sigma_i^2``, which knows no jump at pi; its
sigma is ``(sum w_i)^(-1/2)``. Exposures at which a pixel is void (saturated beyond three frames,
too dark, fitting no sinusoid) do not take part. (Zhang and Yau, Opt. Eng. 48, 033604, 2009, take
the brightest unsaturated exposure alone, which leaves the others' light unused.)

Offset, modulation and residual are brought to the longest exposure of the capture
(`Sequence.reference_ms`), so that white, black, codes and borders share one scale.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Items
from dataclasses import replace

import numpy as np

from fringeworks.errors import DecodeError
from fringeworks.model import (
    Capture,
    Codeword,
    Colour,
    Finding,
    FloatMap,
    Fringe,
    Fusion,
    GrayCode,
    PatternSet,
    Response,
    Sequence,
    Staircase,
    Uniform,
    Void,
    WrappedPhase,
)
from fringeworks.model.exposures import extrapolate
from fringeworks.model.phase import NO_EXPOSURE, VoidMap
from fringeworks.phase.demodulate import MaskRules, demodulate
from fringeworks.phase.response import demodulate_corrected

CODED = (Fringe, GrayCode, Codeword, Staircase, Colour)
"""What may not stand twice in a group, but for its exposures."""


def check_exposures(sequence: Sequence) -> None:
    """DecodeError where sets of one group that show the same cannot be put together."""
    shown: dict[object, list[PatternSet]] = {}
    for item in sequence.sets:
        if isinstance(item.pattern, CODED):
            shown.setdefault(item.pattern, []).append(item)
    for sets in shown.values():
        if len(sets) > 1:
            _check_repeated(sets)
    _check_same_shifts([item for item in sequence.sets if isinstance(item.pattern, Fringe)])
    if sequence.reference_ms is not None:
        _check_all_said(sequence)


def _check_repeated(sets: Items[PatternSet]) -> None:
    name, exposures = _name_of(sets[0]), [item.exposure_ms for item in sets]
    if None in exposures:
        raise DecodeError(
            f"{name} stand twice in one group, and not every one of the sets says its exposure: "
            "give each its `exposure_ms` in capture.toml, or, if they are alternatives, its own "
            "`group`"
        )
    twice = next((value for value in exposures if exposures.count(value) > 1), None)
    if twice is not None:
        raise DecodeError(
            f"{name} stand twice in one group with exposure_ms = {twice:g}: write one set with "
            "`repeats`, or, if they are alternatives, give each its own `group`"
        )


def _check_same_shifts(sets: Items[PatternSet]) -> None:
    """The same fringes at another exposure must have the same shifts."""
    for index, item in enumerate(sets):
        for other in sets[:index]:
            if item.exposure_ms != other.exposure_ms and _differs_in_shifts(item, other):
                raise DecodeError(
                    f"{_name_of(item)} have {item.pattern.frame_count} shifts at one exposure and "
                    f"other ones ({other.pattern.frame_count}) at another: give both the same "
                    "`shifts_deg` and `zero_px`, or each its own `group`"
                )


def _differs_in_shifts(item: PatternSet, other: PatternSet) -> bool:
    first, second = item.pattern, other.pattern
    if not (isinstance(first, Fringe) and isinstance(second, Fringe)) or first == second:
        return False
    said = item.exposure_ms is not None and other.exposure_ms is not None
    return said and (first.axis, first.period_px) == (second.axis, second.period_px)


def _check_all_said(sequence: Sequence) -> None:
    """With several exposures a set that does not say its own has no scale."""
    for place, item in enumerate(sequence.sets):
        if item.exposure_ms is None and isinstance(item.pattern, (*CODED, Uniform)):
            raise DecodeError(
                f"set {place + 1} ({_name_of(item)}) has no exposure_ms, and other sets are shown "
                "at several exposures: give it the one it was taken with"
            )


def _name_of(item: PatternSet) -> str:
    match item.pattern:
        case Fringe(axis=axis, period_px=period):
            return f"fringes of {period:g} px along {axis}"
        case GrayCode(axis=axis, cell_px=cell):
            return f"Gray codes of {cell:g} px cells along {axis}"
        case Codeword(axis=axis) | Staircase(axis=axis) | Colour(axis=axis):
            return f"{type(item.pattern).__name__.lower()} frames along {axis}"
        case other:
            return type(other).__name__.lower()


def demodulate_fringe(
    fringe: Fringe, capture: Capture, response: Response | None, *, rules: MaskRules, raw: Capture
) -> WrappedPhase:
    """Wrapped phase of one of a capture's fringes, from every exposure at which it was shown.

    `capture` and `raw` are those of `phase.response.demodulate_corrected`.
    """
    seen = []
    for place in _places_of(fringe, capture):
        alone = _alone(capture, place)
        before = alone if capture is raw else _alone(raw, place)
        (entry,) = alone.find(Fringe)
        seen.append(demodulate_corrected(entry, alone, response, rules=rules, raw=before))
    return _fuse_shown(fringe, capture, seen)


def demodulate_stair(stair: Staircase, capture: Capture) -> WrappedPhase:
    """Phase of a staircase, from every exposure at which it was shown."""
    shown = Fringe(stair.axis, stair.period_px, stair.shifts_rad)
    seen = [
        demodulate(
            capture.frames[place],
            shown,
            capture.sensor,
            repeats=capture.sequence.sets[place].repeats,
        )
        for place in _places_of(stair, capture)
    ]
    return _fuse_shown(stair, capture, seen)


def _places_of(pattern: Fringe | Staircase, capture: Capture) -> list[int]:
    return [place for place, item in enumerate(capture.sequence.sets) if item.pattern == pattern]


def _alone(capture: Capture, place: int) -> Capture:
    """The capture with one of its sets."""
    shown = capture.sequence
    alone = Sequence(shown.width, shown.height, (shown.sets[place],))
    return replace(capture, sequence=alone, frames=(capture.frames[place],))


def _fuse_shown(
    pattern: Fringe | Staircase, capture: Capture, seen: Items[WrappedPhase]
) -> WrappedPhase:
    """The phases of a pattern's sets, in their order, as one; a capture of one exposure's as is."""
    reference_ms = capture.sequence.reference_ms
    if reference_ms is None:
        return seen[0]
    sets = (capture.sequence.sets[place] for place in _places_of(pattern, capture))
    said = ((item.exposure_ms, one) for item, one in zip(sets, seen, strict=True))
    exposed = [(exposure_ms, one) for exposure_ms, one in said if exposure_ms is not None]
    return fuse(exposed, reference_ms=reference_ms)


def fuse(exposed: Items[tuple[float, WrappedPhase]], *, reference_ms: float) -> WrappedPhase:
    """Phases of the same fringes at several exposures, ms, as one.

    Returns
    -------
    WrappedPhase
        Grey levels are those of the exposure `reference_ms`. A pixel is void where it is so at
        every exposure, for the reason that it has at the longest one at which it is not
        saturated; its offset and modulation are from there too, or from the shortest exposure
        where all are saturated.
    """
    ordered = sorted(exposed, key=lambda entry: entry[0])
    phases = [_at_exposure(one, reference_ms / exposure_ms) for exposure_ms, one in ordered]
    weights = np.stack([_weight(one) for one in phases])
    total = weights.sum(axis=0)
    lit = total > 0
    ruling = weights.argmax(axis=0).astype(np.uint8)
    source = np.where(lit, ruling, _longest_unsaturated(phases))
    nan = np.float32(np.nan)
    sigma = np.full_like(total, nan)
    np.divide(1, np.sqrt(total), out=sigma, where=lit)
    return WrappedPhase(
        fringe=phases[0].fringe,
        phase=np.where(lit, _mean_angle([one.phase for one in phases], weights), nan),
        offset=_mean_level([one.offset for one in phases], weights, source),
        modulation=_mean_level([one.modulation for one in phases], weights, source),
        residual=np.choose(source, [one.residual for one in phases]),
        sigma=sigma,
        noise=phases[-1].noise,
        void=np.where(lit, np.uint8(Void.VALID), np.choose(source, [one.void for one in phases])),
        fusion=Fusion(
            tuple(exposure_ms for exposure_ms, _ in ordered),
            np.where(lit, ruling, np.uint8(NO_EXPOSURE)),
        ),
    )


def _at_exposure(wrapped: WrappedPhase, ratio: float) -> WrappedPhase:
    """With the grey levels of an exposure `ratio` times as long."""
    return replace(
        wrapped,
        offset=extrapolate(wrapped.offset, ratio, wrapped.noise.black_level),
        modulation=extrapolate(wrapped.modulation, ratio, 0.0),
        residual=extrapolate(wrapped.residual, ratio, 0.0),
    )


def _weight(wrapped: WrappedPhase) -> FloatMap:
    """One over the phase's variance; zero where it is void."""
    weight = np.zeros_like(wrapped.sigma)
    np.divide(1, np.square(wrapped.sigma), out=weight, where=wrapped.void == Void.VALID)
    return weight


def _mean_angle(angles: Items[FloatMap], weights: FloatMap) -> FloatMap:
    real, imaginary = np.zeros_like(weights[0]), np.zeros_like(weights[0])
    for angle, weight in zip(angles, weights, strict=True):
        known = np.where(weight > 0, angle, np.float32(0))
        real += weight * np.cos(known)
        imaginary += weight * np.sin(known)
    return np.asarray(np.arctan2(imaginary, real))


def _mean_level(levels: Items[FloatMap], weights: FloatMap, source: VoidMap) -> FloatMap:
    """Weighted like the phase (their sigma goes with it); of `source` where nothing weighs."""
    total = weights.sum(axis=0)
    level = np.choose(source, levels)
    weighted = sum(weight * level for weight, level in zip(weights, levels, strict=True))
    np.divide(weighted, total, out=level, where=total > 0)
    return np.asarray(level, np.float32)


def _longest_unsaturated(phases: Items[WrappedPhase]) -> VoidMap:
    """``(H, W)`` place, shortest exposure first; zero where all are saturated."""
    place = np.zeros(phases[0].void.shape, np.uint8)
    for index, one in enumerate(phases):
        place[one.void != Void.SATURATED] = index
    return place


def notice_exposures(phases: Items[WrappedPhase]) -> Iterator[Finding]:
    """Which exposures were fused, and on which of them how many of the decoded pixels rest most."""
    for wrapped in phases:
        fusion = wrapped.fusion
        if fusion is not None:
            told = zip(fusion.exposures_ms, fusion.shares, strict=True)
            shares = ", ".join(f"{exposure_ms:g} ms ({share:.2%})" for exposure_ms, share in told)
            yield Finding(
                "note",
                f"axis {wrapped.fringe.axis}: exposures were fused; the decoded pixels rest most "
                f"on {shares}.",
                name="exposures",
            )
