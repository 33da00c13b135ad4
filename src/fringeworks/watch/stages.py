"""Which stage of a scan takes how long."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal, TypeAlias

Stage: TypeAlias = Literal["acquire", "scan", "zones", "cloud", "log"]


class Stages:
    """Seconds of each stage that was begun, whether or not it succeeded."""

    def __init__(self) -> None:
        self.seconds: dict[Stage, float] = {}

    @contextmanager
    def timed(self, stage: Stage) -> Iterator[None]:
        """The block is a stage."""
        start_s = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = time.perf_counter() - start_s

    def row(self) -> dict[str, Any]:
        """As columns of the log."""
        return {f"{stage}_s": spent for stage, spent in self.seconds.items()}
