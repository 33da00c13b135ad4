"""Photon transfer from captures to a camera's figures, and what cannot be told from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from fringeworks.errors import DecodeError, UsageError
from fringeworks.model import Capture, Finding
from fringeworks.phase.photon_transfer.black import (
    dark_level,
    darkest,
    expose_series,
    fit_linearity,
    level_without_exposure,
)
from fringeworks.phase.photon_transfer.fit import LEAST_POINTS, VarianceLine, fit_variance
from fringeworks.phase.photon_transfer.levels import count_levels, find_saturation, step_of
from fringeworks.phase.photon_transfer.nouns import (
    BlackWay,
    CurvePoints,
    Estimate,
    PhotonTransfer,
)
from fringeworks.phase.photon_transfer.samples import (
    Ruler,
    gather,
    lay_ruler,
    points_of,
    repeated_frames,
)

LEAST_SPAN = 0.1
"""Of full scale, from the lowest to the highest level of the fit."""

LEAST_KNOWN_BLACK = 0.01
"""Of full scale, 1 sd: a black level that is worse known is not known."""

NOTABLE_MISFIT = 0.03
NOTABLE_MOVED = 0.02
MOST_MOVED = 0.5
CERTAIN_SIGMAS = 3.0


def measure_noise(captures: Sequence[Capture], *, dark: Sequence[Capture] = ()) -> PhotonTransfer:
    """Gain, read noise, black level and full scale by photon transfer (EMVA 1288).

    Any repeated sets serve: flat levels, fringes, several exposures. `dark` holds captures without
    light, lens capped; without them the black level comes from sets of one pattern at several
    exposures, and else is what the captures say.

    Raises
    ------
    DecodeError
        No repeats; all saturated or dark; levels too much alike; scene or light unsteady; frames
        of `dark` that are brighter than those with light.
    UsageError
        Captures that are not of one camera.
    """
    everything = (*captures, *dark)
    _check_one_camera(everything)
    _check_repeats(captures)
    counts = count_levels(everything)
    step, seen = step_of(counts), find_saturation(counts, step_of(counts))
    full_scale = captures[0].sensor.full_scale if seen is None else float(seen)
    occurring = np.flatnonzero(counts)
    ruler = lay_ruler(int(occurring[0]), int(occurring[-1]), step=step, top=full_scale)
    points, moved = _gather(everything, ruler)
    _check_points(points, full_scale)
    line = fit_variance(points, rounding=step**2 / 12)
    _check_line(line)
    series = expose_series(captures, full_scale)
    black, way = _find_black(captures, dark, full_scale)
    return PhotonTransfer(
        gain=Estimate(line.gain, line.gain_sigma),
        read_noise=line.read_noise(black),
        black_level=black,
        black_way=way,
        full_scale=full_scale,
        saturates=seen is not None,
        step=step,
        points=points,
        offset=line.offset,
        misfit=line.misfit,
        moved_share=moved,
        linearity=fit_linearity(series, black=black.value, full_scale=full_scale),
        findings=tuple(
            chain(
                _notice_black(captures, dark, line, way),
                _notice_levels(captures, step, seen),
                _notice_curve(line, moved),
            )
        ),
    )


def _check_one_camera(captures: Sequence[Capture]) -> None:
    first = captures[0]
    for capture in captures[1:]:
        mine, other = _camera_of(first), _camera_of(capture)
        if mine != other:
            raise UsageError(
                f"captures must be of one camera: {first.name} has {mine}, {capture.name} {other}"
            )


def _camera_of(capture: Capture) -> str:
    height, width = capture.shape
    return f"{width}x{height} px of {8 * capture.frames[0].itemsize} bits"


def _check_repeats(captures: Sequence[Capture]) -> None:
    if not any(True for _ in repeated_frames(captures)):
        raise DecodeError(
            f"no set of {', '.join(item.name for item in captures)} is repeated: noise is what "
            "repeats differ by. Take two images or more of each (`repeats = 2` in the set; "
            "`fringeworks patterns noise` shows such levels)"
        )


def _gather(captures: Sequence[Capture], ruler: Ruler) -> tuple[CurvePoints, float]:
    sums, moved = gather(repeated_frames(captures), ruler)
    if moved > MOST_MOVED:
        raise DecodeError(
            f"{moved:.0%} of the image changes between repeats by more than noise: keep scene and "
            "camera still, automatic exposure off, and expose for whole periods of the mains"
        )
    return points_of(sums, ruler.step), moved


def _check_points(points: CurvePoints, full_scale: float) -> None:
    level = points.level[points.used]
    if len(points.level) and not len(level):
        raise DecodeError(
            f"every level, {points.level.min():.4g} to {points.level.max():.4g}, is saturated, "
            "clipped at 0, or has no noise that rounding does not hide: change the exposure, or "
            "the camera's gain, or record more bits, and let no repeat be a copy"
        )
    if len(level) < LEAST_POINTS or np.ptp(level) < LEAST_SPAN * full_scale:
        span = f"{level.min():.4g} to {level.max():.4g}" if len(level) else "none"
        raise DecodeError(
            f"the levels that can be used, {span} of {full_scale:g}, are too much alike for a "
            "gain: show several levels from dark to bright (`fringeworks patterns noise`), or one "
            "at several exposures"
        )


def _check_line(line: VarianceLine) -> None:
    if line.gain < -CERTAIN_SIGMAS * line.gain_sigma:
        raise DecodeError(
            "the noise falls where light grows, as no camera's own does: switch its gamma, "
            "denoising, automatic gain and compression off"
        )


def _find_black(
    captures: Sequence[Capture], dark: Sequence[Capture], full_scale: float
) -> tuple[Estimate, BlackWay]:
    """The black level by the best way that there is."""
    found = dark_level(dark) if dark else None
    if found is not None:
        _check_dark(dark, lit=darkest(captures), margin=LEAST_KNOWN_BLACK * full_scale)
        return found, "dark"
    found = level_without_exposure(expose_series(captures, full_scale))
    if found is not None and found.sigma <= LEAST_KNOWN_BLACK * full_scale:
        return found, "exposures"
    return Estimate(captures[0].sensor.black_level), "assumed"


def _check_dark(dark: Sequence[Capture], *, lit: float, margin: float) -> None:
    """No frame without light is brighter than one with."""
    brightest = max(frame.mean() for item in dark for stack in item.frames for frame in stack)
    if brightest > lit + margin:
        raise DecodeError(
            f"the frames of {', '.join(item.name for item in dark)} are not dark: one has a mean "
            f"of {brightest:.4g}, and the darkest level with light {lit:.4g}. Cap the lens"
        )


def _notice_black(
    captures: Sequence[Capture], dark: Sequence[Capture], line: VarianceLine, way: BlackWay
) -> Iterator[Finding]:
    """What the black level is not known by."""
    if dark and way != "dark":
        yield Finding(
            "warning",
            "the dark frames are clipped at 0 and tell no black level.",
            "Raise the camera's black level (offset) by a few grey levels.",
            name="dark clipped",
        )
    if way == "assumed":
        low = max(-line.offset / line.gain, 0.0) if line.gain > 0 else 0.0
        high = max(darkest(captures), low)
        black = captures[0].sensor.black_level
        others = sorted({item.sensor.black_level for item in captures} - {black})
        beside = f" (others say {', '.join(f'{level:g}' for level in others)})" if others else ""
        yield Finding(
            "note",
            f"the black level cannot be told: {black:g} is taken, from {captures[0].name}{beside}; "
            f"anything from {low:.2f} to {high:.2f} fits the curve. The gain does not depend on "
            "it, the read noise does.",
            "Give frames with the lens capped (--dark), or show one pattern at two exposures.",
            name="black level",
        )


def _notice_levels(captures: Sequence[Capture], step: int, seen: int | None) -> Iterator[Finding]:
    stated = captures[0].sensor.full_scale
    if step > 1:
        bits = 8 * captures[0].frames[0].itemsize
        yield Finding(
            "warning",
            f"grey levels come in steps of {step}: fewer bits were stretched over {bits}. The "
            "figures are in the file's levels, and their rounding was taken out as such.",
            "Record the camera's own levels.",
            name="stretched levels",
        )
    if seen is None:
        yield Finding(
            "note",
            f"no frame saturates: full scale {stated:g} is what the capture says.",
            name="full scale",
        )
    elif seen != stated:
        yield Finding(
            "warning",
            f"frames saturate at {seen}, not at {stated:g}.",
            "Set full_scale in [camera].",
            name="full scale",
        )


def _notice_curve(line: VarianceLine, moved: float) -> Iterator[Finding]:
    if line.misfit > NOTABLE_MISFIT:
        yield Finding(
            "warning",
            f"the variance is no straight line of the level: it is off by {line.misfit:.1%} rms.",
            "Switch the camera's gamma, denoising, automatic gain and compression off.",
            name="no line",
        )
    if line.gain < CERTAIN_SIGMAS * line.gain_sigma:
        yield Finding(
            "warning",
            "noise does not grow with the light: the gain is not above its sigma.",
            "More repeats, more levels; are the images averaged, or simulated without shot noise?",
            name="no shot noise",
        )
    if moved > NOTABLE_MOVED:
        yield Finding(
            "warning",
            f"{moved:.1%} of the image changed between repeats by more than noise and was left "
            "out.",
            "Keep scene and camera still.",
            name="motion",
        )
