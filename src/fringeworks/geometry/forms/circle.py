"""Circles in a plane by orthogonal least squares: a cylinder that keeps its axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.geometry.forms.curved import (
    CIRCLE,
    Curved,
    covariance_of,
    fit_algebraic,
    refine,
    settled,
)
from fringeworks.geometry.forms.deviations import rms_per_freedom

Array = NDArray[np.float64]

PARAMETERS = 3
_AXIS = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class CircleFit:
    """A circle with the signed distances of its points, positive outside.

    Attributes
    ----------
    centre_mm
        ``(2,)``, in the points' plane.
    radius_sigma_mm
        Standard deviation of the radius from what is left of the points, their errors taken as
        independent.
    deviations_mm
        ``(n,)`` in the points' order.
    """

    centre_mm: Array
    radius_mm: float
    radius_sigma_mm: float
    deviations_mm: Array

    @property
    def form_rms_mm(self) -> float:
        """Root mean square distance, per degree of freedom (three parameters are fitted)."""
        return rms_per_freedom(self.deviations_mm, parameters=PARAMETERS)


def fit_circle(points: Array) -> CircleFit:
    """Orthogonal least-squares circle through points ``(n, 2)``, mm; no point is left out.

    Raises
    ------
    MeasurementError
        Fewer than four points, some of them not finite, all on one line or within scatter of one,
        or no circle settles.
    ShapeError
        Not ``(n, 2)``.
    """
    _check(points)
    lifted = np.column_stack([points, np.zeros(len(points))])
    weights = np.ones(len(points))
    surface = refine(_start(points), lifted, weights, free=CIRCLE)
    found = settled(surface, points, form="circle")
    covariance = covariance_of(found, lifted, weights, form="circle", free=CIRCLE)
    return CircleFit(
        centre_mm=found.centre[:2],
        radius_mm=1 / found.curvature,
        radius_sigma_mm=float(np.sqrt(covariance[1, 1])) / found.curvature**2,
        deviations_mm=found.distances(lifted),
    )


def _check(points: Array) -> None:
    if points.ndim != 2 or points.shape[1] != 2:
        raise ShapeError(f"points must be (n, 2), got {points.shape}")
    if len(points) <= PARAMETERS:
        raise MeasurementError(
            f"a circle needs at least {PARAMETERS + 1} points, got {len(points)}"
        )
    void = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
    if void:
        raise MeasurementError(
            f"{void} of the {len(points)} points are not finite: leave void points out"
        )
    if not np.ptp(points, axis=0).any():
        raise MeasurementError(f"the {len(points)} points are one point: no circle is defined")


def _start(points: Array) -> Curved:
    """Taubin's circle through points ``(n, 2)``."""
    middle = points.mean(axis=0)
    curvature, foot, normal = fit_algebraic(points - middle)
    toward = np.array([*normal, 0.0])
    frame = np.stack([toward, _AXIS, np.cross(toward, _AXIS)], axis=1)
    return Curved(np.array([*(middle + foot), 0.0]), frame, float(curvature), straight=True)
