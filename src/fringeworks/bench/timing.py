"""Ratios of times, taken in one run on one thread."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.float64]
Work = Callable[[], object]

LARGEST_KEPT_BYTES = 2**25 - 2**16
"""Just below the largest block that the GNU allocator learns to keep, 32 MiB."""


@dataclass(frozen=True, slots=True)
class Race:
    """Times, s, of two pieces of work that took turns."""

    ours: Times
    theirs: Times

    @property
    def ratio(self) -> float:
        """Median over the turns of theirs / ours."""
        return float(np.median(self.theirs / self.ours))

    @property
    def best_ratio(self) -> float:
        """Least time of theirs over least time of ours."""
        return float(self.theirs.min() / self.ours.min())


def race(ours: Work, theirs: Work, *, seconds: float, turns: tuple[int, int] = (5, 200)) -> Race:
    """Let both run in turn, A B A B, for about `seconds`; a first turn that is not timed warms up.

    `turns` bounds the number of turns. The clock of a busy machine drifts; taking turns keeps the
    drift out of the ratio.
    """
    ours()
    theirs()
    times: list[tuple[float, float]] = []
    start = time.perf_counter()
    while len(times) < turns[0] or (
        len(times) < turns[1] and time.perf_counter() - start < seconds
    ):
        times.append((_time(ours), _time(theirs)))
    both = np.array(times)
    return Race(both[:, 0], both[:, 1])


def _time(work: Work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def settle_allocator() -> None:
    """Bring the process into the state of one that has run for a while.

    The GNU allocator asks the system for each large block until it has seen one freed, and keeps
    blocks of that size from then on. Without this, times of code with large temporaries, numpy's
    above all, would hang on what ran before.
    """
    block = np.empty(LARGEST_KEPT_BYTES, np.uint8)
    del block


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold OpenCV and numba to one thread. Of the package itself a large `scan` takes more."""
    import cv2
    import numba

    before = cv2.getNumThreads(), numba.get_num_threads()
    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before[0])
        numba.set_num_threads(before[1])
