"""A surface to measure against: triangles with their normals, ready to be searched.

The side that a point lies on is told by the normal of the face, edge or corner nearest to it, where
an edge has the sum of its faces' and a corner that by their angles (Baerentzen and Aanaes, IEEE
TVCG 11, 2005): right for every closed mesh, and open ones inside their border.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.kernels.closest import FACE, LEAF, build_tree, find_nearest
from fringeworks.measure.grid_mesh import mesh_cloud
from fringeworks.model import Cloud

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.int64]

FURTHEST_MM = 1e9
"""Of a mesh: its numbers are wrong, or their scale."""

FEATURES = 7
"""Of a triangle: its face, three edges, three corners."""


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Triangles of a mesh or a cloud, mm in its frame.

    Attributes
    ----------
    corners
        ``(m, 3, 3)``.
    normals
        ``(m, 7, 3)`` of each feature, not of length one: the sides that count as outside.
    border
        ``(m, 7)`` whether the surface ends there.
    smooth
        ``(m, 3)`` unit normals: of a cloud evened out as its noise demands.
    sigma_mm
        ``(m,)`` noise across the surface, one standard deviation; 0 of a mesh.
    tree
        Of `kernels.closest`.
    frame
        Of a cloud what its coordinates are about; None of a mesh, which tells nothing.
    """

    corners: Array
    normals: Array
    border: Mask
    smooth: Array
    sigma_mm: Array
    tree: tuple[Indices, Array]
    frame: str | None = None

    def area_mm2(self) -> float:
        """Of all triangles."""
        return float(np.linalg.norm(_areas(self.corners), axis=1).sum() / 2)


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """What of a surface is nearest to n points; NaN, -1 and False where nothing is near.

    Attributes
    ----------
    places
        ``(n, 3)`` mm.
    distance_mm
        ``(n,)`` signed: positive outside.
    triangles
        ``(n,)`` -1 where no triangle is within reach.
    border
        ``(n,)`` the surface ends there: the point has no counterpart.
    """

    places: Array
    distance_mm: Array
    triangles: Indices
    border: Mask


def mesh_reference(vertices: Array, faces: Indices) -> Reference:
    """A reference of a mesh: vertices ``(n, 3)``, mm, and faces ``(m, 3)``.

    Vertices at the same place are one (an STL repeats them); faces without area are left out.

    Raises
    ------
    ShapeError
        Other shapes, or faces of vertices that are not there.
    MeasurementError
        Vertices that are not finite or beyond `FURTHEST_MM`, or no face with an area.
    """
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ShapeError(
            f"vertices must be (n, 3) and faces (m, 3), got {vertices.shape} and {faces.shape}"
        )
    if faces.size and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ShapeError(f"faces must name vertices below {len(vertices)}, got {faces.max()}")
    if not (np.abs(vertices[faces]) <= FURTHEST_MM).all():  # nor NaN
        raise MeasurementError(
            f"the mesh has vertices that are not finite or beyond {FURTHEST_MM:g} mm: export it "
            "again, or see to its scale"
        )
    welded, places = np.unique(vertices, axis=0, return_inverse=True)
    faces = places.ravel()[faces]
    faces = faces[np.linalg.norm(_areas(welded[faces]), axis=1) > 0]
    if not len(faces):
        raise MeasurementError("the mesh has no face with an area: export it again")
    smooth = _unit(_areas(welded[faces]))
    return _build(welded, faces, (smooth, np.zeros(len(faces))))


def cloud_reference(cloud: Cloud) -> Reference:
    """A reference of a cloud on its camera's grid, in the cloud's frame; outside is the camera.

    Raises
    ------
    MeasurementError
        The cloud has no grid.
    """
    mesh = mesh_cloud(cloud)
    smooth = _unit(mesh.normals[mesh.faces].sum(axis=1))
    noise = noise_across(cloud, mesh.pixels, mesh.normals)
    built = _build(mesh.vertices, mesh.faces, (smooth, noise[mesh.faces].mean(axis=1)))
    return replace(built, frame=cloud.frame)


def noise_across(cloud: Cloud, pixels: Indices, normals: Array) -> Array:
    """``(n,)`` sigma of points across a surface, mm: an error of z moves a point along its ray.

    `normals` ``(n, 3)`` are of length one, in the cloud's frame; sigma that is not known is 0.
    """
    rays = cloud.seen_from_camera().reshape(-1, 3)[pixels]
    pose = cloud.frame_from_camera
    turned = normals if pose is None else normals @ pose.rotation
    lean = np.abs(np.einsum("ni,ni->n", rays, turned)) / np.abs(rays[:, 2])
    return np.asarray(np.nan_to_num(cloud.sigma_mm.ravel()[pixels]) * lean)


def find_counterparts(reference: Reference, points: Array, *, within_mm: float) -> Nearest:
    """The nearest point of a surface to each of ``(n, 3)``, all finite, none beyond `within_mm`."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    places, triangles, features = find_nearest(points, reference.corners, reference.tree, within_mm)
    off = points - places
    side = np.einsum("ni,ni->n", off, reference.normals[triangles, features])
    distance = np.copysign(np.linalg.norm(off, axis=1), side)
    border = (triangles >= 0) & reference.border[triangles, features]
    return Nearest(places, distance, triangles, border)


def _build(vertices: Array, faces: Indices, known: tuple[Array, Array]) -> Reference:
    corners = np.ascontiguousarray(vertices[faces], dtype=np.float64)
    normals, border = _features(vertices, faces)
    levels = max(0, int(np.ceil(np.log2(len(faces) / LEAF))))
    return Reference(corners, normals, border, *known, build_tree(corners, levels))


def _features(vertices: Array, faces: Indices) -> tuple[Array, Mask]:
    """Normals ``(m, 7, 3)`` and border ``(m, 7)`` of face, edges AB, BC, CA, corners A, B, C."""
    flat = _unit(_areas(vertices[faces]))
    normals = np.empty((len(faces), FEATURES, 3))
    border = np.zeros((len(faces), FEATURES), np.bool_)
    normals[:, FACE] = flat
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    codes = ends[:, 0] * len(vertices) + ends[:, 1]
    _, edge, times = np.unique(codes, return_inverse=True, return_counts=True)
    normals[:, 1:4] = _gather(edge, np.repeat(flat, 3, axis=0), len(times)).reshape(-1, 3, 3)
    border[:, 1:4] = (times[edge] == 1).reshape(-1, 3)
    weighted = flat[:, None] * _angles(vertices[faces])[..., None]
    normals[:, 4:] = _gather(faces.ravel(), weighted.reshape(-1, 3), len(vertices)).reshape(
        -1, 3, 3
    )
    ending = np.zeros(len(vertices), np.bool_)
    ending[ends[times[edge] == 1].ravel()] = True
    border[:, 4:] = ending[faces]
    return normals, border


def _gather(index: Indices, vectors: Array, count: int) -> Array:
    """For each row the sum of all vectors with the same index."""
    sums = np.stack([np.bincount(index, vectors[:, axis], count) for axis in range(3)], axis=-1)
    return np.asarray(sums[index])


def _angles(corners: Array) -> Array:
    """``(m, 3)`` angle at each corner, rad."""
    ahead = _unit(np.roll(corners, -1, axis=1) - corners)
    back = _unit(np.roll(corners, 1, axis=1) - corners)
    return np.asarray(np.arccos(np.clip(np.einsum("mci,mci->mc", ahead, back), -1, 1)))


def _areas(corners: Array) -> Array:
    """``(m, 3)`` normals, twice the area long."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, np.finfo(np.float64).tiny))
