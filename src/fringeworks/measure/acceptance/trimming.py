"""Fits that may leave a few points out: those farthest from a first fit, once, and counted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.geometry.forms import PlaneFit, SphereFit

Array = NDArray[np.float64]
Fit = TypeVar("Fit", PlaneFit, SphereFit)

MOST_PER_MILLE = 3.0
"""What VDI/VDE 2634-2 permits."""


@dataclass(frozen=True, slots=True, eq=False)
class Trimmed(Generic[Fit]):
    """A fit through the points that stay.

    Attributes
    ----------
    stay
        ``(n,)``, of the points that were offered.
    """

    fit: Fit
    stay: NDArray[np.bool_]

    @property
    def left_out(self) -> int:
        return int(np.count_nonzero(~self.stay))


def fit_trimmed(
    points: Array, fit: Callable[[Array], Fit], *, per_mille: float = MOST_PER_MILLE
) -> Trimmed[Fit]:
    """Fit all points ``(n, 3)``, leave out the farthest, and fit the rest once more.

    Left out are ``floor(n per_mille / 1000)`` points.

    Raises
    ------
    UsageError
        `per_mille` is not 0 to 3.
    MeasurementError
        As `fit`.
    """
    if not 0 <= per_mille <= MOST_PER_MILLE:
        raise UsageError(f"trim_per_mille must be 0 to {MOST_PER_MILLE:g}, got {per_mille:g}")
    first = fit(points)
    count = int(len(points) * per_mille / 1000)
    stay = np.ones(len(points), dtype=np.bool_)
    if count == 0:
        return Trimmed(first, stay)
    stay[np.argpartition(np.abs(first.deviations_mm), -count)[-count:]] = False
    return Trimmed(fit(points[stay]), stay)
