"""Points on the twin's fourteen boards in closed form, for the fit of the paper's parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.extended.planes import PlanePoints
from fringeworks.geometry.lens import project
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.kernels.paper_model import paper_depths
from fringeworks.model import Axis, Extended, Lens, Pose, Rig
from fringeworks.reconstruct.geometric import equation_of
from fringeworks.twin.scenes import BOARD_POSES, board_pose, paper_rig

Array = NDArray[np.float64]

P = 32.0
DISTORTED = paper_rig()
PINHOLE = replace(
    DISTORTED,
    projector=replace(DISTORTED.projector, lens=Lens(1013.0, 2026.0, 300.4, 712.7)),
)
PER_BOARD = 400


def points_of(rig: Rig, *, noise_px: float = 0.0, axis: Axis = "x") -> PlanePoints:
    """On the twin's fourteen boards, as the true rig sees them."""
    rng = np.random.default_rng(5)
    parts = []
    for pose in BOARD_POSES:
        flat = np.column_stack([rng.uniform(-13, 140, (PER_BOARD, 2)), np.zeros(PER_BOARD)])
        points = board_pose(*pose).apply(flat)
        lit = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)
        parts.append((points, lit[:, 0 if axis == "x" else 1]))
    points = np.concatenate([part for part, _ in parts])
    coordinate = np.concatenate([part for _, part in parts])
    coordinate += noise_px * rng.standard_normal(len(coordinate))
    return PlanePoints(
        rays=np.ascontiguousarray(points[:, :2].T / points[:, 2]),
        coordinate=coordinate,
        depth=points[:, 2].copy(),
        sigma=np.full(len(coordinate), max(noise_px, 0.01)),
        plane=np.repeat(np.arange(len(parts)), PER_BOARD),
    )


def depths(points: PlanePoints, rig: Rig, extended: Extended) -> Array:
    z, _ = paper_depths(points.rays, points.coordinate, equation_of(rig, extended))
    return z


def apart(rig: Rig, pinhole_focal: float) -> Rig:
    """The camera with another fy."""
    return replace(rig, camera=replace(rig.camera, lens=replace(rig.camera.lens, fy=pinhole_focal)))


def turned(rig: Rig, rotation: Array) -> Rig:
    return replace(
        rig, projector_from_camera=Pose(rotation, rig.projector_from_camera.translation_mm)
    )


PURE_Y = turned(PINHOLE, rotation_matrix(np.array([0.0, -0.28, 0.0])))
PURE_X = turned(PINHOLE, rotation_matrix(np.array([-0.2, 0.0, 0.0])))
