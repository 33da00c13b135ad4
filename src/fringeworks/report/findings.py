"""Findings in plain values and words, alike for `check`, `calibrate` and `verify`."""

from __future__ import annotations

from typing import Any

from fringeworks.model import Finding


def summarise_finding(finding: Finding) -> dict[str, Any]:
    """A finding as JSON has it; the cost's unit stands beside it."""
    return {
        "name": finding.name,
        "severity": finding.severity,
        "cost": finding.cost,
        "unit": finding.unit,
        "where": finding.where,
        "message": finding.message,
        "remedy": finding.remedy,
    }


def cost_words(finding: Finding) -> str:
    """``0.31 mm``, or that it was not worked out."""
    return "unknown" if finding.cost is None else f"{finding.cost:.2g} {finding.unit}"
