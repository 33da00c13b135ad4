"""What is measured for an acceptance: calibrated lengths and forms, and what they leave open.

Uncertainties are expanded ones, k = 2, as a calibration certificate states them (names end in
`u95`). The test's own uncertainty is put together in the manner of ISO/TS 23165, of the artefact
and its temperature alone: what the sensor adds is what is tested.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

REFERENCE_C = 20.0
"""Temperature that lengths are stated at (ISO 1)."""


@dataclass(frozen=True, slots=True)
class Warmth:
    """Temperature of the artefacts while they are measured, degrees Celsius, and its U, k = 2."""

    temperature_c: float = REFERENCE_C
    u95_k: float = 0.0


@dataclass(frozen=True, slots=True)
class CalibratedLength:
    """A diameter or a distance with the certificate that states it.

    Attributes
    ----------
    value_mm, u95_mm
        At `calibrated_at_c`.
    cte_per_k, cte_u95_per_k
        Coefficient of thermal expansion.
    """

    value_mm: float
    u95_mm: float = 0.0
    cte_per_k: float = 0.0
    cte_u95_per_k: float = 0.0
    calibrated_at_c: float = REFERENCE_C

    def at(self, warmth: Warmth) -> float:
        """The length while it is measured, mm."""
        return self.value_mm * (1 + self.cte_per_k * self._warmer(warmth))

    def u95_at(self, warmth: Warmth) -> float:
        """Its expanded uncertainty then, mm: of the certificate, the expansion, the thermometer."""
        expansion = self.value_mm * self._warmer(warmth) * self.cte_u95_per_k
        thermometer = self.value_mm * self.cte_per_k * warmth.u95_k
        return math.hypot(self.u95_mm, expansion, thermometer)

    def _warmer(self, warmth: Warmth) -> float:
        return warmth.temperature_c - self.calibrated_at_c


@dataclass(frozen=True, slots=True)
class Form:
    """How far an artefact is from its ideal form: range, mm, and the U of that, k = 2."""

    range_mm: float = 0.0
    u95_mm: float = 0.0

    @property
    def test_u95_mm(self) -> float:
        """What it adds to a measured range: ``u^2 = (range / 2)^2 + (U / 2)^2``, twice u."""
        return math.hypot(self.range_mm, self.u95_mm)


@dataclass(frozen=True, slots=True)
class Artefacts:
    """What a test is made with; what it has no positions of is None.

    Attributes
    ----------
    ball, ball_form
        Diameter and form of the ball that PF and PS are measured on.
    bar
        Distance of the centres of the ball bar.
    flat
        Flatness of the flat.
    """

    ball: CalibratedLength | None = None
    ball_form: Form = field(default_factory=Form)
    bar: CalibratedLength | None = None
    flat: Form | None = None
    warmth: Warmth = field(default_factory=Warmth)
