"""The machine's clock, and one that stands still unless somebody sleeps."""

from __future__ import annotations

import time


class MonotonicClock:
    """`time.monotonic`."""

    def now(self) -> float:
        return time.monotonic()

    def sleep(self, duration_s: float) -> None:
        time.sleep(duration_s)


class VirtualClock:
    """For benches that are simulated: waiting takes no time, work does not count."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now(self) -> float:
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        self._now_s += duration_s
