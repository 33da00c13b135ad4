"""What spheres, cylinders and cones share: a curved surface about one of its points.

The radius enters as curvature k = 1 / r, after Lukács, Martin and Marshall ("Faithful
least-squares fitting of spheres, cylinders, cones and tori for reliable segmentation", ECCV 1998):
the distance is smooth through k = 0, so that shallow caps settle as well as whole spheres, and a
noisy plane settles where its curvature cannot be told from none. With e a point seen from the
foot, n the unit vector from the foot to the centre,

    h = k |e|^2 / 2 - e . n,    d = 2 h / (1 + w),    w = sqrt(1 + 2 k h)

d being the signed distance, positive outside. For a cylinder e has no part along the axis.

The start is Taubin's algebraic fit (IEEE PAMI 13, 1991): least ``f^2 / |grad f|^2`` of
``f = k |p|^2 / 2 + b . p + c`` about the centroid, which is far less drawn to small radii than
plain least squares of f, and knows planes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.geometry.minimise import MOST_STEPS, Block, minimise
from fringeworks.geometry.pose import left_jacobian, rotation_matrix

Array = NDArray[np.float64]
Surface = TypeVar("Surface")

TELLING_SIGMAS = 5.0
"""A curvature nearer to zero than that is no radius."""

FALSE_ALARM = 1e-3
"""With few points sigma itself is a guess: Student's distribution then asks for more sigmas, so
that scatter alone passes for a curvature no oftener than this."""

SMALLEST = 1e-300
"""Keeps a division by a length from failing at zero."""

_SMALLEST_ROOT = 1e-12
"""Under w's root; at the centre itself it is 0 and the distance has no derivative."""

_DEPENDENT = 1e-13
_SPHERE = [0, 1, 3, 4]
_CYLINDER = [0, 1, 2, 3, 4]
CIRCLE = [0, 1, 3]
"""Which parameters move: a sphere does not change as it turns about its normal, and a circle is a
cylinder that keeps its axis."""


@dataclass(frozen=True, slots=True, eq=False)
class Curved:
    """A sphere, or if `straight` a cylinder, about one of its points.

    Attributes
    ----------
    foot
        ``(3,)`` point on the surface, mm.
    frame
        ``(3, 3)`` right-handed; columns: the normal from the foot to the centre, the axis of a
        cylinder, and across both.
    curvature
        1 / mm; not negative after `refine`.
    """

    foot: Array
    frame: Array
    curvature: float
    straight: bool

    @property
    def centre(self) -> Array:
        """``(3,)`` centre, or the axis' point next to the foot, mm."""
        return np.asarray(self.foot + self.frame[:, 0] / self.curvature)

    def distances(self, points: Array) -> Array:
        """Signed distances ``(n,)`` of points ``(n, 3)``, mm."""
        local = np.einsum("ni,ij->jn", points - self.foot, self.frame)
        square = _square(local, straight=self.straight)
        return _distance(self.curvature * square / 2 - local[0], self.curvature)[0]


def tangents(normals: Array) -> tuple[Array, Array]:
    """``(..., 3)`` twice: unit vectors a, b that make ``n, a, b`` right-handed frames."""
    least = np.eye(3)[np.argmin(np.abs(normals), axis=-1)]
    first = np.cross(normals, least)
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    return first, np.cross(normals, first)


def fit_algebraic(centred: Array) -> tuple[Array, Array, Array]:
    """Taubin's circles or spheres through batches of points ``(..., n, d)`` about their centroids.

    Returns
    -------
    curvature, foot, normal
        ``(...,)`` 1 / mm, of either sign; ``(..., d)`` the surface's point next to the centroid,
        mm; ``(..., d)`` unit, from there to the centre, or away from it at negative curvature.
    """
    square = np.sum(centred**2, axis=-1)
    mean = np.mean(square, axis=-1)
    raised = (square - mean[..., None]) / (2 * np.sqrt(mean))[..., None]
    design = np.concatenate([raised[..., None], centred], axis=-1)
    _, vectors = np.linalg.eigh(np.einsum("...ni,...nj->...ij", design, design))
    least = vectors[..., 0]  # of length one, so that |grad f| is one on the surface
    curvature = least[..., 0] / np.sqrt(mean)
    constant = -curvature * mean / 2
    slope = np.linalg.norm(least[..., 1:], axis=-1)
    anywhere = np.eye(centred.shape[-1])[0]  # about its very centre a sphere has no next point
    normal = np.where(
        slope[..., None] > 0, -least[..., 1:] / np.maximum(slope, SMALLEST)[..., None], anywhere
    )
    return curvature, (2 * constant / (1 + slope))[..., None] * normal, normal


def refine(
    start: Curved,
    points: Array,
    weights: Array,
    *,
    steps: int = MOST_STEPS,
    free: Sequence[int] | None = None,
) -> Curved | None:
    """The surface of least squared weighted distances next to a start; None if none is reached.

    Parameters
    ----------
    points, weights
        ``(n, 3)`` mm and ``(n,)`` 1 / mm.
    steps
        After so many it has not reached any.
    free
        Which parameters move, if not all that change the surface.
    """
    free = list(free or _free_of(start))
    relative = points - start.foot

    def model(values: Array) -> Iterator[Block]:
        parameters = np.zeros(5)
        parameters[free] = values
        distances, jacobian = distance_jacobian(start, relative, parameters)
        weighted = jacobian[:, free] * weights[:, None]
        yield distances * weights, weighted, np.arange(len(free), dtype=np.intp)

    origin = np.array([0.0, start.curvature, 0.0, 0.0, 0.0])
    minimum = minimise(model, origin[free], steps=steps)
    if not minimum.converged:
        return None
    origin[free] = minimum.parameters
    return moved(start, origin)


def _free_of(surface: Curved) -> list[int]:
    return _CYLINDER if surface.straight else _SPHERE


def moved(start: Curved, parameters: Array) -> Curved:
    """The surface at parameters ``(5,)`` as `distance_jacobian` has them."""
    rise, curvature = float(parameters[0]), float(parameters[1])
    frame = start.frame @ rotation_matrix(parameters[2:])
    foot = start.foot + rise * frame[:, 0]
    if curvature < 0:  # the centre lies on the other side: half a turn about the axis
        frame = frame * [-1.0, 1.0, -1.0]
    return Curved(foot, frame, abs(curvature), start.straight)


def distance_jacobian(start: Curved, relative: Array, parameters: Array) -> tuple[Array, Array]:
    """Distances ``(n,)`` and derivatives ``(n, 5)`` of points seen from the start's foot.

    Parameters: how far the foot rises along the normal, mm, the curvature, and a rotation vector
    in the start's own frame: about the normal, the axis, and across.
    """
    rise, curvature, turn = float(parameters[0]), float(parameters[1]), parameters[2:]
    # einsum, since BLAS would wake all its threads for matrices of three columns
    local = np.einsum("ni,ij->jn", relative, start.frame @ rotation_matrix(turn))
    toward, along, across = local
    beyond = toward - rise
    square = _square((beyond, along, across), straight=start.straight)
    distance, root = _distance(curvature * square / 2 - beyond, curvature)
    lever = curvature * rise + 1
    by_turn = np.stack([np.zeros_like(along), lever * across, -lever * along])
    if start.straight:
        by_turn[0] = -curvature * along * across
        by_turn[2] += curvature * along * toward
    jacobian = np.empty((5, len(relative)))
    jacobian[0] = 1 - curvature * beyond
    jacobian[1] = (square - distance**2) / 2
    jacobian[2:] = np.einsum("tn,tk->kn", by_turn, left_jacobian(-turn))
    return distance, (jacobian / root).T


def _square(local: Iterable[Array], *, straight: bool) -> Array:
    """Squared length of three local coordinates ``(n,)``, of a cylinder without that along it."""
    toward, along, across = local
    square = toward**2 + across**2
    return np.asarray(square if straight else square + along**2)


def _distance(height: Array, curvature: float) -> tuple[Array, Array]:
    """The distance d and its root w, ``(n,)``, of h."""
    root = np.sqrt(np.maximum(1 + 2 * curvature * height, _SMALLEST_ROOT))
    return 2 * height / (1 + root), root


def settled(surface: Surface | None, points: Array, *, form: str) -> Surface:
    """What `refine` found.

    Raises
    ------
    MeasurementError
        It found nothing.
    """
    if surface is None:
        raise MeasurementError(
            f"no {form} settles on the {len(points)} points: do they show one form alone?"
        )
    return surface


def covariance_of(
    surface: Curved,
    points: Array,
    weights: Array,
    *,
    form: str,
    free: Sequence[int] | None = None,
) -> Array:
    """Covariance of a refined surface's parameters: rise, curvature, turns, as `refine` moves them.

    ``(4, 4)`` of a sphere, without a turn about its normal, else ``(5, 5)``, or as many as `free`.

    Raises
    ------
    MeasurementError
        Some change of the parameters moves no point, or the curvature cannot be told from none.
    """
    free = list(free or _free_of(surface))
    parameters = np.array([0.0, surface.curvature, 0.0, 0.0, 0.0])
    distances, jacobian = distance_jacobian(surface, points - surface.foot, parameters)
    weighted = jacobian[:, free] * weights[:, None]
    covariance = scatter_covariance(distances * weights, weighted, form=form)
    sigma = float(np.sqrt(covariance[1, 1]))
    check_curvature(surface.curvature, sigma, (len(points), len(free)), form=form)
    return covariance


def scatter_covariance(residuals: Array, jacobian: Array, *, form: str) -> Array:
    """``(k, k)`` covariance of the parameters of residuals ``(n,)`` with Jacobian ``(n, k)``.

    The inverse normal matrix times the residuals' variance per degree of freedom: the points'
    errors are taken as independent.

    Raises
    ------
    MeasurementError
        Some change of the parameters moves no point.
    """
    count, parameters = jacobian.shape
    normal = np.einsum("ij,ik->jk", jacobian, jacobian)
    scale = np.sqrt(np.maximum(np.diag(normal), SMALLEST))
    scaled = normal / np.outer(scale, scale)
    if np.linalg.eigvalsh(scaled)[0] < _DEPENDENT:
        raise MeasurementError(f"the {count} points fit more than one {form}")
    variance = float(np.sum(residuals**2)) / (count - parameters)
    return np.asarray(np.linalg.inv(scaled) / np.outer(scale, scale) * variance)


def check_curvature(
    curvature: float, sigma: float, count_and_parameters: tuple[int, int], *, form: str
) -> None:
    """Refuse a curvature, 1 / mm, that its sigma does not tell from none.

    Raises
    ------
    MeasurementError
        It is within `telling_sigmas` of zero.
    """
    count, parameters = count_and_parameters
    flat = "line" if form == "circle" else "plane"
    if curvature <= telling_sigmas(count - parameters) * sigma:
        raise MeasurementError(
            f"the {count} points do not tell a {form} from a {flat}: the curvature is "
            f"{curvature:.2g} +- {sigma:.2g} / mm; measure a larger part of it"
        )


def telling_sigmas(freedom: int) -> float:
    """How many standard deviations, known from `freedom` residuals too many, tell from zero."""
    from scipy.special import stdtrit

    return max(TELLING_SIGMAS, float(stdtrit(freedom, 1 - FALSE_ALARM)))
