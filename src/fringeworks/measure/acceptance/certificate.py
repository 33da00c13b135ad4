"""All positions of a test, their values beside the limits, and what is proven."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np

from fringeworks.measure.acceptance.artefacts import Artefacts
from fringeworks.measure.acceptance.decision import Decision, decide
from fringeworks.measure.acceptance.positions import BallFound, BarFound, FlatFound
from fringeworks.model import Finding

Quantity: TypeAlias = Literal["PF", "PS", "SD", "F"]
Outcome: TypeAlias = Decision | Literal["incomplete", "no limit"]

POSITIONS: Mapping[Quantity, int] = MappingProxyType({"PF": 10, "PS": 10, "SD": 7, "F": 6})
"""How many of each a test has."""


@dataclass(frozen=True, slots=True)
class Reading:
    """A signed value with the test's own U, k = 2; `faults` say why it does not count."""

    name: str
    value_mm: float
    u95_mm: float
    faults: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Lot:
    """All positions of one quantity. `limit_mm` is None where none was stated."""

    quantity: Quantity
    readings: tuple[Reading, ...]
    limit_mm: float | None = None

    @property
    def needed(self) -> int:
        return POSITIONS[self.quantity]

    @property
    def counted(self) -> tuple[Reading, ...]:
        """Those without faults."""
        return tuple(one for one in self.readings if not one.faults)

    @property
    def worst(self) -> Reading | None:
        """The counted one of the largest size."""
        return max(self.counted, key=lambda one: abs(one.value_mm), default=None)

    @property
    def decisions(self) -> tuple[Decision | None, ...]:
        """One per reading, None where it does not count or no limit is stated."""
        if self.limit_mm is None:
            return (None,) * len(self.readings)
        return tuple(
            None if one.faults else decide(one.value_mm, self.limit_mm, one.u95_mm)
            for one in self.readings
        )

    @property
    def outcome(self) -> Outcome:
        """One that fails is enough; too few prove nothing; all must conform."""
        if self.limit_mm is None:
            return "no limit"
        if "fails" in self.decisions:
            return "fails"
        if len(self.counted) < self.needed:
            return "incomplete"
        return "undecided" if "undecided" in self.decisions else "conforms"


@dataclass(frozen=True, slots=True)
class Words:
    """The test in everyday words; None where no position tells it.

    Attributes
    ----------
    point_precision_mm, local_planarity_mm
        Root mean square over all flats.
    global_planarity_mm
        That of the worst flat.
    dimension_error_share, dimension_trueness
        Of the ball bar's length, signed: mean, and that of the largest size.
    """

    point_precision_mm: float | None
    local_planarity_mm: float | None
    global_planarity_mm: float | None
    dimension_error_share: float | None
    dimension_trueness: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Certificate:
    """What a test has found.

    Attributes
    ----------
    volume_mm
        Sides of the measuring volume, along x, y and z.
    limits_mm
        Largest permitted size of each quantity; those not stated are absent.
    trim_per_mille
        Points of each form that could be left out.
    findings
        What is not as such a test wants it.
    """

    name: str
    volume_mm: tuple[float, float, float]
    artefacts: Artefacts
    limits_mm: Mapping[Quantity, float]
    trim_per_mille: float
    balls: tuple[BallFound, ...] = ()
    bars: tuple[BarFound, ...] = ()
    flats: tuple[FlatFound, ...] = ()
    findings: tuple[Finding, ...] = field(default=())

    @property
    def diagonal_mm(self) -> float:
        return math.hypot(*self.volume_mm)

    @property
    def lots(self) -> tuple[Lot, ...]:
        """PF, PS, SD and F: those that are measured, or have a limit."""
        readings: dict[Quantity, tuple[Reading, ...]] = {
            "PF": tuple(Reading(b.name, b.pf_mm, b.pf_u95_mm, b.faults) for b in self.balls),
            "PS": tuple(Reading(b.name, b.ps_mm, b.ps_u95_mm, b.faults) for b in self.balls),
            "SD": tuple(Reading(b.name, b.sd_mm, b.sd_u95_mm, b.faults) for b in self.bars),
            "F": tuple(Reading(f.name, f.f_mm, f.f_u95_mm, f.faults) for f in self.flats),
        }
        return tuple(
            Lot(quantity, found, self.limits_mm.get(quantity))
            for quantity, found in readings.items()
            if found or quantity in self.limits_mm
        )

    @property
    def outcome(self) -> Outcome:
        """That of the lots that have a limit: the first of fails, incomplete, undecided."""
        found = {lot.outcome for lot in self.lots if lot.limit_mm is not None}
        order: tuple[Outcome, ...] = ("fails", "incomplete", "undecided", "conforms")
        return next((one for one in order if one in found), "no limit")

    @property
    def words(self) -> Words:
        flats, bar = [flat.planarity for flat in self.flats], self.artefacts.bar
        bends = [one.global_mm for one in flats if one.global_mm is not None]
        shares = [] if bar is None else [found.sd_mm / bar.value_mm for found in self.bars]
        return Words(
            point_precision_mm=_pooled([one.point_precision_mm for one in flats]),
            local_planarity_mm=_pooled([one.local_mm for one in flats]),
            global_planarity_mm=max(bends, default=None),
            dimension_error_share=float(np.mean(shares)) if shares else None,
            dimension_trueness=max(shares, key=abs, default=None),
        )


def _pooled(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.sqrt(np.mean(np.square(known)))) if known else None
