"""Cones as surfaces, and the search for one that a fit can start from.

Along a given axis a cone reads ``k q^2 / 2 + b . q + A s^2 / 2 + B s + C = 0``, q the point across
the axis and s the way along it; Taubin's weighting (IEEE PAMI 13, 1991) makes that a small
eigenvalue problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.forms.curved import SMALLEST, Curved, tangents
from fringeworks.geometry.forms.cylinder import DIRECTIONS
from fringeworks.geometry.forms.search import half_sphere

Array = NDArray[np.float64]

STARTS = 12
"""Best directions of the search that are followed."""

_STEEP = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Conical:
    """A cone about one of its points: the cylinder through that point, and how it opens, rad.

    The cylinder's axis is the cone's; its radius grows along it where `opening` is positive.
    """

    base: Curved
    opening: float

    def distances(self, points: Array) -> Array:
        """Signed distances ``(n,)`` of points ``(n, 3)``, mm."""
        along = (points - self.base.foot) @ self.base.frame[:, 1]
        away = self.base.distances(points)
        return np.asarray(away * np.cos(self.opening) - along * np.sin(self.opening))


def search_cones(points: Array) -> list[Conical]:
    """Cones along the directions in which points ``(n, 3)`` look most like one."""
    middle = points.mean(axis=0)
    centred = points - middle
    _, principal = np.linalg.eigh(centred.T @ centred)
    axes = np.concatenate([np.eye(3), half_sphere(DIRECTIONS)]) @ principal.T
    basis = np.stack([*tangents(axes), axes], axis=1)
    curvature, rise, normal, opening = fit_along(np.einsum("ni,aki->ank", centred, basis))
    normals = np.einsum("ak,aki->ai", normal, basis[:, :2])
    feet = middle + rise[:, None] * normals
    frames = np.stack([normals, axes, np.cross(normals, axes)], axis=2)
    cones = [
        Conical(Curved(foot, frame, float(k), straight=True), float(t))
        for foot, frame, k, t in zip(feet, frames, curvature, opening, strict=True)
    ]
    misfit = [float(np.sum(cone.distances(points) ** 2)) for cone in cones]
    return [cones[index] for index in np.argsort(misfit)[:STARTS]]


def fit_along(centred: Array) -> tuple[Array, Array, Array, Array]:
    """Cones through batches of points ``(a, n, 3)`` about their centroids, axis along the third.

    Returns
    -------
    curvature, rise, normal, opening
        Across the axis at the centroid's height: ``(a,)`` 1 / mm, of either sign; ``(a,)`` way
        from the centroid to the surface, mm; ``(a, 2)`` unit, along that way; ``(a,)`` rad.
    """
    square = np.stack([np.sum(centred[..., :2] ** 2, axis=-1), centred[..., 2] ** 2], axis=-1)
    mean = np.maximum(np.mean(square, axis=1), SMALLEST)
    raised = (square - mean[:, None]) / (2 * np.sqrt(mean))[:, None]
    design = np.concatenate([raised, centred], axis=-1)
    _, vectors = np.linalg.eigh(np.einsum("ani,anj->aij", design, design))
    k, a = (vectors[:, :2, 0] / np.sqrt(mean)).T
    across, along = vectors[:, 2:4, 0], vectors[:, 4, 0]
    constant = -(k * mean[:, 0] + a * mean[:, 1]) / 2
    slope = np.linalg.norm(across, axis=1)
    lift = 2 * k * constant
    # Where f has no zero at that height the axis is a wrong one: any finite radius will do.
    steep = np.sqrt(np.maximum(slope**2 - lift, _STEEP * (slope**2 + np.abs(lift)) + SMALLEST))
    normal = -across / np.maximum(slope, SMALLEST)[:, None]
    normal[slope <= SMALLEST] = [1.0, 0.0]
    return k / steep, 2 * constant / (slope + steep), normal, np.arctan(-along / steep)
