"""A cylinder before a wall as a cloud, without any image: what pages are tried on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Cloud

RADIUS, MIDDLE_X, MIDDLE_Z = 52.5, 8.0, 650.0
WALL_Z = 760.0
FOCAL_SHARE = 2.6
"""Focal length over the image's width, as the paper's camera has it."""

Array = NDArray[np.float64]


def rays(height: int, width: int) -> Array:
    """``(H, W, 3)`` directions with z = 1."""
    v, u = np.mgrid[:height, :width].astype(float)
    focal = FOCAL_SHARE * width
    x, y = (u - (width - 1) / 2) / focal, (v - (height - 1) / 2) / focal
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def cylinder_depth(direction: Array) -> Array:
    """z where each ray first meets the upright cylinder, NaN where it passes by."""
    x = direction[..., 0]
    square, mixed = x**2 + 1, x * MIDDLE_X + MIDDLE_Z
    root = mixed**2 - square * (MIDDLE_X**2 + MIDDLE_Z**2 - RADIUS**2)
    return np.where(root > 0, (mixed - np.sqrt(np.maximum(root, 0))) / square, np.nan)


def cloud_of(xyz: Array, *, sigma: float = 0.02) -> Cloud:
    """Points with one sigma; the camera saw them brighter from top to bottom."""
    height, width = xyz.shape[:2]
    bright = np.repeat(np.linspace(20, 200, height)[:, None], width, axis=1)
    flat = np.where(np.isfinite(xyz[..., 2]), sigma, np.nan)
    return Cloud(
        xyz=xyz.astype(np.float32),
        sigma_mm=flat.astype(np.float32),
        intensity=bright.astype(np.float32),
        epipolar_px=np.full((height, width), np.nan, np.float32),
    )


def cylinder_before_wall(
    height: int = 120, width: int = 188, *, sigma: float = 0.02
) -> tuple[Cloud, NDArray[np.bool_]]:
    """The cloud with its noise along the rays, and which pixels are the cylinder."""
    direction = rays(height, width)
    depth = cylinder_depth(direction)
    on_cylinder = np.isfinite(depth)
    noise = np.random.default_rng(5).normal(0, sigma, depth.shape)
    depth = np.where(on_cylinder, depth, WALL_Z) + noise
    return cloud_of(direction * depth[..., None], sigma=sigma), on_cylinder


def spiral(degrees: float, *, sigma: float = 0.0, noise: float = 0.0) -> Cloud:
    """The upright surface that every ray of a row meets at one angle from its normal.

    A logarithmic spiral: the distance grows by the same share per angle everywhere.
    """
    direction = rays(60, 80)
    angle = np.arctan(direction[..., 0])
    distance = 650.0 * np.exp(np.tan(np.deg2rad(degrees)) * angle)
    distance = distance + np.random.default_rng(6).normal(0, 1, angle.shape) * noise
    unit = np.stack([np.sin(angle), direction[..., 1], np.cos(angle)], axis=-1)
    return cloud_of(unit * distance[..., None], sigma=sigma)
