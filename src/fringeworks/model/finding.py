"""A sentence about data: what was noticed, where, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Severity: TypeAlias = Literal["note", "warning"]


@dataclass(frozen=True, slots=True)
class Finding:
    """Something a user should read; it never stops the work (an error does)."""

    severity: Severity
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.severity}: {self.message}" + (f" {self.remedy}" if self.remedy else "")
