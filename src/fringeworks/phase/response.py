"""A response applied: images straightened, or the error that it makes taken from phases.

The error of N steps has N waves per period and their multiples: they are what the harmonics next
to kN of the light leave (Pan and others, Opt. Lett. 34, 416, 2009). Blur of the projector by a
Gaussian passes the n-th harmonic with T^(n^2), T what it passes of the fringes themselves; the
strongest, N - 1, loses T^(N (N - 2)) against them. Terms do not follow that: they hold at the blur
at which they were found. Pre-distorted patterns have no harmonics to lose and hold at any.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.model import (
    Capture,
    Finding,
    Frames,
    Fringe,
    GreyCurve,
    ImageExponent,
    PhaseTerms,
    Response,
    Sensor,
    Void,
    WrappedPhase,
)
from fringeworks.model.capture import SATURATED_SHARE
from fringeworks.phase.demodulate import MaskRules, demodulate

Array: TypeAlias = NDArray[np.float64]

ORDERS = 4
"""Multiples of N waves per period; on `gamma-plane` a fifth changes nothing."""

SAME_PERIOD = 1e-6
SAME_SHIFT_RAD = 1e-6

PREDISTORTED = "predistorted_by"
"""Key of a capture's provenance: the response that its patterns were bent by."""

CURVE_SAMPLES = 720
DEEPEST = 65535.0


def correct_frames(capture: Capture, response: Response | None) -> Capture:
    """The capture with straightened images, where the response is of that kind."""
    if response is None or not isinstance(response.correction, ImageExponent):
        return capture
    return straighten(capture, response.correction.exponent)


def straighten(capture: Capture, exponent: float) -> Capture:
    """Each grey level above black, as a share of full scale, to the power `exponent`.

    Frames become 16 bit. A level counts as saturated after it if it did before; the noise, which
    is no longer even, is not known.
    """
    sensor = capture.sensor
    span = sensor.full_scale - sensor.black_level
    saturated = (sensor.saturation - sensor.black_level) / span
    top = DEEPEST * saturated**exponent / SATURATED_SHARE
    levels = np.arange(sensor.full_scale + 1)
    shares = np.maximum(levels - sensor.black_level, 0) / span
    table = np.rint(DEEPEST * shares**exponent).astype(np.uint16)
    frames = tuple(_look_up(table, stack) for stack in capture.frames)
    return replace(capture, frames=frames, sensor=Sensor(top))


def _look_up(table: NDArray[np.uint16], stack: Frames) -> NDArray[np.uint16]:
    return np.asarray(table[np.minimum(stack, len(table) - 1)])


def demodulate_corrected(
    entry: tuple[Fringe, Frames, int],
    capture: Capture,
    response: Response | None,
    *,
    rules: MaskRules,
    raw: Capture,
) -> WrappedPhase:
    """Wrapped phase of one fringe set of a capture, with the response taken from it.

    Parameters
    ----------
    entry
        Fringe, frames and repeats, from `capture`.
    capture, raw
        After and before `correct_frames`. Straightened levels near black are mostly noise: a
        pixel that is void in the raw frames stays void, but for their residual, which the
        response itself makes; that rule is left out too where terms are taken from phases.
    """
    fringe, frames, repeats = entry
    terms = None if response is None else find_terms(response, fringe)
    if terms is not None:
        rules = replace(rules, residual_sigmas=math.inf)
    wrapped = demodulate(frames, fringe, capture.sensor, repeats=repeats, rules=rules)
    if terms is not None:
        return compensate(wrapped, terms)
    if capture is raw:
        return wrapped
    stack = next(stack for item, stack, _ in raw.find(Fringe) if item == fringe)
    any_residual = replace(rules, residual_sigmas=math.inf)
    seen = demodulate(stack, fringe, raw.sensor, repeats=repeats, rules=any_residual)
    return _without(wrapped, seen.void)


def _without(wrapped: WrappedPhase, void: NDArray[np.uint8]) -> WrappedPhase:
    bad, nan = void != Void.VALID, np.float32(np.nan)
    return replace(
        wrapped,
        phase=np.where(bad, nan, wrapped.phase),
        sigma=np.where(bad, nan, wrapped.sigma),
        void=np.where(bad, void, wrapped.void),
    )


def find_terms(response: Response, fringe: Fringe) -> PhaseTerms | None:
    """The terms for fringes of this kind: from a curve for any, else those measured on them."""
    if isinstance(response.correction, GreyCurve):
        return terms_of_curve(response.correction, fringe)
    if isinstance(response.correction, ImageExponent):
        return None
    return next((terms for terms in response.correction if is_for(terms, fringe)), None)


def is_for(terms: PhaseTerms, fringe: Fringe) -> bool:
    """Whether terms were measured on fringes of this axis, period and these shifts."""
    same = terms.axis == fringe.axis and terms.steps == fringe.frame_count
    close = abs(terms.period_px / fringe.period_px - 1) < SAME_PERIOD
    if not same or not close:
        return False
    apart = np.angle(np.exp(1j * (np.array(terms.shifts_rad) - np.array(fringe.shifts_rad))))
    return bool(np.abs(apart).max() < SAME_SHIFT_RAD)


def terms_of_curve(curve: GreyCurve, fringe: Fringe) -> PhaseTerms:
    """Phase error that a curve makes of fringes in focus: by showing them, and looking."""
    phase = 2 * np.pi * (np.arange(CURVE_SAMPLES) + 0.5) / CURVE_SAMPLES
    shifts = np.array(fringe.shifts_rad)
    light = curve.light_of((1 + np.cos(phase - shifts[:, np.newaxis])) / 2)
    basis = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    _, cosine, sine = np.linalg.pinv(basis) @ light
    measured = np.arctan2(sine, cosine)
    error = np.angle(np.exp(1j * (measured - phase)))
    design = wave_terms(measured, fringe.frame_count)
    found = np.linalg.lstsq(design, error, rcond=None)[0]
    left = error - design @ found
    return PhaseTerms(
        axis=fringe.axis,
        period_px=fringe.period_px,
        shifts_rad=fringe.shifts_rad,
        cos=tuple(found[0::2].tolist()),
        sin=tuple(found[1::2].tolist()),
        before=rms(error),
        after=rms(left),
    )


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def wave_terms(phase: Array, steps: int) -> Array:
    """``(n, 2 ORDERS)`` cos and sin of k N phi for phases ``(n,)``, k after k."""
    angle = steps * phase[:, np.newaxis] * np.arange(1, ORDERS + 1)
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(len(phase), -1)


def compensate(wrapped: WrappedPhase, terms: PhaseTerms) -> WrappedPhase:
    """The phase without its terms, and the sigma that goes with it; both ``(H, W)``, rad."""
    error, slope = terms.error_at(wrapped.phase)
    phase = np.angle(np.exp(1j * (wrapped.phase - error))).astype(np.float32)
    sigma = wrapped.sigma * np.abs(1 - slope)
    return replace(wrapped, phase=phase, sigma=sigma.astype(np.float32))


def notice_response(
    capture: Capture, response: Response | None, kept: Response | None = None
) -> Iterator[Finding]:
    """What was used of a response, which fringes it is not for, or why the rig's was not used."""
    if response is None:
        why = None if kept is None else _unfit(capture, kept)
        if why is not None:
            yield Finding("note", f"the rig's response was not used: {why}", name="response")
        return
    unfit = [item for item in _fringes(capture) if not _serves(response, item)]
    yield Finding(
        "note",
        f"response by {response.kind}, found by {response.way} in {response.source}, was used.",
        name="response",
    )
    for fringe in unfit:
        message = f"it has no terms for {_words(fringe)}, which stay as they are."
        yield Finding("warning", f"the response: {message}", "Measure it with these fringes too.")


def choose_response(
    capture: Capture, asked: Response | None, kept: Response | None
) -> Response | None:
    """The response that is asked for; else the one that the rig keeps, where it fits the capture.

    Raises
    ------
    UsageError
        The one asked for does not fit: another projector's; found with patterns that were bent
        otherwise; or it has no terms for any of the capture's fringes.
    """
    if asked is not None:
        why = _unfit(capture, asked)
        if why is not None:
            raise UsageError(why)
        return asked
    return kept if kept is not None and _unfit(capture, kept) is None else None


def _unfit(capture: Capture, response: Response) -> str | None:
    """Why a response would do nothing, or undo what the patterns did; None where it fits."""
    elsewhere = response.elsewhere(capture.sequence.width, capture.sequence.height)
    if elsewhere is not None:
        return elsewhere
    shown, known = predistortion_of(capture), response.predistorted_by
    if shown != known:
        return (
            f"{capture.name} was shown with {_bent_words(shown)}, and the response was found with "
            f"{_bent_words(known)}: decode it without, or measure it with these"
        )
    fringes = _fringes(capture)
    if not fringes or any(_serves(response, fringe) for fringe in fringes):
        return None
    return (
        f"the response has no terms for {_words(fringes[0])} of {fringes[0].frame_count} steps: "
        "measure it with the fringes of this capture"
    )


def predistortion_of(capture: Capture) -> str | None:
    """What had bent the patterns of a capture, as its provenance says; None for plain ones."""
    bent = capture.provenance.get(PREDISTORTED)
    return None if bent is None else str(bent)


def _bent_words(bent: str | None) -> str:
    return "plain patterns" if bent is None else f"patterns pre-distorted by {bent}"


def _fringes(capture: Capture) -> list[Fringe]:
    """Of the first group, the one that is decoded."""
    return [fringe for fringe, *_ in capture.select().find(Fringe)]


def _serves(response: Response, fringe: Fringe) -> bool:
    exponent = isinstance(response.correction, ImageExponent)
    return exponent or find_terms(response, fringe) is not None


def _words(fringe: Fringe) -> str:
    return f"fringes of {fringe.period_px:.4g} px along {fringe.axis}"
