"""Which grey levels occur: the step between them, and where they end."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Capture

Counts = NDArray[np.int64]

ALL_LEVELS = 1 << 16
LEAST_SAMPLES = 100
PILED_UP = 10
"""Times as many pixels at the highest level as at any just below it: the frames saturate."""

BELOW_SHARE = 0.02
LEAST_BELOW = 8
"""Just below: 2 % of the levels, eight steps at least."""


def count_levels(captures: Iterable[Capture]) -> Counts:
    """How often each grey level, 0 to 65535, occurs in all frames."""
    counts = np.zeros(ALL_LEVELS, np.int64)
    for capture in captures:
        for stack in capture.frames:
            for frame in stack:
                counts += np.bincount(frame.ravel(), minlength=ALL_LEVELS)
    return counts


def step_of(counts: Counts) -> int:
    """Smallest difference of two levels that occur; 1 where only one does."""
    return int(np.diff(np.flatnonzero(counts)).min(initial=ALL_LEVELS) % ALL_LEVELS) or 1


def find_saturation(counts: Counts, step: int) -> int | None:
    """The highest level, where pixels pile up on it: there the frames saturate; else None."""
    top = int(np.flatnonzero(counts)[-1])
    below = max(round(BELOW_SHARE * top / step), LEAST_BELOW) * step
    near = counts[max(top - below, 0) : top]
    piled = counts[top] >= max(LEAST_SAMPLES, PILED_UP * int(near.max(initial=0)))
    return top if piled and top > 0 else None
