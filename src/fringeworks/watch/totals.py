"""What came of a run: scans, alarms, pace, and which stage took which share of the time."""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

from fringeworks.watch.loop import Scanned

STAGES = ("acquire", "scan", "zones", "cloud", "log")


class Totals:
    """Sums over the scans of a run, from when it is made."""

    def __init__(self) -> None:
        self._begun_s = time.perf_counter()
        self._seconds = dict.fromkeys(STAGES, 0.0)
        self._alarms: Counter[str] = Counter()
        self.scans = self.failed = 0

    def add(self, made: Scanned) -> None:
        """One more."""
        self.scans += 1
        self.failed += made.row.failure is not None
        self._alarms.update(dict.fromkeys(made.zones, 0))
        self._alarms.update(made.alarms)
        for stage in STAGES[:-1]:
            self._seconds[stage] += getattr(made.row, f"{stage}_s") or 0.0
        self._seconds["log"] += made.log_s

    def summary(self) -> dict[str, Any]:
        """In plain values; `shares` of the whole time, waits in `rest`."""
        spent_s = time.perf_counter() - self._begun_s
        shares = {stage: self._seconds[stage] / spent_s for stage in STAGES}
        return {
            "scans": self.scans,
            "failed": self.failed,
            "seconds": spent_s,
            "scans_per_s": self.scans / spent_s,
            "shares": {**shares, "rest": max(0.0, 1 - sum(shares.values()))},
            "alarms": dict(self._alarms),
        }
