"""A lens beyond the five terms, and a pupil that wanders: what the twin's devices do to rays.

With r2 = x^2 + y^2 the radial factor is OpenCV's rational one,
``(1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)``; decentring as in
`kernels.lens`. The ray of the ideal normalised point (x, y) starts at (0, 0, s r2) in the
device's frame and runs along (x, y, 1). An optics is the vector (fx, fy, cx, cy, k1, k2, p1, p2,
k3, k4, k5, k6, s, fold), fold being the r2 up to which the radial distortion rises.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Array = NDArray[np.float64]

STEPS = 40
NEARLY = 1e-9
"""A Newton step below this leaves an error of its square, below rounding."""


@kernel
def radial_factor(r2: float, optics: Array) -> tuple[float, float]:
    """The radial factor and its derivative by r2."""
    k1, k2, k3 = optics[4], optics[5], optics[8]
    k4, k5, k6 = optics[9], optics[10], optics[11]
    over = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    under = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    over_slope = k1 + r2 * (2 * k2 + 3 * r2 * k3)
    under_slope = k4 + r2 * (2 * k5 + 3 * r2 * k6)
    factor = over / under
    return factor, (over_slope - factor * under_slope) / under


@kernel
def distort_rational(x: float, y: float, optics: Array) -> tuple[float, float]:
    """Distorted normalised coordinates of an ideal normalised point; NaN beyond the fold."""
    r2 = x * x + y * y
    if not r2 < optics[13]:
        return math.nan, math.nan
    factor, _ = radial_factor(r2, optics)
    p1, p2 = optics[6], optics[7]
    xd = x * factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    return xd, y * factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y


@kernel
def undistort_rational(xd: float, yd: float, optics: Array) -> tuple[float, float]:
    """Ideal normalised point whose distortion is (xd, yd), by Newton; NaN if there is none.

    A step that leaves the one-to-one region about the axis is halved.
    """
    p1, p2, fold = optics[6], optics[7], optics[13]
    x, y, last_x, last_y = xd, yd, 0.0, 0.0
    for _ in range(STEPS):
        r2 = x * x + y * y
        factor, by_r2 = radial_factor(r2, optics)
        xx = factor + 2 * x * x * by_r2 + 2 * p1 * y + 6 * p2 * x
        xy = 2 * x * y * by_r2 + 2 * p1 * x + 2 * p2 * y
        yy = factor + 2 * y * y * by_r2 + 6 * p1 * y + 2 * p2 * x
        det = xx * yy - xy * xy
        if not (det > 0 and r2 < fold):
            x, y = (x + last_x) / 2, (y + last_y) / 2
            continue
        ex = x * factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) - xd
        ey = y * factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y - yd
        dx, dy = (yy * ex - xy * ey) / det, (xx * ey - xy * ex) / det
        last_x, last_y = x, y
        x -= dx
        y -= dy
        if dx * dx + dy * dy < NEARLY**2:
            return x, y
    return math.nan, math.nan


@kernel
def ideal_point(x: float, y: float, z: float, shift: float) -> tuple[float, float]:
    """Ideal normalised point (u, v) whose ray meets (x, y, z), by Newton; NaN behind the device.

    The radius r = |(u, v)| solves ``r (z - shift r^2) = |(x, y)|`` on the branch about the axis.
    """
    if not z > 0:
        return math.nan, math.nan
    across = math.sqrt(x * x + y * y)
    if shift == 0 or across == 0:
        return x / z, y / z
    r = across / z
    for _ in range(STEPS):
        slope = z - 3 * shift * r * r
        if not slope > 0:
            return math.nan, math.nan
        step = (r * (z - shift * r * r) - across) / slope
        r -= step
        if abs(step) < NEARLY * r:
            return x / across * r, y / across * r
    return math.nan, math.nan


@kernel
def rays_of(pixels: Array, optics: Array, rotation: Array, centre: Array) -> tuple[Array, Array]:
    """Origins and unit directions ``(n, 3)`` of the rays through pixels ``(n, 2)``.

    `rotation` is device_from_camera's, `centre` the device's place in the camera's frame; both
    results are in the camera's frame, NaN where the distortion has no inverse.
    """
    origins, directions = np.empty((len(pixels), 3)), np.empty((len(pixels), 3))
    for i in range(len(pixels)):
        xd = (pixels[i, 0] - optics[2]) / optics[0]
        yd = (pixels[i, 1] - optics[3]) / optics[1]
        x, y = undistort_rational(xd, yd, optics)
        start = optics[12] * (x * x + y * y)
        length = math.sqrt(x * x + y * y + 1)
        for j in range(3):
            origins[i, j] = centre[j] + start * rotation[2, j]
            along = x * rotation[0, j] + y * rotation[1, j] + rotation[2, j]
            directions[i, j] = along / length
    return origins, directions


@kernel
def pixels_of(points: Array, optics: Array, rotation: Array, translation: Array) -> Array:
    """Pixels ``(n, 2)`` of points ``(n, 3)`` in the camera's frame, mm; NaN where not seen."""
    out = np.empty((len(points), 2))
    for i in range(len(points)):
        x, y, z = moved(points, i, rotation, translation)
        u, v = ideal_point(x, y, z, optics[12])
        xd, yd = distort_rational(u, v, optics)
        out[i, 0], out[i, 1] = xd * optics[0] + optics[2], yd * optics[1] + optics[3]
    return out


@kernel
def origins_of(
    points: Array, optics: Array, rotation: Array, translation: Array, centre: Array
) -> Array:
    """Where the rays through points ``(n, 3)`` start, ``(n, 3)``, mm in the camera's frame."""
    out = np.empty((len(points), 3))
    for i in range(len(points)):
        x, y, z = moved(points, i, rotation, translation)
        u, v = ideal_point(x, y, z, optics[12])
        start = optics[12] * (u * u + v * v)
        for j in range(3):
            out[i, j] = centre[j] + start * rotation[2, j]
    return out


@kernel
def moved(points: Array, i: int, rotation: Array, translation: Array) -> tuple[float, float, float]:
    """Point i after the rigid motion."""
    px, py, pz = points[i, 0], points[i, 1], points[i, 2]
    x = rotation[0, 0] * px + rotation[0, 1] * py + rotation[0, 2] * pz + translation[0]
    y = rotation[1, 0] * px + rotation[1, 1] * py + rotation[1, 2] * pz + translation[1]
    z = rotation[2, 0] * px + rotation[2, 1] * py + rotation[2, 2] * pz + translation[2]
    return x, y, z
