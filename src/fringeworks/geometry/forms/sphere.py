"""Spheres by orthogonal least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.forms.checks import check_curved, check_points, weights_of
from fringeworks.geometry.forms.curved import (
    Curved,
    covariance_of,
    fit_algebraic,
    refine,
    settled,
    tangents,
)
from fringeworks.geometry.forms.deviations import band95_of, range_of, rms_per_freedom

Array = NDArray[np.float64]

PARAMETERS = 4


@dataclass(frozen=True, slots=True)
class SphereFit:
    """A sphere with the signed distances of its points, positive outside.

    Attributes
    ----------
    centre_mm
        ``(3,)``, in the points' frame.
    covariance
        ``(4, 4)`` mm^2 of centre and radius, from what is left of the points: it takes their
        errors as independent, and knows of no systematic ones.
    deviations_mm
        ``(n,)`` in the points' order.
    """

    centre_mm: Array
    radius_mm: float
    covariance: Array
    deviations_mm: Array

    @property
    def radius_sigma_mm(self) -> float:
        """Standard deviation of the radius: see `covariance`."""
        return float(np.sqrt(self.covariance[-1, -1]))

    @property
    def form_rms_mm(self) -> float:
        """Root mean square distance, per degree of freedom (four parameters are fitted)."""
        return rms_per_freedom(self.deviations_mm, parameters=PARAMETERS)

    @property
    def range_mm(self) -> float:
        """Range of the signed distances: grows with the number of points by noise alone."""
        return range_of(self.deviations_mm)

    @property
    def band95_mm(self) -> float:
        """Width between the 2.5 % and 97.5 % quantiles of the distances (ISO 10360-13's manner)."""
        return band95_of(self.deviations_mm)


def fit_sphere(points: Array, *, sigma_mm: Array | None = None) -> SphereFit:
    """Orthogonal least-squares sphere through points ``(n, 3)``, mm; no point is left out.

    Least sum of ``(|X - centre| - radius)^2 / sigma^2`` by Levenberg-Marquardt from Taubin's
    algebraic sphere (`geometry.forms.curved`). Outliers pull it: choose the points first.

    Parameters
    ----------
    sigma_mm
        ``(n,)`` standard deviations of the points; only their ratios matter.

    Raises
    ------
    MeasurementError
        Fewer than five points, some of them not finite, all on one plane, their curvature within
        five standard deviations of none, or no sphere settles.
    ShapeError, UsageError
        Shapes that do not fit; a `sigma_mm` that is not positive.
    """
    check_points(points, form="sphere", least=PARAMETERS + 1)
    check_curved(points, form="sphere")
    weights = weights_of(sigma_mm, len(points))
    found = settled(refine(_start(points), points, weights), points, form="sphere")
    covariance = covariance_of(found, points, weights, form="sphere")
    change = change_of(found)
    return SphereFit(
        centre_mm=found.centre,
        radius_mm=1 / found.curvature,
        covariance=change @ covariance @ change.T,
        deviations_mm=found.distances(points),
    )


def change_of(found: Curved) -> Array:
    """``(4, 4)`` derivative of centre and radius by rise, curvature, and turns about the foot."""
    radius = 1 / found.curvature
    change = np.zeros((4, 4))
    change[0, :2] = 1, -(radius**2)
    change[1, 3], change[2, 2] = radius, -radius
    change[:3] = found.frame @ change[:3]
    change[3, 1] = -(radius**2)
    return change


def _start(points: Array) -> Curved:
    """Taubin's sphere through points ``(n, 3)``."""
    middle = points.mean(axis=0)
    curvature, foot, normal = fit_algebraic(points - middle)
    frame = np.stack([normal, *tangents(normal)], axis=1)
    return Curved(middle + foot, frame, float(curvature), straight=False)
