"""An organised cloud as triangles between neighbouring pixels, open where the depth jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.geometry.grid import smoothing_window
from fringeworks.geometry.surface import even_out, join_grid, node_normals, surface_normals
from fringeworks.model import Cloud

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class GridMesh:
    """Triangles of a cloud, in its frame.

    Attributes
    ----------
    vertices
        ``(n, 3)`` mm: points that belong to a triangle, row by row of the grid.
    normals
        ``(n, 3)`` of length one, towards the camera, evened out as the noise demands.
    faces
        ``(m, 3)`` indices of vertices, right-handed about the side that the camera saw.
    pixels
        ``(n,)`` place of each vertex in the flattened grid.
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.int64]
    pixels: NDArray[np.int64]


def mesh_cloud(cloud: Cloud) -> GridMesh:
    """Join a cloud's neighbouring pixels to triangles.

    Raises
    ------
    MeasurementError
        No three neighbouring pixels hang together: the cloud has no grid, or hardly a point.
    """
    seen, sigma = cloud.seen_from_camera(), cloud.sigma_mm.astype(np.float64)
    surface = join_grid(seen, sigma)
    corners = surface.triangles()
    if not len(corners):
        raise MeasurementError(
            "the cloud has no neighbouring pixels with points, and so no surface: a mesh needs a "
            "cloud on the camera's grid (.npz)"
        )
    even = even_out(seen, surface, smoothing_window(seen, sigma))
    normals = _turned(cloud, node_normals(even, surface.cells)).reshape(-1, 3)
    pixels, places = np.unique(corners, return_inverse=True)
    points = cloud.xyz.reshape(-1, 3)[pixels].astype(np.float64)
    return GridMesh(points, normals[pixels], places.reshape(-1, 3), pixels)


def cloud_normals(cloud: Cloud) -> Array:
    """Unit normals ``(H, W, 3)`` in the cloud's frame, towards the camera; 0 where unknown."""
    sigma = cloud.sigma_mm.astype(np.float64)
    return _turned(cloud, surface_normals(cloud.seen_from_camera(), sigma))


def _turned(cloud: Cloud, normals: Array) -> Array:
    pose = cloud.frame_from_camera
    return normals if pose is None else np.asarray(normals @ pose.rotation.T)
