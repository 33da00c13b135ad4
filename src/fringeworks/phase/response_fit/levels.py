"""The active way: uniform frames of many levels, and the light that each makes.

Of both devices' curves only the joint one is seen here: a camera's own would be told apart by
exposures of one level, which are not asked for. Pre-distortion by the joint curve makes the image
straight, and the light too where the camera is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import Capture, Frames, GreyCurve, RegionCurve, Uniform

Array: TypeAlias = NDArray[np.float64]

LEAST_LEVELS = 9
LEAST_SPAN = 1 / 8
"""Of full scale: pixels whose white is nearer to black are left out."""

LARGEST_FALL = 0.02
"""Of white: a level's light may be off by this from what never falls. A lamp's flicker of 0.3 %
makes a fifth of it."""

LEAST_PIXELS = 1_000
REGIONS = (3, 3)
WAVE_SAMPLES = 256


def has_levels(capture: Capture) -> bool:
    """Whether the capture shows grey levels enough."""
    return len({pattern.level for pattern, *_ in capture.find(Uniform)}) >= LEAST_LEVELS


def fit_curve(capture: Capture) -> GreyCurve:
    """The curve of a capture of uniform levels, black and white among them.

    Light of a level is the sum over the pixels of its frame less black, over that of white less
    black: bright pixels count most, and the scene's albedo cancels.

    Raises
    ------
    DecodeError
        Too few levels; no black or white; too few pixels that are lit and not saturated; or a
        level that makes less light than those below it.
    """
    if not has_levels(capture):
        raise DecodeError(
            f"{capture.name} must show at least {LEAST_LEVELS} different grey levels, got "
            f"{len({pattern.level for pattern, *_ in capture.find(Uniform)})}: show `fringeworks "
            "patterns response`"
        )
    stacks = _stacks_of(capture)
    levels = np.array(sorted(stacks))
    if levels[0] != 0 or levels[-1] != 1:
        raise DecodeError(f"{capture.name} must show black (level 0) and white (level 1) too")
    black, white = _mean(stacks[0.0]), _mean(stacks[1.0])
    lit = _lit(capture, black, white)
    parts = _parts(lit.shape)[lit]
    size = REGIONS[0] * REGIONS[1]
    sums = np.array(
        [
            np.bincount(parts, (_mean(stacks[level]) - black)[lit], minlength=size)
            for level in levels.tolist()
        ],
        np.float64,
    )
    light = _rising(sums.sum(axis=1), levels, capture.name)
    return GreyCurve(
        levels=_floats(levels),
        light=light,
        harmonics=harmonics_of(_curve(levels, light)),
        left=_left(levels, light),
        regions=tuple(
            RegionCurve(*_bounds(part, lit.shape), _rising(sums[:, part], levels, capture.name))
            for part in np.flatnonzero(np.bincount(parts) >= LEAST_PIXELS).tolist()
        ),
    )


def harmonics_of(curve: GreyCurve, *, before: GreyCurve | None = None) -> tuple[float, float]:
    """a2 / a1 and a3 / a1 of a sinusoid's light, pre-distorted by the curve `before` if given."""
    phase = 2 * np.pi * np.arange(WAVE_SAMPLES) / WAVE_SAMPLES
    shown = (1 + np.cos(phase)) / 2
    light = curve.light_of(shown if before is None else before.level_of(shown))
    _, first, second, third = np.fft.rfft(light)[:4].real.tolist()
    return second / first, third / first


def _stacks_of(capture: Capture) -> dict[float, list[Frames]]:
    """The frames of each level."""
    stacks: dict[float, list[Frames]] = {}
    for pattern, stack, _ in capture.find(Uniform):
        stacks.setdefault(pattern.level, []).append(stack)
    return stacks


def _mean(stacks: list[Frames]) -> Array:
    """``(H, W)`` of one level's frames."""
    return np.asarray(np.mean([stack.mean(axis=0) for stack in stacks], axis=0))


def _lit(capture: Capture, black: Array, white: Array) -> NDArray[np.bool_]:
    sensor = capture.sensor
    lit = (white - black > LEAST_SPAN * sensor.full_scale) & (white < sensor.saturation)
    if np.count_nonzero(lit) < LEAST_PIXELS:
        raise DecodeError(
            f"{capture.name}: {np.mean(lit):.1%} of the pixels are lit by the projector and not "
            "saturated: change the exposure, or put a white surface there"
        )
    return lit


def _parts(shape: tuple[int, int]) -> NDArray[np.intp]:
    """``(H, W)`` number of each pixel's region, row by row."""
    rows, columns = (np.arange(size) * n // size for size, n in zip(shape, REGIONS, strict=True))
    return rows[:, np.newaxis] * REGIONS[1] + columns


def _bounds(part: int, shape: tuple[int, int]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Rows and columns of a region: its first pixel, and the one after its last."""
    places = zip(divmod(part, REGIONS[1]), shape, REGIONS, strict=True)
    rows, columns = (
        (math.ceil(at * size / n), math.ceil((at + 1) * size / n)) for at, size, n in places
    )
    return rows, columns


def _rising(sums: Array, levels: Array, name: str) -> tuple[float, ...]:
    """The nearest light, 0 to 1, that never falls (isotonic regression)."""
    from scipy.optimize import isotonic_regression

    light = sums / sums[-1]
    rising = isotonic_regression(light).x
    off = np.abs(light - rising)
    if off.max() > LARGEST_FALL:
        raise DecodeError(
            f"{name}: light does not rise with the level, at {levels[off.argmax()]:.3f} it is off "
            f"by {off.max():.1%} of white: look at the frames' order, and that exposure, gain and "
            "lamp hold still"
        )
    return _floats(np.clip(rising, 0.0, 1.0))


def _left(levels: Array, light: Sequence[float]) -> tuple[float, float]:
    """What pre-distortion by every other level leaves on the curve of all."""
    some = np.unique(np.append(np.arange(0, len(levels), 2), len(levels) - 1))
    known = _curve(levels[some], np.array(light)[some])
    return harmonics_of(_curve(levels, light), before=known)


def _curve(levels: Array, light: Sequence[float] | Array) -> GreyCurve:
    return GreyCurve(_floats(levels), _floats(light))


def _floats(values: Sequence[float] | Array) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
