"""Differential geometry on the camera's pixel grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SLOPE_NOISE = 0.05
WIDEST_SMOOTHING = 15


def _difference(xyz: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """Central difference along a grid axis, one-sided where a neighbour is void."""
    forward = np.full_like(xyz, np.nan)
    ahead = np.moveaxis(forward, axis, 0)
    ahead[:-1] = np.diff(np.moveaxis(xyz, axis, 0), axis=0)
    behind = np.full_like(forward, np.nan)
    np.moveaxis(behind, axis, 0)[1:] = ahead[:-1]
    both = (forward + behind) / 2
    return np.where(np.isfinite(both), both, np.where(np.isfinite(forward), forward, behind))


def grid_normals(xyz: NDArray[np.float32]) -> NDArray[np.float32]:
    """Unit normals ``(H, W, 3)`` of an organised cloud, turned towards the camera.

    The cross product of differences along rows and columns of the grid; NaN where the point or
    all its neighbours along either direction are void.
    """
    normals = np.cross(_difference(xyz, 0), _difference(xyz, 1))
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = normals / length
    away = np.einsum("...i,...i->...", normals, xyz) > 0
    return np.asarray(np.where(away[..., None], -normals, normals), dtype=np.float32)


def smoothing_window(xyz: NDArray[np.floating], sigma_mm: NDArray[np.floating]) -> int:
    """Odd width, px, from the points' spacing and sigma; 3 where they are not known."""
    steps = np.abs(np.diff(xyz[..., 0], axis=1))
    steps, sigmas = steps[np.isfinite(steps)], sigma_mm[np.isfinite(sigma_mm)]
    spacing = float(np.median(steps)) if steps.size else 0.0
    if not spacing > 0 or not sigmas.size:
        return 3
    half = int(np.ceil(np.sqrt(float(np.median(sigmas)) / (SLOPE_NOISE * spacing))))
    return min(1 + 2 * half, WIDEST_SMOOTHING)
