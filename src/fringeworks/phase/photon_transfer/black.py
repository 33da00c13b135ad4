"""The level without light, from frames without any or from several exposures; and linearity."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fringeworks.model import Capture, Frames, Pattern
from fringeworks.phase.photon_transfer.nouns import Array, Estimate, Linearity
from fringeworks.phase.photon_transfer.samples import MOST_CLIPPED

LEAST_EXPOSURES = 5
"""For linearity: a line through fewer leaves nothing to see."""

LEAST_PIXELS = 1_000
ROUNDED = 0.29
"""1 sd of a level that only rounding spreads."""

LEAST_FLICKER = 1e-4
"""Of a frame's light; a steadier lamp is not known to be one from two frames."""

LINEAR_RANGE = (0.05, 0.95)
"""Of full scale (EMVA 1288, linearity)."""


@dataclass(frozen=True, slots=True, eq=False)
class Exposures:
    """Mean levels ``(M,)`` of one pattern, over the same pixels, by exposure; and 1 sd of each."""

    exposure_ms: Array
    level: Array
    sigma: Array


def dark_level(dark: Sequence[Capture]) -> Estimate | None:
    """Mean of frames without light; None where they are clipped at zero.

    Its sigma is of the frames' means among each other, and of the pixels' own levels.
    """
    frames = [frame for capture in dark for stack in capture.frames for frame in stack]
    if np.mean([np.mean(frame == 0) for frame in frames]) > MOST_CLIPPED:
        return None
    means = [float(frame.mean(dtype=np.float64)) for frame in frames]
    pixels = np.mean(frames, axis=0, dtype=np.float64)
    parts = (
        float(np.std(means, ddof=1)) / len(means) ** 0.5 if len(means) > 1 else ROUNDED,
        float(np.std(pixels)) / pixels.size**0.5,
        0.0 if np.ptp(frames[0]) > 0 else ROUNDED,
    )
    return Estimate(float(np.mean(means)), math.hypot(*parts))


def level_without_exposure(series: Sequence[Exposures]) -> Estimate | None:
    """Where the lines of level against exposure meet no exposure; None without two exposures."""
    found = [_intercept(item) for item in series]
    if not found:
        return None
    weights = np.array([item.sigma**-2 for item in found])
    value = np.sum(weights * [item.value for item in found]) / weights.sum()
    return Estimate(max(float(value), 0.0), float(weights.sum() ** -0.5))


def _intercept(item: Exposures) -> Estimate:
    design = np.stack([np.ones_like(item.level), item.exposure_ms], axis=1)
    weighted = design / item.sigma[:, np.newaxis]
    covariance = np.linalg.inv(weighted.T @ weighted)
    solved = covariance @ weighted.T @ (item.level / item.sigma)
    left = (item.level - design @ solved) / item.sigma
    freedom = len(left) - 2
    scale = max(float(left @ left) / freedom, 1.0) if freedom else 1.0
    return Estimate(float(solved[0]), float(np.sqrt(scale * covariance[0, 0])))


def expose_series(captures: Sequence[Capture], top: float) -> list[Exposures]:
    """Each pattern that is shown at two exposures or more, over the pixels never clipped."""
    return [
        series
        for sets in _by_pattern(captures).values()
        if len(sets) > 1 and (series := _series(sets, top)) is not None
    ]


def _by_pattern(captures: Sequence[Capture]) -> dict[Pattern, dict[float, Frames]]:
    """Stacks ``(f, n, H, W)`` by pattern and exposure; of equal ones the last."""
    found: dict[Pattern, dict[float, Frames]] = {}
    for capture in captures:
        for item, stack in capture:
            if item.exposure_ms is not None and stack.ndim == 3:
                shaped = stack.reshape(-1, item.repeats, *stack.shape[1:])
                found.setdefault(item.pattern, {})[item.exposure_ms] = shaped
    return found


def _series(sets: dict[float, Frames], top: float) -> Exposures | None:
    """None where fewer than two exposures leave pixels that are never clipped."""
    known = {exposure: _unclipped(sets[exposure], top) for exposure in sorted(sets)}
    used = [time for time, good in known.items() if np.count_nonzero(good) >= LEAST_PIXELS]
    good = np.all([known[time] for time in used], axis=0)
    while len(used) > 1 and np.count_nonzero(good) < LEAST_PIXELS:
        used.pop()
        good = np.all([known[time] for time in used], axis=0)
    if len(used) < 2:
        return None
    means = [sets[time][:, :, good].mean(axis=(0, 2), dtype=np.float64) for time in used]
    return Exposures(np.array(used), np.array([m.mean() for m in means]), _scatter(means))


def _unclipped(frames: Frames, top: float) -> Array:
    return np.asarray(((frames > 0) & (frames < top)).all(axis=(0, 1)))


def _scatter(means: Sequence[Array]) -> Array:
    """1 sd of each exposure's mean: flicker is a share of the light, one for all of them."""
    freedom = sum(len(item) - 1 for item in means)
    shares = [float(np.square(item / item.mean() - 1).sum()) for item in means]
    flicker = max(np.sqrt(sum(shares) / max(freedom, 1)), LEAST_FLICKER)
    return np.array([flicker * item.mean() / np.sqrt(len(item)) for item in means])


def fit_linearity(
    series: Sequence[Exposures], *, black: float, full_scale: float
) -> Linearity | None:
    """Deviation from the line of least relative deviation, of the pattern with most exposures.

    None where it has fewer than five from 5 to 95 % of the way to full scale.
    """
    low, high = (share * (full_scale - black) for share in LINEAR_RANGE)
    signals = [item.level - black for item in series]
    inside = [(signal >= low) & (signal <= high) for signal in signals]
    counts = [int(np.count_nonzero(used)) for used in inside]
    if max(counts, default=0) < LEAST_EXPOSURES:
        return None
    best = int(np.argmax(counts))
    times, signal, used = series[best].exposure_ms, signals[best], inside[best]
    slope, offset = np.polyfit(times[used], signal[used], 1, w=1 / signal[used]).tolist()
    deviation = signal / (slope * times + offset) - 1
    return Linearity(times, signal, slope, offset, deviation, used)


def darkest(captures: Sequence[Capture]) -> float:
    """Lowest of the repeated sets' mean levels: black is at most that."""
    return min(_means(captures))


def _means(captures: Sequence[Capture]) -> Iterator[float]:
    for capture in captures:
        for item, stack in capture:
            if item.repeats > 1:
                yield float(stack.mean(dtype=np.float64))
