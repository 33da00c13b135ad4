"""Cylinders by orthogonal least squares."""

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
from fringeworks.geometry.forms.search import fit_in_stages, half_sphere

Array = NDArray[np.float64]

PARAMETERS = 5
DIRECTIONS = 200
"""Of the search, over half a sphere: 10 degrees apart."""

STARTS = 8
"""Best directions of the search that are followed."""


@dataclass(frozen=True, slots=True)
class CylinderFit:
    """A cylinder without ends, with the signed distances of its points, positive outside.

    Attributes
    ----------
    axis_point_mm
        ``(3,)`` point of the axis next to the points' centroid, in the points' frame.
    axis_direction
        ``(3,)`` unit; its largest component is positive.
    covariance
        ``(7, 7)`` of axis point (mm), direction and radius (mm), of rank five, from what is left
        of the points: it takes their errors as independent, and knows of no systematic ones.
    deviations_mm
        ``(n,)`` in the points' order.
    """

    axis_point_mm: Array
    axis_direction: Array
    radius_mm: float
    covariance: Array
    deviations_mm: Array

    @property
    def radius_sigma_mm(self) -> float:
        """Standard deviation of the radius: see `covariance`."""
        return float(np.sqrt(self.covariance[-1, -1]))

    @property
    def form_rms_mm(self) -> float:
        """Root mean square distance, per degree of freedom (five parameters are fitted)."""
        return rms_per_freedom(self.deviations_mm, parameters=PARAMETERS)

    @property
    def range_mm(self) -> float:
        """Range of the signed distances: grows with the number of points by noise alone."""
        return range_of(self.deviations_mm)

    @property
    def band95_mm(self) -> float:
        """Width between the 2.5 % and 97.5 % quantiles of the distances (ISO 10360-13's manner)."""
        return band95_of(self.deviations_mm)


def fit_cylinder(points: Array, *, sigma_mm: Array | None = None) -> CylinderFit:
    """Orthogonal least-squares cylinder through points ``(n, 3)``, mm; no point is left out.

    Least sum of ``(distance from the axis - radius)^2 / sigma^2`` by Levenberg-Marquardt
    (`geometry.forms.curved`). The start is the best of many axes: for directions over half a
    sphere and the points' principal ones a Taubin circle is fitted to the points seen along them;
    the best few are refined on a sample of the points, the best of those on a larger sample and
    then on all. Outliers pull it: choose the points first.

    Parameters
    ----------
    sigma_mm
        ``(n,)`` standard deviations of the points; only their ratios matter.

    Raises
    ------
    MeasurementError
        Fewer than six points, some of them not finite, all on one plane, their curvature within
        five standard deviations of none, or no cylinder settles.
    ShapeError, UsageError
        Shapes that do not fit; a `sigma_mm` that is not positive.
    """
    check_points(points, form="cylinder", least=PARAMETERS + 1)
    check_curved(points, form="cylinder")
    weights = weights_of(sigma_mm, len(points))
    found = settled(
        fit_in_stages(points, weights, search=_search, refine=refine), points, form="cylinder"
    )
    covariance = covariance_of(found, points, weights, form="cylinder")
    middle = points.mean(axis=0)
    change = change_of(found, middle)
    point, direction = axis_of(found, middle)
    return CylinderFit(
        axis_point_mm=point,
        axis_direction=direction,
        radius_mm=1 / found.curvature,
        covariance=change @ covariance @ change.T,
        deviations_mm=found.distances(points),
    )


def axis_of(found: Curved, middle: Array) -> tuple[Array, Array]:
    """``(3,)`` point of the axis next to `middle`, mm, and ``(3,)`` direction."""
    axis = found.frame[:, 1] * _sign(found)
    return found.centre + axis * float(axis @ (middle - found.centre)), axis


def _sign(found: Curved) -> float:
    """What makes the largest component of the axis positive."""
    axis = found.frame[:, 1]
    return float(np.sign(axis[np.argmax(np.abs(axis))]))


def change_of(found: Curved, middle: Array) -> Array:
    """``(7, 5)`` derivative of axis point, direction and radius by rise, curvature, and turns.

    The point next to `middle` slides along the axis as that tilts.
    """
    radius = 1 / found.curvature
    toward, along, aside = (middle - found.centre) @ found.frame
    point = np.zeros((3, 5))  # in the frame at the foot: normal, axis, across
    point[0, [0, 1, 4]] = 1, -(radius**2), -along
    point[1, [2, 4]] = aside, -toward
    point[2, [2, 3]] = along, -radius
    axis = np.zeros((3, 5))
    axis[0, 4], axis[2, 2] = -_sign(found), _sign(found)
    by_radius = np.array([[0.0, -(radius**2), 0.0, 0.0, 0.0]])
    return np.concatenate([found.frame @ point, found.frame @ axis, by_radius])


def _search(points: Array) -> list[Curved]:
    """Cylinders along the directions in which points ``(n, 3)`` look most like a circle."""
    middle = points.mean(axis=0)
    centred = points - middle
    _, principal = np.linalg.eigh(centred.T @ centred)
    axes = np.concatenate([np.eye(3), half_sphere(DIRECTIONS)]) @ principal.T
    basis = np.stack(tangents(axes), axis=1)
    flat = np.einsum("ni,aki->ank", centred, basis)
    curvature, foot, normal = fit_algebraic(flat)
    feet = middle + np.einsum("ak,aki->ai", foot, basis)
    normals = np.einsum("ak,aki->ai", normal, basis)
    frames = np.stack([normals, axes, np.cross(normals, axes)], axis=2)
    found = [
        Curved(feet[index], frames[index], float(curvature[index]), straight=True)
        for index in range(len(axes))
    ]
    misfit = [float(np.sum(surface.distances(points) ** 2)) for surface in found]
    return [found[index] for index in np.argsort(misfit)[:STARTS]]
