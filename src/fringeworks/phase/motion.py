"""A scene that moves evenly while its frames are taken, brought back to one moment.

A point that moves in space by the same step from frame to frame moves in the camera's image by
`image_px` and over the projector's pixels by a rate along each axis. Frames are resampled so that
the point stays on its pixel; then only its phase runs on, by ``2 pi rate / P`` a frame, which is an
error of the phase shifts that grows evenly: left in, it is a wave of two periods per fringe (Wang
and Han, Opt. Lett. 29, 1671, 2004, for shifts that nobody knows; Lu and others, Opt. Express 21,
30610, 2013, for motion). The rate is the one with which the frames fit a sinusoid best, and the
shifts are corrected by it. It is one rate for all pixels: a turning or bending scene, and two
objects that move differently, are beyond it.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import Axis, Capture, Fringe, Picture, Sequence, Uniform
from fringeworks.model.capture import Frames
from fringeworks.phase.demodulate import MaskRules
from fringeworks.phase.shift_rate import SetLook, coordinate_slope, find_rate, look_at_set, misfit

Array: TypeAlias = NDArray[np.float64]
Bits: TypeAlias = NDArray[np.bool_]

FOOTPRINT_PX = 2
"""Reach of the cubic spline: a saturated pixel spoils so many about it."""

LEAST_STEP_PX = 1e-3
"""A frame that is shifted by less is left as it is."""


@dataclass(frozen=True, slots=True)
class Motion:
    """What was taken from a capture, and what that gained.

    Attributes
    ----------
    image_px
        Camera px ``(x, y)`` per frame by which the scene moves in the image.
    rates_px
        Projector px per frame by which its points move along each axis that has fringes.
    reference
        Frame, counted from 0 over the capture, at whose moment the result holds.
    before, after
        Misfit of the fringes to sinusoids as a share of their modulation, rms over pixels and sets
        (of three steps: the part of the modulation that goes with the phase).
    """

    image_px: tuple[float, float]
    rates_px: tuple[tuple[Axis, float], ...]
    reference: float
    before: float
    after: float

    @property
    def still(self) -> bool:
        """Whether nothing was found to move; then the capture is as it was."""
        return not any(self.image_px) and not any(rate for _, rate in self.rates_px)


def frame_times(sequence: Sequence) -> tuple[Array, ...]:
    """When each image of each set was taken, in frames from the first one's moment.

    By `timestamps_s` where every set has them, in units of their median step; else by counting.
    """
    counts = [item.image_count for item in sequence.sets]
    stamps = [item.timestamps_s for item in sequence.sets]
    ends = np.cumsum(counts)[:-1]
    if any(stamp is None or len(stamp) != n for stamp, n in zip(stamps, counts, strict=True)):
        return tuple(np.split(np.arange(sum(counts), dtype=np.float64), ends))
    times = np.concatenate([np.asarray(stamp, np.float64) for stamp in stamps])
    step = float(np.median(np.diff(np.sort(times)))) if len(times) > 1 else 1.0
    return tuple(np.split((times - times[0]) / (step if step > 0 else 1.0), ends))


def reference_time(capture: Capture, times: Items[Array]) -> float:
    """The middle of the finest fringes.

    Raises
    ------
    DecodeError
        The capture has no fringes.
    """
    places = [
        (item.pattern.period_px, place)
        for place, item in enumerate(capture.sequence.sets)
        if isinstance(item.pattern, Fringe)
    ]
    if not places:
        raise DecodeError("motion is compensated by fringes, and the capture has none")
    return float(np.mean(times[min(places)[1]]))


def hold_still(
    capture: Capture, image_px: tuple[float, float], *, rules: MaskRules | None = None
) -> tuple[Capture, Motion]:
    """One group of a capture as if its scene had stood where it was amid its finest fringes.

    Parameters
    ----------
    capture
        One group of it; a scene that moves evenly.
    image_px
        Camera px ``(x, y)`` per frame by which it moves in the image.
    rules
        Which pixels have enough modulation to be looked at.

    Returns
    -------
    capture, motion
        Frames are resampled (cubic spline, levels rounded) and the fringes have the shifts that
        they really had. Pixels that left the image during the capture are black in all frames. A
        capture in which nothing moves is returned as it is.

    Raises
    ------
    DecodeError
        The capture has no fringes, or several exposures; too few pixels see fringes; or nothing
        stays in the image.
    """
    if capture.sequence.reference_ms is not None:
        raise DecodeError(
            "motion is taken out of frames of one exposure, and the capture has several: give each "
            "exposure its own `group` in capture.toml, and name one with --group"
        )
    rules = rules or MaskRules()
    times = frame_times(capture.sequence)
    reference = reference_time(capture, times)
    ages = [stamp - reference for stamp in times]
    followed = _follow(capture, image_px, ages)
    looks = _look(followed, ages, rules)
    rates = {axis: find_rate(found) for axis, found in looks.items()}
    raw = _look(capture, ages, rules) if any(image_px) else looks
    motion = Motion(
        image_px,
        tuple(rates.items()),
        reference,
        misfit([look for found in raw.values() for look in found], {}),
        misfit([look for found in looks.values() for look in found], rates),
    )
    if motion.still:
        return capture, motion
    return _at_one_moment(capture, followed, ages, (image_px, rates, looks)), motion


def _look(capture: Capture, ages: Items[Array], rules: MaskRules) -> dict[Axis, list[SetLook]]:
    """The fringe sets of every axis that has any."""
    looks: dict[Axis, list[SetLook]] = {}
    for place, item in enumerate(capture.sequence.sets):
        if isinstance(item.pattern, Fringe):
            look = look_at_set(
                capture.frames[place], item, ages[place], capture.sensor, rules=rules
            )
            looks.setdefault(item.pattern.axis, []).append(look)
    return looks


def _follow(capture: Capture, image_px: tuple[float, float], ages: Items[Array]) -> Capture:
    """All frames resampled so that the moving scene stays where it was at age 0."""
    if not any(image_px):
        return capture
    offsets = [np.outer(age, image_px) for age in ages]
    return _resample(capture, offsets)


def _at_one_moment(
    capture: Capture,
    followed: Capture,
    ages: Items[Array],
    found: tuple[tuple[float, float], dict[Axis, float], dict[Axis, list[SetLook]]],
) -> Capture:
    """Fringes with the shifts that they had, and codes at the coordinate that they had."""
    image_px, rates, looks = found
    slopes = {axis: coordinate_slope(items) for axis, items in looks.items()}
    offsets, sets = [], list(capture.sequence.sets)
    for place, item in enumerate(sets):
        step = np.array(image_px)
        match item.pattern:
            case Fringe() as fringe:
                sets[place] = replace(item, pattern=_true_shifts(fringe, ages[place], rates))
            case Uniform() | Picture():
                pass
            case pattern:
                # A code has no shifts to correct: it is read where the coordinate is the same.
                step = step - _along(rates, slopes, getattr(pattern, "axis", None))
        offsets.append(np.outer(ages[place], step))
    moved = _resample(capture, offsets)
    frames = tuple(
        followed.frames[place] if isinstance(item.pattern, Fringe) else moved.frames[place]
        for place, item in enumerate(sets)
    )
    size = capture.sequence
    return replace(moved, sequence=Sequence(size.width, size.height, tuple(sets)), frames=frames)


def _along(rates: dict[Axis, float], slopes: dict[Axis, float], axis: Axis | None) -> Array:
    """Camera px per frame over which the coordinate of an axis changes by its rate."""
    if axis is None or axis not in rates or not slopes[axis]:
        return np.zeros(2)
    step = rates[axis] / slopes[axis]
    return np.array([step, 0.0]) if axis == "x" else np.array([0.0, step])


def _true_shifts(fringe: Fringe, age: Array, rates: dict[Axis, float]) -> Fringe:
    """Repeats of a frame share the mean of their moments."""
    moments = age.reshape(fringe.frame_count, -1).mean(axis=1)
    ran = 2 * np.pi * rates[fringe.axis] / fringe.period_px * moments
    return replace(fringe, shifts_rad=tuple((np.array(fringe.shifts_rad) - ran).tolist()))


def _resample(capture: Capture, offsets: Items[Array]) -> Capture:
    """Each image taken `offsets` ``(n, 2)`` px from where it is, (x, y)."""
    extent = np.concatenate(offsets)
    lost = _leaves(capture.shape, extent)
    if lost.all():
        farthest = float(np.abs(extent).max())
        raise DecodeError(
            f"the motion, up to {farthest:.0f} camera px in the capture, leaves no pixel inside "
            "the image in all frames: it is px per frame, not over the whole capture"
        )
    saturation, full = capture.sensor.saturation, capture.sensor.full_scale
    stacks: list[Any] = [
        np.stack(
            [
                _shifted(image, row, (saturation, full), lost)
                for image, row in zip(stack, rows, strict=True)
            ]
        )
        for stack, rows in zip(capture.frames, offsets, strict=True)
    ]
    return replace(capture, frames=tuple(stacks))


def _leaves(shape: tuple[int, int], extent: Array) -> Bits:
    """``(H, W)`` pixels that lie outside the image in one frame at least."""
    height, width = shape
    low, high = extent.min(axis=0), extent.max(axis=0)
    x, y = np.arange(width), np.arange(height)
    across = (x + min(low[0], 0) < 0) | (x + max(high[0], 0) > width - 1)
    down = (y + min(low[1], 0) < 0) | (y + max(high[1], 0) > height - 1)
    return np.asarray(across[None, :] | down[:, None])


def _shifted(image: Frames, step: Array, levels: tuple[float, float], lost: Bits) -> Frames:
    """The image as seen `step` px (x, y) further; saturated pixels stay so, with those about."""
    from scipy.ndimage import maximum_filter, shift

    saturation, full = levels
    moved = image
    if np.abs(step).max() > LEAST_STEP_PX:
        aside = (-step[1], -step[0], *(0.0,) * (image.ndim - 2))
        floats = shift(image.astype(np.float32), aside, order=3, mode="nearest")
        burnt = image >= saturation
        if burnt.any():
            reach = (2 * FOOTPRINT_PX + 1,) * 2 + (1,) * (image.ndim - 2)
            near = maximum_filter(burnt, reach)
            floats[shift(near.astype(np.uint8), aside, order=0, mode="nearest") > 0] = full
        moved = cast(Frames, np.rint(np.clip(floats, 0, full)).astype(image.dtype))
    out = moved.copy()
    out[lost] = 0
    return out
