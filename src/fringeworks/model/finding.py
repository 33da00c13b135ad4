"""A sentence about data: what was noticed, where, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Severity: TypeAlias = Literal["note", "warning"]
CostUnit: TypeAlias = Literal["mm", "px", "rad"]


@dataclass(frozen=True, slots=True)
class Finding:
    """Something a user should read; it never stops the work (an error does).

    Attributes
    ----------
    severity, message, remedy
        How bad it is, what was noticed, and what to do about it.
    name
        What programs know the fault by, as "gamma"; empty for what has no name.
    cost, unit
        Error of depth (mm), of the projector coordinate (px) or of the phase (rad) that it makes,
        rms; None where that was not worked out.
    where
        The set, frame or device.
    """

    severity: Severity
    message: str
    remedy: str = ""
    name: str = ""
    cost: float | None = None
    unit: CostUnit | None = None
    where: str = ""

    def __str__(self) -> str:
        return f"{self.severity}: {self.message}" + (f" {self.remedy}" if self.remedy else "")
