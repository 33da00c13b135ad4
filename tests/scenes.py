"""A rig like the paper's and surfaces seen by it, by projection alone (no image is formed)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.lens import project, unproject
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Camera, CodedAxis, Lens, Pose, Projector, ProjectorMap, Rig

CAMERA = Camera(752, 480, Lens(1974, 1970, 376, 240, -0.1, 0.05, 2e-4, -3e-4, 0.01))
PROJECTOR = Projector(608, 684, Lens(1013, 1015, 300, 700, -0.05, 0.03, 1e-3, -5e-4))
POSE = Pose(rotation_matrix(np.array([0.02, -0.28, 0.01])), np.array([-180.0, 5.0, 20.0]))
RIG = Rig(CAMERA, PROJECTOR, POSE)


def coarser(rig: Rig, times: float) -> Rig:
    """The rig with so many times fewer camera pixels each way; it sees and lights the same."""
    camera, lens = rig.camera, rig.camera.lens
    coarse = replace(
        lens,
        fx=lens.fx / times,
        fy=lens.fy / times,
        cx=(lens.cx + 0.5) / times - 0.5,
        cy=(lens.cy + 0.5) / times - 0.5,
    )
    return replace(
        rig, camera=Camera(int(camera.width / times), int(camera.height / times), coarse)
    )


def plane_points(
    rig: Rig, normal: tuple[float, float, float], offset_mm: float
) -> NDArray[np.float64]:
    """Where each camera pixel's ray meets ``normal . X = offset_mm``, ``(H, W, 3)``."""
    v, u = np.mgrid[: rig.camera.height, : rig.camera.width].astype(float)
    ray = unproject(np.stack([u, v], axis=-1), rig.camera.lens.vector)
    ray = np.concatenate([ray, np.ones_like(ray[..., :1])], axis=-1)
    return np.asarray(ray * (offset_mm / (ray @ np.array(normal)))[..., None])


def map_of(
    rig: Rig,
    xyz: NDArray[np.float64],
    *,
    axes: Literal["x", "y", "xy"] = "xy",
    sigma: float = 0.02,
    noise: NDArray[np.float64] | None = None,
) -> ProjectorMap:
    """Projector coordinates of points ``(H, W, 3)``, with `noise` ``(H, W, 2)`` added."""
    points = rig.projector_from_camera.apply(xyz.reshape(-1, 3))
    pixels = project(points, rig.projector.lens.vector).reshape(*xyz.shape[:2], 2)
    if noise is not None:
        pixels = pixels + noise
    column = coded_axis("x", pixels[..., 0], sigma) if "x" in axes else None
    row = coded_axis("y", pixels[..., 1], sigma) if "y" in axes else None
    return ProjectorMap(column, row)


def coded_axis(axis: Literal["x", "y"], pixels: NDArray[np.float64], sigma: float) -> CodedAxis:
    """An axis that is coded everywhere, with one sigma."""
    coordinate = pixels.astype(np.float32)
    flat = np.full_like(coordinate, 100.0)
    return CodedAxis(
        axis=axis,
        coordinate=coordinate,
        sigma=np.full_like(coordinate, sigma),
        offset=flat,
        modulation=flat,
        phase=None,
        void=np.zeros(coordinate.shape, np.uint8),
        route=(),
    )
