"""Projection through a lens, its inverse, and its derivatives.

Lenses are vectors ``(9,)``: fx, fy, cx, cy, k1, k2, p1, p2, k3. Pixel centres sit at integers.
The model is OpenCV's five-term one (tested against ``cv2.projectPoints``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.lens import distort_points, undistort_points

Array = NDArray[np.float64]

LENS_NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


def project(points: Array, lens: Array) -> Array:
    """Pixels ``(..., 2)`` of points ``(..., 3)`` in the device's frame, mm.

    NaN where the point is not in front of the device.
    """
    points = np.asarray(points, dtype=np.float64)
    z = points[..., 2:]
    ideal = np.where(z > 0, points[..., :2], np.nan) / np.where(z > 0, z, 1.0)
    distorted = distort_points(np.ascontiguousarray(ideal.reshape(-1, 2)), lens)
    return distorted.reshape(ideal.shape) * lens[:2] + lens[2:4]


def unproject(pixels: Array, lens: Array) -> Array:
    """Ideal normalised coordinates ``(..., 2)`` (x / z, y / z) of the rays through pixels.

    NaN where the distortion has no inverse.
    """
    pixels = np.asarray(pixels, dtype=np.float64)
    normalised = (pixels - lens[2:4]) / lens[:2]
    flat = np.ascontiguousarray(normalised.reshape(-1, 2))
    return undistort_points(flat, lens).reshape(pixels.shape)


def project_jacobian(points: Array, lens: Array) -> tuple[Array, Array, Array]:
    """Projection with its derivatives.

    Parameters
    ----------
    points
        ``(n, 3)``, mm, in the device's frame, in front of it.
    lens
        ``(9,)``.

    Returns
    -------
    pixels, by_point, by_lens
        ``(n, 2)`` px, ``(n, 2, 3)`` px per mm, and ``(n, 2, 9)`` px per unit of each parameter.
    """
    z = points[:, 2]
    x, y = points[:, 0] / z, points[:, 1] / z
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
    xy = 2 * x * y
    x_term, y_term = r2 + 2 * x * x, r2 + 2 * y * y
    xd = x * radial + p1 * xy + p2 * x_term
    yd = y * radial + p1 * y_term + p2 * xy
    d_xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
    d_xy = x * y * slope + 2 * p1 * x + 2 * p2 * y
    d_yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x

    by_point = np.empty((len(points), 2, 3))
    by_point[:, 0, 0], by_point[:, 0, 1] = fx * d_xx / z, fx * d_xy / z
    by_point[:, 1, 0], by_point[:, 1, 1] = fy * d_xy / z, fy * d_yy / z
    by_point[:, :, 2] = -(by_point[:, :, 0].T * x + by_point[:, :, 1].T * y).T

    zero, one = np.zeros_like(x), np.ones_like(x)
    r4, r6 = r2**2, r2**3
    across = [xd, zero, one, zero, *(fx * term for term in (x * r2, x * r4, xy, x_term, x * r6))]
    down = [zero, yd, zero, one, *(fy * term for term in (y * r2, y * r4, y_term, xy, y * r6))]
    by_lens = np.stack([np.stack(across, axis=-1), np.stack(down, axis=-1)], axis=1)
    pixels = np.stack([fx * xd + cx, fy * yd + cy], axis=-1)
    return pixels, by_point, by_lens


def pixel_rays(pixels: Array, lens: Array) -> Array:
    """``(n, 3)`` directions, z = 1, in which a device sees pixels ``(n, 2)``; as `unproject`."""
    return np.column_stack([unproject(pixels, lens), np.ones(len(pixels))])


def unproject_jacobian(pixels: Array, lens: Array) -> tuple[Array, Array]:
    """`unproject` of pixels ``(n, 2)`` with its derivative ``(n, 2, 9)`` by the lens.

    The distortion of the ideal point is the pixel whatever the lens, so that the point moves by
    ``-(dF / d ideal)^-1 dF / d lens``, F being the projection at depth one. NaN as `unproject`.
    """
    ideal = unproject(pixels, lens)
    rays = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
    _, by_point, by_lens = project_jacobian(rays, lens)
    return ideal, -solve_pairs(by_point[:, :, :2], by_lens)


def solve_pairs(matrices: Array, values: Array) -> Array:
    """``(n, 2, k)`` solutions of n systems ``(n, 2, 2)``; not finite where one is singular."""
    (a, b), (c, d) = np.moveaxis(matrices, 0, -1)
    above, below = values[:, 0], values[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = (1 / (a * d - b * c))[:, None]
        first = (d[:, None] * above - b[:, None] * below) * inverse
        second = (a[:, None] * below - c[:, None] * above) * inverse
    return np.stack([first, second], axis=1)
