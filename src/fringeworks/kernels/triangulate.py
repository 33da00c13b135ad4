"""The full model: depth along each camera ray from measured projector coordinates.

The camera pixel is undistorted to a ray (x, y, 1). A point z (x, y, 1) stands in the projector's
frame at ``a z + t`` with a = R (x, y, 1); the depth is the one at which its distorted projection
meets the measured column, or row, or both by weighted least squares (methods page, Phase to 3D).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.lens import distort, distort_jacobian, undistort

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

NEWTON_STEPS = 10
CONVERGED_MM = 1e-7


@kernel
def pinhole_depth(
    a: tuple[float, float, float],
    t: Array,
    target: tuple[float, float],
    weight: tuple[float, float],
) -> float:
    """Depth at which ``a z + t`` projects nearest to the ideal normalised `target`.

    Each axis asks ``(a_i - m a_2) z = m t_2 - t_i``, weighted; an axis of weight zero is unused.
    """
    up, down = 0.0, 0.0
    for i in range(2):
        slope = a[i] - target[i] * a[2]
        up += weight[i] * slope * (target[i] * t[2] - t[i])
        down += weight[i] * slope * slope
    return up / down


@kernel
def projected(
    a: tuple[float, float, float], t: Array, z: float, lens: Array
) -> tuple[float, float, float, float]:
    """Projector pixel of depth z and its derivative by z: column, row, column', row'."""
    px, py, pz = a[0] * z + t[0], a[1] * z + t[1], a[2] * z + t[2]
    x, y = px / pz, py / pz
    dx, dy = (a[0] - x * a[2]) / pz, (a[1] - y * a[2]) / pz
    xd, yd = distort(x, y, lens)
    xx, xy, yx, yy = distort_jacobian(x, y, lens)
    column, row = lens[0] * xd + lens[2], lens[1] * yd + lens[3]
    return column, row, lens[0] * (xx * dx + xy * dy), lens[1] * (yx * dx + yy * dy)


@kernel
def turned_ray(rotation: Array, x: float, y: float) -> tuple[float, float, float]:
    """``rotation @ (x, y, 1)``."""
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2],
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2],
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2],
    )


@kernel
def correct_depth(
    miss: tuple[float, float], slope: tuple[float, float], weight: tuple[float, float]
) -> tuple[float, float]:
    """Gauss-Newton step of the depth, mm, and its information, 1 / mm^2.

    `miss` is measured less projected column and row, px; `slope` how these change with depth.
    """
    information = weight[0] * slope[0] ** 2 + weight[1] * slope[1] ** 2
    towards = weight[0] * slope[0] * miss[0] + weight[1] * slope[1] * miss[1]
    return towards / information, information


@kernel
def across_line(miss: tuple[float, float], slope: tuple[float, float]) -> float:
    """The part of a miss, px, that is perpendicular to the epipolar line."""
    return (miss[0] * slope[1] - miss[1] * slope[0]) / math.hypot(slope[0], slope[1])


@kernel
def solve_depth(
    a: tuple[float, float, float],
    t: Array,
    measured: tuple[float, float],
    weight: tuple[float, float],
    lens: Array,
) -> tuple[float, float, float]:
    """Depth, its sigma, and the residual across the epipolar line, projector px.

    `weight` is 1 / sigma^2 of column and row, zero for an axis that was not measured. NaN where
    the iteration leaves the space in front of the projector. The residual is NaN for one axis.
    """
    ideal_x, ideal_y = (measured[0] - lens[2]) / lens[0], (measured[1] - lens[3]) / lens[1]
    both = weight[0] > 0 and weight[1] > 0
    if both:
        ideal_x, ideal_y = undistort(ideal_x, ideal_y, lens)
    scaled = (weight[0] * lens[0] ** 2, weight[1] * lens[1] ** 2)
    z = pinhole_depth(a, t, (ideal_x, ideal_y), scaled)
    for _ in range(NEWTON_STEPS):
        if not a[2] * z + t[2] > 0:
            return math.nan, math.nan, math.nan
        column, row, by_column, by_row = projected(a, t, z, lens)
        miss, slope = (measured[0] - column, measured[1] - row), (by_column, by_row)
        step, information = correct_depth(miss, slope, weight)
        z += step
        if abs(step) < CONVERGED_MM:
            across = across_line(miss, slope) if both else math.nan
            return z, 1 / math.sqrt(information), across
    return math.nan, math.nan, math.nan


@kernel
def triangulate(
    coordinates: NDArray[np.float32],
    sigmas: NDArray[np.float32],
    camera: Array,
    projector: Array,
    rotation: Array,
    translation: Array,
    window: tuple[float, float],
    xyz: Floats,
    sigma_z: Floats,
    epipolar: Floats,
) -> None:
    """Points, mm, of every camera pixel.

    Parameters
    ----------
    coordinates, sigmas
        ``(2, H, W)``: column and row, projector px, and their standard deviations; an axis that
        was not coded has sigma infinite (its coordinate is not looked at), a void pixel NaN.
    camera, projector
        Lenses ``(9,)``.
    rotation, translation
        ``projector_from_camera``.
    window
        Depths, mm, outside of which a point is void.
    xyz, sigma_z, epipolar
        Outputs ``(H, W, 3)``, ``(H, W)``, ``(H, W)``; NaN where void.
    """
    _, height, width = coordinates.shape
    nan = np.float32(math.nan)
    for v in range(height):
        for u in range(width):
            xyz[v, u, 0], xyz[v, u, 1], xyz[v, u, 2] = nan, nan, nan
            sigma_z[v, u], epipolar[v, u] = nan, nan
            s, r = sigmas[0, v, u], sigmas[1, v, u]
            if math.isnan(s) or math.isnan(r) or (math.isinf(s) and math.isinf(r)):
                continue
            weight = (
                0.0 if math.isinf(s) else 1 / float(s) ** 2,
                0.0 if math.isinf(r) else 1 / float(r) ** 2,
            )
            measured = (
                0.0 if math.isinf(s) else float(coordinates[0, v, u]),
                0.0 if math.isinf(r) else float(coordinates[1, v, u]),
            )
            x, y = undistort((u - camera[2]) / camera[0], (v - camera[3]) / camera[1], camera)
            a = turned_ray(rotation, x, y)
            z, spread, across = solve_depth(a, translation, measured, weight, projector)
            if z > window[0] and z < window[1]:
                xyz[v, u, 0], xyz[v, u, 1], xyz[v, u, 2] = x * z, y * z, z
                sigma_z[v, u], epipolar[v, u] = spread, across
