"""Planes by orthogonal least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.geometry.forms.checks import check_points
from fringeworks.geometry.forms.deviations import band95_of, range_of, rms_per_freedom

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PlaneFit:
    """A plane ``normal . X = offset_mm`` with the signed distances of its points.

    The normal is of length one and looks at the origin of the frame (the camera), so `offset_mm`
    is never positive.
    """

    normal: Array
    offset_mm: float
    deviations_mm: Array

    @property
    def form_rms_mm(self) -> float:
        """Root mean square distance, per degree of freedom (three parameters are fitted)."""
        return rms_per_freedom(self.deviations_mm, parameters=3)

    @property
    def flatness_mm(self) -> float:
        """Range of the signed distances: grows with the number of points by noise alone."""
        return range_of(self.deviations_mm)

    @property
    def band95_mm(self) -> float:
        """Width between the 2.5 % and 97.5 % quantiles of the distances (ISO 10360-13's manner)."""
        return band95_of(self.deviations_mm)


def fit_plane(points: Array) -> PlaneFit:
    """Orthogonal least-squares plane through points ``(n, 3)``, mm; no point is left out.

    Raises
    ------
    MeasurementError
        Fewer than three points, some of them not finite, or all of them on one line.
    ShapeError
        Not ``(n, 3)``.
    """
    check_points(points, form="plane", least=3)
    centre = points.mean(axis=0)
    centred = points - centre
    spread, axes = np.linalg.eigh(centred.T @ centred)
    if spread[1] <= 1e-12 * max(spread[2], 1e-300):
        raise MeasurementError(f"the {len(points)} points lie on one line: no plane is defined")
    normal = axes[:, 0]
    offset = float(normal @ centre)
    if offset > 0:
        normal, offset = -normal, -offset
    return PlaneFit(normal, offset, centred @ normal)
