"""Where along a projector axis a camera pixel's light can come from, before any code is read.

A depth window (phase at both depth limits: An, Hyun and Zhang 2016) and a template seen on a
board say the same thing in the same way: a lowest and a highest coordinate per pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import ShapeError, UsageError
from fringeworks.geometry.lens import project, unproject
from fringeworks.model import AXES, Axis, FloatMap, Rig

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

LATTICE_PX = 8
"""Between places so far apart lenses bend by thousandths of a px."""


@dataclass(frozen=True, slots=True)
class Volume:
    """Where objects can be: in front of a rig, between two depths, mm, camera frame."""

    rig: Rig
    z_range_mm: tuple[float, float]


def volume_of(rig: Rig, z_range_mm: tuple[float, float] | None = None) -> Volume | None:
    """The depths asked for in front of a rig, or else its own, a tenth wider; None without any.

    An open end of the former is the latter's.
    """
    own = rig.z_window()
    near, far = z_range_mm or (-math.inf, math.inf)
    if own is not None:
        near = own[0] if near == -math.inf else near
        far = own[1] if far == math.inf else far
    if math.isinf(near) and math.isinf(far):
        return None
    return Volume(rig, (max(near, 0.0), far))


@dataclass(frozen=True, slots=True)
class CoordinateWindow:
    """Lowest and highest coordinate, projector px, that a pixel's light can have; ``(H, W)``.

    Both are NaN where nothing is known of a pixel.
    """

    low_px: FloatMap
    high_px: FloatMap


def coordinate_window(volume: Volume, axis: Axis, shape: tuple[int, int]) -> CoordinateWindow:
    """The projector coordinates of both depth limits on each camera pixel's ray.

    Through both lenses, to a few thousandths of a px. Which limit is the lower coordinate depends
    on which side the projector stands, pixel by pixel. Infinity is the ray's vanishing point.

    Parameters
    ----------
    shape
        ``(H, W)`` of the camera's image.

    Returns
    -------
    CoordinateWindow
        NaN where a limit is not in front of the projector, or the camera's lens has no inverse.

    Raises
    ------
    ShapeError
        `shape` is not that of the rig's camera.
    UsageError
        The depth range does not rise.
    """
    camera, (near, far) = volume.rig.camera, volume.z_range_mm
    if shape != (camera.height, camera.width):
        raise ShapeError(
            f"the capture must be {camera.width}x{camera.height} like the rig's camera, "
            f"got {shape[1]}x{shape[0]}"
        )
    if not near < far or not far > 0:
        raise UsageError(f"z-range must rise above 0, MIN:MAX in mm, got {near:g}:{far:g}")
    rows, columns = _lattice(shape[0]), _lattice(shape[1])
    ends = _both_ends(rows, columns, volume, axis)
    if not np.isfinite(ends).all():  # a limit's edge lies within a cell
        first, second = _both_ends(np.arange(shape[0]), np.arange(shape[1]), volume, axis)
    else:
        down, across = _weights(rows), _weights(columns).T
        first, second = (down @ end @ across for end in ends)
    return CoordinateWindow(np.minimum(first, second), np.maximum(first, second))


def _lattice(length: int) -> Indices:
    """Every `LATTICE_PX`-th pixel, and the last."""
    return np.unique(np.append(np.arange(0, length, LATTICE_PX), length - 1))


def _weights(lattice: Indices) -> FloatMap:
    """``(pixels, lattice)``: linear interpolation between the lattice's places."""
    pixels = np.arange(lattice[-1] + 1)
    unit = np.eye(len(lattice))
    weights = [np.interp(pixels, lattice, row) for row in unit]
    return np.array(weights, dtype=np.float32).T.copy()


def _both_ends(rows: Indices, columns: Indices, volume: Volume, axis: Axis) -> FloatMap:
    """``(2, rows, columns)`` px: what both depths project to on the rays of these pixels."""
    rig = volume.rig
    v, u = np.meshgrid(rows.astype(np.float64), columns.astype(np.float64), indexing="ij")
    ideal = unproject(np.stack([u, v], axis=-1), rig.camera.lens.vector)
    rays = np.concatenate([ideal, np.ones_like(ideal[..., :1])], axis=-1)
    rays = rays @ rig.projector_from_camera.rotation.T
    ends = [_project_depth(rays, rig, depth) for depth in volume.z_range_mm]
    return np.stack([end[..., AXES.index(axis)] for end in ends]).astype(np.float32)


def _project_depth(rays: Array, rig: Rig, depth_mm: float) -> Array:
    """Projector pixels ``(H, W, 2)`` of the points at a depth on rays in the projector's frame.

    Points are divided by their depth, which changes no projection, so that infinity has its place.
    """
    centre = rig.projector_from_camera.translation_mm
    points = rays + centre / depth_mm if depth_mm > 0 else np.broadcast_to(centre, rays.shape)
    return project(points, rig.projector.lens.vector)
