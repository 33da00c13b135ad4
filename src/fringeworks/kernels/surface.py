"""A continuous phase, smoothed, and where it goes on from pixel to pixel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Floats = NDArray[np.float32]
Integers = NDArray[np.int32]
Marks = NDArray[np.uint8]

REACH = 2
"""Rows and columns by which `smooth_phase` looks away from a pixel."""

STEEPEST = np.float32(0.25)
"""Step of the phase, turns per pixel, from which a surface ends where nothing tells its slope."""

ZERO = np.float32(0)
ONE = np.float32(1)
TWO = np.float32(2)
HALF = np.float32(0.5)
NAN = np.float32(math.nan)
PER_RADIAN = np.float32(1 / (2 * math.pi))


@kernel
def _add_pairs(
    here: Floats, before: Floats, after: Floats, limit: np.float32, total: Floats, count: Floats
) -> None:
    """Add to total and count what two places opposite each other say of the middle."""
    for j in range(here.size):
        pair = before[j] + after[j]
        alike = abs(pair - TWO * here[j]) < limit
        total[j] += pair if alike else ZERO
        count[j] += TWO if alike else ZERO


@kernel
def _add_shifted(
    here: Floats, before: Floats, after: Floats, step: int, limit: np.float32, sums: Floats
) -> None:
    """The same for `before` taken `step` columns to the left and `after` to the right."""
    first, last = abs(step), here.size - abs(step)
    if first < last:
        _add_pairs(
            here[first:last],
            before[first - step : last - step],
            after[first + step : last + step],
            limit,
            sums[0, first:last],
            sums[1, first:last],
        )


@kernel
def smooth_phase(phase: Floats, turns: Integers, limit: float, smooth: Floats) -> None:
    """Continuous phase in turns, averaged over pairs of neighbours opposite each other.

    Pairs leave slopes alone, so that the edge of a mask bends nothing; a pair whose mean is off
    the middle by more than half of `limit` turns lies across an edge and is left out. Up to 13
    pixels are averaged. NaN where the phase is.
    """
    height, width = phase.shape
    most = np.float32(limit)
    kept = 2 * REACH + 1
    rows, sums = np.empty((kept, width), np.float32), np.empty((2, width), np.float32)
    for i in range(height + REACH):
        if i < height:
            for j in range(width):
                rows[i % kept, j] = phase[i, j] * PER_RADIAN + np.float32(turns[i, j])
        m = i - REACH
        if m < 0:
            continue
        here = rows[m % kept]
        sums[0] = here
        sums[1] = ONE
        for step in range(1, REACH + 1):
            _add_shifted(here, here, here, step, most, sums)
            if m >= step and m + step < height:
                above, below = rows[(m - step) % kept], rows[(m + step) % kept]
                for across in range(step - REACH, REACH - step + 1):
                    _add_shifted(here, above, below, across, most, sums)
        for j in range(width):
            smooth[m, j] = sums[0, j] / sums[1, j]


@kernel
def _mark_row(before: Floats, step: Floats, after: Floats, jump: np.float32, marks: Marks) -> None:
    """Mark the steps that depart little from the mean of those before and after; NaN is unknown."""
    for j in range(step.size):
        first, last = before[j] == before[j], after[j] == after[j]
        one_side = before[j] if first else after[j]
        slope = HALF * (before[j] + after[j]) if first and last else one_side
        limit = jump if first or last else STEEPEST
        off = step[j] - (slope if first or last else ZERO)
        marks[j] = np.uint8(abs(off) < limit)


@kernel
def mark_steps(at: Floats, jump: float, right: Marks, down: Marks) -> None:
    """Mark the pixels ``(H, W)`` on which a surface goes on from the left, and from above.

    `at` is a continuous phase in turns. A step may depart by less than `jump` from the slope, that
    of the steps before and after it.
    """
    least = np.float32(jump)
    height, width = at.shape
    steps = np.full((3, width + 2), NAN, np.float32)
    right[:, 0] = 0
    down[0] = 0
    for i in range(height):
        row = at[i]
        for j in range(1, width):
            steps[0, j + 1] = row[j] - row[j - 1]
        _mark_row(steps[0, :width], steps[0, 1 : width + 1], steps[0, 2:], least, right[i])
    steps[:] = NAN
    for i in range(1, height):
        before, here, after = steps[(i - 1) % 3], steps[i % 3], steps[(i + 1) % 3]
        if i == 1:
            here[:width] = at[1] - at[0]
        after[:] = NAN
        if i + 1 < height:
            above, below = at[i], at[i + 1]
            for j in range(width):
                after[j] = below[j] - above[j]
        _mark_row(before[:width], here[:width], after[:width], least, down[i])
