"""Points on artefacts as a camera would see them: caps of balls, flats on a grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Cloud

Array = NDArray[np.float64]


def ball_points(
    count: int,
    *,
    centre: tuple[float, float, float] = (0.0, 0.0, 650.0),
    radius: float = 20.0,
    half_deg: float = 70.0,
    sd: float = 0.0,
    seed: int = 0,
) -> Array:
    """``(count, 3)`` evenly over the cap that looks at the camera, noise of `sd` along normals."""
    rng = np.random.default_rng(seed)
    cosine = rng.uniform(np.cos(np.radians(half_deg)), 1, count)
    turn, sine = rng.uniform(0, 2 * np.pi, count), np.sqrt(1 - cosine**2)
    normals = np.stack([sine * np.cos(turn), sine * np.sin(turn), -cosine], axis=1)
    return np.asarray(centre + (radius + rng.normal(0, 1, count) * sd)[:, None] * normals)


def flat_cloud(across: Array, *, pitch: float = 1.0, depth: float = 0.0) -> Cloud:
    """A flat ``(H, W)`` of points `pitch` mm apart with these distances, mm, from its plane.

    float32 rounds what stands near the origin to a millionth of it.
    """
    v, u = np.mgrid[: across.shape[0], : across.shape[1]] * pitch
    xyz = np.stack([u, v, depth + across], axis=-1).astype(np.float32)
    return cloud_of(xyz)


def cloud_of(xyz: NDArray[np.floating]) -> Cloud:
    """A cloud of nothing but its points, ``(H, W, 3)``, or ``(n, 3)`` as a file keeps them."""
    xyz = np.asarray(xyz, dtype=np.float32)
    xyz = xyz[None] if xyz.ndim == 2 else xyz
    nothing = np.full(xyz.shape[:2], np.nan, np.float32)
    return Cloud(xyz, nothing, nothing, nothing)
