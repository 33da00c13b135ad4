"""OpenCV's five-term lens, one scalar function per formula.

With r2 = x^2 + y^2 and g = 1 + k1 r2 + k2 r2^2 + k3 r2^3 the distorted normalised point is
``x g + 2 p1 x y + p2 (r2 + 2 x^2), y g + p1 (r2 + 2 y^2) + 2 p2 x y``. A lens is the vector
(fx, fy, cx, cy, k1, k2, p1, p2, k3).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

UNDISTORT_STEPS = 30
UNDISTORT_TOLERANCE = 1e-12


@kernel
def distort(x: float, y: float, lens: NDArray[np.float64]) -> tuple[float, float]:
    """Distorted normalised coordinates of an ideal normalised point."""
    k1, k2, p1, p2, k3 = lens[4], lens[5], lens[6], lens[7], lens[8]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    xy = 2 * x * y
    return x * radial + p1 * xy + p2 * (r2 + 2 * x * x), y * radial + p1 * (
        r2 + 2 * y * y
    ) + p2 * xy


@kernel
def distort_jacobian(
    x: float, y: float, lens: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """d(distorted x, y) / d(x, y), row by row: xx, xy, yx, yy (xy equals yx)."""
    k1, k2, p1, p2, k3 = lens[4], lens[5], lens[6], lens[7], lens[8]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
    xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
    xy = x * y * slope + 2 * p1 * x + 2 * p2 * y
    yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
    return xx, xy, xy, yy


@kernel
def rises_to(r2: float, lens: NDArray[np.float64]) -> bool:
    """Whether the radial distortion rises all the way from the axis to the squared radius r2.

    Its slope is the cubic ``1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3`` in s = r^2, looked at where it is
    lowest: at r2 itself or at its minimum before that.
    """
    a, b, c = 3 * lens[4], 5 * lens[5], 7 * lens[8]
    lowest = 1 + r2 * (a + r2 * (b + r2 * c))
    square = b * b - 3 * a * c
    if square >= 0:
        root = math.sqrt(square)
        s = -a / (b + root) if b > 0 else (root - b) / (3 * c)
        if s > 0 and s < r2:
            lowest = min(lowest, 1 + s * (a + s * (b + s * c)))
    return bool(lowest > 0)


@kernel
def undistort(xd: float, yd: float, lens: NDArray[np.float64]) -> tuple[float, float]:
    """Ideal normalised point whose distortion is (xd, yd), by Newton; NaN if there is none.

    The point is sought where the distortion is one to one: between the axis and the radius at
    which it folds back. A step beyond that is halved.
    """
    x, y, last_x, last_y = xd, yd, 0.0, 0.0
    for _ in range(UNDISTORT_STEPS):
        xx, xy, yx, yy = distort_jacobian(x, y, lens)
        det = xx * yy - xy * yx
        if not (det > 0 and rises_to(x * x + y * y, lens)):
            x, y = (x + last_x) / 2, (y + last_y) / 2
            continue
        fx, fy = distort(x, y, lens)
        ex, ey = fx - xd, fy - yd
        dx, dy = (yy * ex - xy * ey) / det, (xx * ey - yx * ex) / det
        last_x, last_y = x, y
        x -= dx
        y -= dy
        if dx * dx + dy * dy < UNDISTORT_TOLERANCE**2:
            return x, y
    return math.nan, math.nan


@kernel
def distort_points(points: NDArray[np.float64], lens: NDArray[np.float64]) -> NDArray[np.float64]:
    """`distort` of ``(n, 2)`` points."""
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = distort(points[i, 0], points[i, 1], lens)
    return out


@kernel
def undistort_points(points: NDArray[np.float64], lens: NDArray[np.float64]) -> NDArray[np.float64]:
    """`undistort` of ``(n, 2)`` points; NaN where there is no inverse."""
    out = np.empty_like(points)
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = undistort(points[i, 0], points[i, 1], lens)
    return out
