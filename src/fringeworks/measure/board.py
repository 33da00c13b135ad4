"""A calibration board measured on a cloud of it: its squares, and how flat it comes out.

The corners' pixels come from the camera's image and their points from the cloud, so the board's
known pitch is a check of the whole line in mm, rig and decoding together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.geometry.forms import PlaneFit, fit_plane
from fringeworks.model import Cloud

Array = NDArray[np.float64]

WINDOW_SQUARES = 0.6
"""Half the window about a corner, in squares as they appear in the image."""

LEAST_PIXELS = 30
REJECT_SIGMAS = 3.0
REJECT_ROUNDS = 5
SMALLEST_STEP = 1e-6
"""Of a coordinate's size: float32 rounds at a tenth of this."""

MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True, slots=True)
class BoardSpacing:
    """Distances between neighbouring corners of a board, mm; NaN where one has no point.

    Attributes
    ----------
    corners_mm
        ``(rows, columns, 3)`` corners in the cloud's frame.
    """

    corners_mm: Array

    @property
    def along_x_mm(self) -> Array:
        """``(rows, columns - 1)`` distances along the board's rows."""
        return np.asarray(np.linalg.norm(np.diff(self.corners_mm, axis=1), axis=-1))

    @property
    def along_y_mm(self) -> Array:
        """``(rows - 1, columns)`` distances along the board's columns."""
        return np.asarray(np.linalg.norm(np.diff(self.corners_mm, axis=0), axis=-1))

    @property
    def all_mm(self) -> Array:
        """Every distance that could be measured."""
        every = np.concatenate([self.along_x_mm.ravel(), self.along_y_mm.ravel()])
        return np.asarray(every[np.isfinite(every)])

    @property
    def mean_mm(self) -> float:
        return float(np.mean(self.all_mm))

    @property
    def sd_mm(self) -> float:
        return float(np.std(self.all_mm, ddof=1))


def corner_spacing(
    cloud: Cloud, corners_px: NDArray[np.floating], *, columns: int, rows: int
) -> BoardSpacing:
    """Points of the cloud at a board's corners.

    About each corner 1/z is fitted as a plane over the pixels, with outliers rejected: that is
    exact for a flat board seen by a pinhole. The ray's direction x/z, y/z is fitted likewise.

    Parameters
    ----------
    cloud
        Organised, in the camera's frame.
    corners_px
        ``(rows * columns, 2)`` camera px, row by row.
    columns, rows
        Inner corners of the board.

    Raises
    ------
    ShapeError
        The number of corners is not rows x columns.
    MeasurementError
        Fewer than two neighbouring pairs of corners have points about them.
    """
    if np.shape(corners_px) != (rows * columns, 2):
        raise ShapeError(f"corners_px must be ({rows * columns}, 2), got {np.shape(corners_px)}")
    grid = np.asarray(corners_px, dtype=np.float64).reshape(rows, columns, 2)
    down, right = (np.diff(grid, axis=axis).reshape(-1, 2) for axis in (0, 1))
    square = float(np.median(np.linalg.norm(np.concatenate([down, right]), axis=1)))
    radius = WINDOW_SQUARES * square
    points = [point_at(cloud, corner, radius=radius) for corner in grid.reshape(-1, 2)]
    spacing = BoardSpacing(np.array(points).reshape(rows, columns, 3))
    if len(spacing.all_mm) < 2:
        raise MeasurementError(
            f"only {len(spacing.all_mm)} pairs of neighbouring corners have points of the cloud "
            "about them: does this cloud show the board that the corners were found on?"
        )
    return spacing


def point_at(cloud: Cloud, pixel: Array, *, radius: float) -> Array:
    """``(3,)`` point of a locally flat surface at a sub-pixel position, mm; NaN without support.

    `radius` is half the side of the square window, camera px.
    """
    height, width = cloud.xyz.shape[:2]
    x, y = float(pixel[0]), float(pixel[1])
    left, right = max(int(np.ceil(x - radius)), 0), min(int(x + radius) + 1, width)
    top, bottom = max(int(np.ceil(y - radius)), 0), min(int(y + radius) + 1, height)
    if left >= right or top >= bottom:
        return np.full(3, np.nan)
    window = cloud.xyz[top:bottom, left:right].astype(np.float64)
    v, u = np.mgrid[top:bottom, left:right]
    valid = np.isfinite(window[..., 2])
    design = np.column_stack([np.ones(valid.sum()), u[valid] - x, v[valid] - y])
    points = window[valid]
    keep = _inliers(design, 1 / points[:, 2])
    if keep.sum() < LEAST_PIXELS:
        return np.full(3, np.nan)
    rays = np.column_stack([points[:, :2], np.ones(len(points))]) / points[:, 2:]
    (ray_x, ray_y, inverse_depth), *_ = np.linalg.lstsq(design[keep], rays[keep], rcond=None)[0]
    return np.asarray(np.array([ray_x, ray_y, 1.0]) / inverse_depth)


def _inliers(design: Array, values: Array) -> NDArray[np.bool_]:
    """Samples within three robust standard deviations of their plane, found by repetition."""
    keep = np.ones(len(values), dtype=np.bool_)
    for _ in range(REJECT_ROUNDS):
        if keep.sum() < LEAST_PIXELS:
            break
        solution, *_ = np.linalg.lstsq(design[keep], values[keep], rcond=None)
        residual = np.abs(values - design @ solution)
        limit = REJECT_SIGMAS * MAD_TO_SIGMA * float(np.median(residual[keep]))
        keep = residual <= max(limit, SMALLEST_STEP * float(np.abs(values).max()))
    return keep


@dataclass(frozen=True, slots=True)
class BoardPlane:
    """Plane through a board's points, and the form rms that the cloud's own sigma predicts."""

    fit: PlaneFit
    predicted_rms_mm: float


def fit_board(
    cloud: Cloud, corners_px: NDArray[np.floating], *, columns: int, rows: int
) -> BoardPlane:
    """Plane through all of the cloud's points inside the board's outermost inner corners.

    An error of z moves a point along its ray (x / z, y / z, 1), so ``sigma_z |n . ray|`` is what
    the plane sees of it.

    Raises
    ------
    ShapeError
        The number of corners is not rows x columns.
    MeasurementError
        The cloud has fewer than three points there.
    """
    if np.shape(corners_px) != (rows * columns, 2):
        raise ShapeError(f"corners_px must be ({rows * columns}, 2), got {np.shape(corners_px)}")
    grid = np.asarray(corners_px, dtype=np.float64).reshape(rows, columns, 2)
    loop = np.array([grid[0, 0], grid[0, -1], grid[-1, -1], grid[-1, 0]])
    v, u = np.mgrid[: cloud.xyz.shape[0], : cloud.xyz.shape[1]]
    chosen = cloud.valid & _inside_convex(u, v, loop)
    points = cloud.xyz[chosen].astype(np.float64)
    fit = fit_plane(points)
    across = cloud.sigma_mm[chosen] * (points @ fit.normal) / points[:, 2]
    return BoardPlane(fit, float(np.sqrt(np.mean(across**2))))


def _inside_convex(
    u: NDArray[np.integer], v: NDArray[np.integer], loop: Array
) -> NDArray[np.bool_]:
    """Pixels on one side of every edge of a convex polygon."""
    sides = [
        (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])
        for a, b in zip(loop, np.roll(loop, -1, axis=0), strict=True)
    ]
    stacked = np.stack(sides)
    return np.asarray((stacked >= 0).all(axis=0) | (stacked <= 0).all(axis=0))
