"""Sections: where a plane cuts a cloud, and what the curve says about a radius.

The paper's radius (section 4.4) is half the distance of a section's end points A and B. Of a
cylinder that stands before a camera no more than nearly half can be seen, R = 52.5 mm at 700 mm up
to a half-chord of 52.35 mm, and less where grazing points are masked; and two points carry all of
their noise. The radius of the arc through all points of the section has neither fault.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.geometry.forms.circle import CircleFit, fit_circle
from fringeworks.geometry.surface import join_grid
from fringeworks.measure.region import Region, chosen_pixels, select_points
from fringeworks.model import Cloud

Array = NDArray[np.float64]
Edges = tuple[Array, Array]
"""Both ends ``(n, 3)`` of pieces between neighbouring points, mm."""

FEWEST = 2
_UPRIGHT = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class CutPlane:
    """The plane ``normal . X = at_mm``, `normal` ``(3,)`` of length one.

    Raises
    ------
    ShapeError, UsageError
        A normal that is not three finite numbers of length one; `at_mm` not finite.
    """

    normal: Array
    at_mm: float

    def __post_init__(self) -> None:
        if np.shape(self.normal) != (3,):
            raise ShapeError(f"normal must be (3,), got {np.shape(self.normal)}")
        length = float(np.linalg.norm(self.normal))
        if not abs(length - 1) <= 1e-6:
            raise UsageError(f"normal must be of length one, got {length:g}")
        if not np.isfinite(self.at_mm):
            raise UsageError(f"at_mm must be finite, got {self.at_mm}")

    @property
    def basis(self) -> Array:
        """``(2, 3)`` directions in the plane: along x as nearly as may be, else y; then away."""
        first = np.eye(3)[0 if abs(self.normal[0]) < np.sqrt(0.75) else 1]
        first = first - (first @ self.normal) * self.normal
        first = first / np.linalg.norm(first)
        second = np.cross(self.normal, first)
        away = second[2] if abs(second[2]) > _UPRIGHT else second[1]
        return np.stack([first, second if away > 0 else -second])


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """Where a plane cuts a cloud, from one end to the other.

    Attributes
    ----------
    points_mm
        ``(n, 3)`` in the cloud's frame, ordered along the section's longest direction.
    """

    plane: CutPlane
    points_mm: Array

    @property
    def curve_mm(self) -> Array:
        """``(n, 2)`` the points in the plane, by its `basis`."""
        return np.asarray(self.points_mm @ self.plane.basis.T)

    @property
    def ends_mm(self) -> Array:
        """``(2, 3)`` the paper's A and B: the first and the last point."""
        return np.asarray(self.points_mm[[0, -1]])

    @property
    def half_chord_mm(self) -> float:
        """Half the distance of A and B: the paper's radius."""
        a, b = self.ends_mm
        return float(np.linalg.norm(b - a) / 2)

    def fit_arc(self) -> CircleFit:
        """Orthogonal least-squares circle in the plane; no point is left out.

        Raises
        ------
        MeasurementError
            As `fit_circle`: too few points, or a curve that cannot be told from a line.
        """
        return fit_circle(self.curve_mm)


@dataclass(frozen=True, slots=True, eq=False)
class RadiusSeries:
    """Radii of sections along a direction, mm; NaN where a section has none.

    Attributes
    ----------
    at_mm
        ``(n,)`` places of the sections.
    half_chord_mm, radius_mm, radius_sigma_mm
        ``(n,)`` the paper's estimator, the fitted arc's radius, and its standard deviation.
    """

    at_mm: Array
    half_chord_mm: Array
    radius_mm: Array
    radius_sigma_mm: Array

    @property
    def measured(self) -> int:
        """Sections that have a radius."""
        return int(np.count_nonzero(np.isfinite(self.radius_mm)))

    def mean_mm(self, values: Array) -> float:
        """Mean of half-chords or radii ``(n,)`` over the sections."""
        return float(np.nanmean(values))

    def sd_mm(self, values: Array) -> float:
        """Their standard deviation about the mean: what the paper calls RMSE. NaN of one."""
        return float(np.nanstd(values, ddof=1)) if self.measured > 1 else float("nan")


@dataclass(frozen=True, slots=True, eq=False)
class Slicer:
    """A cloud made ready to be cut, once for many planes.

    Attributes
    ----------
    points
        ``(n, 3)`` mm.
    edges
        Pieces between neighbouring pixels along rows and down columns, which a plane meets in a
        point each; None cuts a slab.
    thickness_mm
        Of the slab, where there are no edges.
    """

    points: Array
    edges: tuple[Edges, Edges] | None
    thickness_mm: float

    def cut(self, plane: CutPlane) -> Section:
        """The section.

        Raises
        ------
        MeasurementError
            The plane meets fewer than two points.
        """
        found = self._crossings(plane)
        if len(found) < FEWEST:
            span = self.points @ plane.normal
            raise MeasurementError(
                f"the plane at {plane.at_mm:g} mm meets {len(found)} points; the cloud lies "
                f"between {span.min():.1f} and {span.max():.1f} mm along that direction"
            )
        centred = found - found.mean(axis=0)
        along = np.linalg.svd(centred, full_matrices=False)[2][0]
        along = along * np.sign(along[np.argmax(np.abs(along))])
        return Section(plane, found[np.argsort(centred @ along, kind="stable")])

    def _crossings(self, plane: CutPlane) -> Array:
        """``(n, 3)`` points on the plane, not in order."""
        if self.edges is None:
            height = self.points @ plane.normal - plane.at_mm
            near = np.abs(height) <= self.thickness_mm / 2
            return np.asarray(self.points[near] - height[near, None] * plane.normal)
        # One point per row or per column: those of both directions share their noise.
        return max((_cross(edges, plane) for edges in self.edges), key=len)


def _cross(edges: Edges, plane: CutPlane) -> Array:
    """Where pieces meet the plane, by their ends' distances from it."""
    start, end = edges
    before, after = (ends @ plane.normal - plane.at_mm for ends in (start, end))
    meets = (before < 0) != (after < 0)
    share = before[meets] / (before[meets] - after[meets])
    return np.asarray(start[meets] + share[:, None] * (end[meets] - start[meets]))


def make_slicer(
    cloud: Cloud, region: Region | None = None, *, thickness_mm: float | None = None
) -> Slicer:
    """Make the region of a cloud ready to be cut.

    A cloud on the camera's grid is cut between neighbouring pixels, unless the depth jumps there.
    With `thickness_mm` its points within half of that are taken, projected onto the plane: the way
    for clouds without a grid.

    Raises
    ------
    UsageError
        No thickness for a cloud without a grid, or one that is not positive.
    MeasurementError
        The region holds no point.
    """
    region = region or Region()
    points = select_points(cloud, region)
    if thickness_mm is not None:
        if not 0 < thickness_mm < np.inf:
            raise UsageError(f"thickness_mm must be positive, got {thickness_mm:g}")
        return Slicer(points, None, thickness_mm)
    if min(cloud.xyz.shape[:2]) < 2:
        raise UsageError(
            "a cloud without the camera's grid is cut by a slab: give its thickness, about the "
            "distance of neighbouring points, or read the cloud's .npz"
        )
    return Slicer(points, _edges_of(cloud, chosen_pixels(cloud, region)), 0.0)


def _edges_of(cloud: Cloud, chosen: NDArray[np.bool_]) -> tuple[Edges, Edges]:
    joined = join_grid(cloud.seen_from_camera(), cloud.sigma_mm.astype(np.float64))
    xyz = cloud.xyz.astype(np.float64)
    right = joined.right & chosen[:, :-1] & chosen[:, 1:]
    down = joined.down & chosen[:-1] & chosen[1:]
    return (xyz[:, :-1][right], xyz[:, 1:][right]), (xyz[:-1][down], xyz[1:][down])


def cut(
    cloud: Cloud,
    plane: CutPlane,
    region: Region | None = None,
    *,
    thickness_mm: float | None = None,
) -> Section:
    """Cut the region of a cloud by a plane; see `make_slicer` and `Slicer.cut`."""
    return make_slicer(cloud, region, thickness_mm=thickness_mm).cut(plane)


def radius_series(slicer: Slicer, normal: Array, at_mm: Iterable[float]) -> RadiusSeries:
    """Radii of sections across `normal` ``(3,)``, at places ``normal . X = at_mm``.

    Raises
    ------
    MeasurementError
        No section has an arc.
    """
    places = [float(place) for place in at_mm]
    rows = [_radii_at(slicer, CutPlane(normal, place)) for place in places]
    half_chords, radii, sigmas = np.array(rows).reshape(-1, 3).T
    if not np.isfinite(radii).any():
        raise MeasurementError(
            f"none of the {len(places)} sections shows an arc: does the plane cut across the axis?"
        )
    return RadiusSeries(np.array(places), half_chords, radii, sigmas)


def _radii_at(slicer: Slicer, plane: CutPlane) -> tuple[float, float, float]:
    """Half-chord, radius and its sigma; NaN where there is no arc."""
    try:
        section = slicer.cut(plane)
        arc = section.fit_arc()
    except MeasurementError:
        return float("nan"), float("nan"), float("nan")
    return section.half_chord_mm, arc.radius_mm, arc.radius_sigma_mm
