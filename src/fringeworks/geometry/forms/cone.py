"""Cones by orthogonal least squares.

A cone is a cylinder whose radius grows along its axis, here about one of its points: with d_c the
distance from the cylinder through that point (`geometry.forms.curved`), s the way along the axis
and t half the opening angle,

    d = d_c cos t - s sin t

which passes smoothly through cylinders, t = 0. Beyond its apex a cone goes on as its rulings do.

The start is found among many axes (`geometry.forms.conical`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.geometry.forms.checks import check_curved, check_points, weights_of
from fringeworks.geometry.forms.conical import Conical, search_cones
from fringeworks.geometry.forms.curved import (
    Curved,
    check_curvature,
    distance_jacobian,
    moved,
    scatter_covariance,
    settled,
    telling_sigmas,
)
from fringeworks.geometry.forms.deviations import band95_of, range_of, rms_per_freedom
from fringeworks.geometry.forms.search import fit_in_stages
from fringeworks.geometry.minimise import MOST_STEPS, Block, minimise
from fringeworks.geometry.pose import left_jacobian, rotation_matrix

Array = NDArray[np.float64]

PARAMETERS = 6
_WIDEST = 0.49 * np.pi
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class ConeFit:
    """A cone without end, with the signed distances of its points, positive outside.

    Attributes
    ----------
    apex_mm
        ``(3,)``, in the points' frame.
    axis_direction
        ``(3,)`` unit, from the apex into the cone.
    half_angle_deg
        Between axis and surface, 0 to 90.
    covariance
        ``(7, 7)`` of apex (mm), direction and half angle (rad), of rank six, from what is left of
        the points: it takes their errors as independent, and knows of no systematic ones.
    deviations_mm
        ``(n,)`` in the points' order.
    """

    apex_mm: Array
    axis_direction: Array
    half_angle_deg: float
    covariance: Array
    deviations_mm: Array

    @property
    def apex_sigma_mm(self) -> Array:
        """``(3,)`` standard deviations of the apex' coordinates: see `covariance`."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:3]))

    @property
    def half_angle_sigma_deg(self) -> float:
        """Standard deviation of the half angle: see `covariance`."""
        return float(np.rad2deg(np.sqrt(self.covariance[-1, -1])))

    @property
    def form_rms_mm(self) -> float:
        """Root mean square distance, per degree of freedom (six parameters are fitted)."""
        return rms_per_freedom(self.deviations_mm, parameters=PARAMETERS)

    @property
    def range_mm(self) -> float:
        """Range of the signed distances: grows with the number of points by noise alone."""
        return range_of(self.deviations_mm)

    @property
    def band95_mm(self) -> float:
        """Width between the 2.5 % and 97.5 % quantiles of the distances (ISO 10360-13's manner)."""
        return band95_of(self.deviations_mm)


def fit_cone(points: Array, *, sigma_mm: Array | None = None) -> ConeFit:
    """Orthogonal least-squares cone through points ``(n, 3)``, mm; no point is left out.

    Least sum of ``distance^2 / sigma^2`` by Levenberg-Marquardt. The start is the best of many
    axes, found on a sample of the points as for a cylinder. Outliers pull it: choose the points
    first.

    Parameters
    ----------
    sigma_mm
        ``(n,)`` standard deviations of the points; only their ratios matter.

    Raises
    ------
    MeasurementError
        Fewer than seven points, some of them not finite, all on one plane; their curvature cannot
        be told from a plane's or their opening from a cylinder's; or no cone settles.
    ShapeError, UsageError
        Shapes that do not fit; a `sigma_mm` that is not positive.
    """
    check_points(points, form="cone", least=PARAMETERS + 1)
    check_curved(points, form="cone")
    weights = weights_of(sigma_mm, len(points))
    found = opened(
        settled(
            fit_in_stages(points, weights, search=search_cones, refine=refine_cone),
            points,
            form="cone",
        )
    )
    covariance = _covariance(found, points, weights)
    change = change_of(found)
    return ConeFit(
        apex_mm=apex_of(found),
        axis_direction=found.base.frame[:, 1],
        half_angle_deg=float(np.rad2deg(found.opening)),
        covariance=change @ covariance @ change.T,
        deviations_mm=found.distances(points),
    )


def opened(found: Conical) -> Conical:
    """The same cone with its axis running into it."""
    if found.opening >= 0:
        return found
    base = found.base
    turned = Curved(base.foot, base.frame * [1.0, -1.0, -1.0], base.curvature, straight=True)
    return Conical(turned, -found.opening)


def apex_of(found: Conical) -> Array:
    """``(3,)`` mm."""
    reach = 1 / (found.base.curvature * np.tan(found.opening))
    return np.asarray(found.base.centre - reach * found.base.frame[:, 1])


def change_of(found: Conical) -> Array:
    """``(7, 6)`` derivative of apex, direction, half angle by rise, curvature, turns, opening."""
    radius, opening = 1 / found.base.curvature, found.opening
    reach = radius / np.tan(opening)
    apex = np.zeros((3, 6))  # in the frame at the foot: normal, axis, across
    apex[0, [0, 1, 4]] = 1, -(radius**2), reach
    apex[1, [1, 4, 5]] = radius**2 / np.tan(opening), radius, radius / np.sin(opening) ** 2
    apex[2, [2, 3]] = -reach, -radius
    axis = np.zeros((3, 6))
    axis[0, 4], axis[2, 2] = -1, 1
    by_opening = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    return np.concatenate([found.base.frame @ apex, found.base.frame @ axis, by_opening])


def _covariance(found: Conical, points: Array, weights: Array) -> Array:
    """``(6, 6)`` of rise, curvature, turns and opening; refuses planes and cylinders."""
    parameters = np.array([0.0, found.base.curvature, 0.0, 0.0, 0.0, found.opening])
    distances, jacobian = cone_jacobian(found.base, points - found.base.foot, parameters)
    weighted = jacobian * weights[:, None]
    covariance = scatter_covariance(distances * weights, weighted, form="cone")
    sigmas = np.sqrt(np.diag(covariance))
    count = len(points)
    check_curvature(found.base.curvature, float(sigmas[1]), (count, PARAMETERS), form="cone")
    told = telling_sigmas(count - PARAMETERS) * float(sigmas[5])
    if found.opening <= max(told, _ROUNDING):
        half, sigma = np.rad2deg([found.opening, sigmas[5]])
        raise MeasurementError(
            f"the {count} points do not tell a cone from a cylinder: the half angle is "
            f"{half:.2g} +- {sigma:.2g} degrees; measure a larger part of it, or a cylinder"
        )
    return covariance


def cone_jacobian(start: Curved, relative: Array, parameters: Array) -> tuple[Array, Array]:
    """Distances ``(n,)`` and derivatives ``(n, 6)`` of points seen from the start's foot.

    Parameters: those of `distance_jacobian`, and the opening, rad.
    """
    turn, opening = parameters[2:5], float(parameters[5])
    away, by_cylinder = distance_jacobian(start, relative, parameters[:5])
    toward, along, across = np.einsum("ni,ij->jn", relative, start.frame @ rotation_matrix(turn))
    by_turn = np.stack([across, np.zeros_like(along), -toward])
    jacobian = np.empty((len(relative), 6))
    jacobian[:, :5] = by_cylinder * np.cos(opening)
    jacobian[:, 2:5] -= np.sin(opening) * np.einsum("tn,tk->nk", by_turn, left_jacobian(-turn))
    jacobian[:, 5] = -away * np.sin(opening) - along * np.cos(opening)
    return away * np.cos(opening) - along * np.sin(opening), jacobian


def refine_cone(
    start: Conical, points: Array, weights: Array, *, steps: int = MOST_STEPS
) -> Conical | None:
    """The cone of least squared weighted distances next to a start; None if none is reached."""
    relative = points - start.base.foot

    def model(values: Array) -> Iterator[Block]:
        with np.errstate(over="ignore", invalid="ignore"):  # a step too far counts as worse
            distances, jacobian = cone_jacobian(start.base, relative, values)
        yield distances * weights, jacobian * weights[:, None], np.arange(6, dtype=np.intp)

    origin = np.array([0.0, start.base.curvature, 0.0, 0.0, 0.0, start.opening])
    minimum = minimise(model, origin, steps=steps)
    opening = float(minimum.parameters[5])
    if not minimum.converged or abs(opening) > _WIDEST:
        return None
    turned_over = minimum.parameters[1] < 0  # `moved` puts the centre on the other side
    return Conical(moved(start.base, minimum.parameters[:5]), -opening if turned_over else opening)
