"""Clouds of scenes as the paper's rig sees them, from the twin's truth and drawn noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Cloud, Pose
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Box, Object, Scene, Sphere
from fringeworks.twin.scenes import PLASTER, paper_rig, wall_scene
from fringeworks.twin.stage import Stage

SD = 0.05

BALLS = (
    ((0, 0, 0), 42.0),
    ((30, -28, 10), 18.0),
    ((-28, -20, -22), 20.0),
    ((10, 30, -30), 16.0),
    ((-25, 25, 22), 19.0),
    ((5, -30, -35), 15.0),
    ((-5, 28, 36), 14.0),
    ((38, 8, -12), 13.0),
)
"""Middles and radii, mm, of balls that stick together: a thing whose distance is a closed form."""

MIDDLE_MM = np.array([0.0, 0.0, 690.0])


def see(scene: Scene, rng: np.random.Generator | None = None, *, sd: float = SD) -> Cloud:
    """What is lit of a scene, each point moved along its ray by noise of z."""
    truth = Stage(scene, paper_rig(), Effects()).truth()
    xyz = np.where(np.isfinite(truth.column)[..., None], truth.xyz, np.nan)
    noise = np.zeros(xyz.shape[:2]) if rng is None else rng.normal(0, sd, xyz.shape[:2])
    xyz = xyz * (1 + noise / xyz[..., 2])[..., None]
    sigma = np.full(noise.shape, sd, np.float32)
    return Cloud(xyz.astype(np.float32), sigma, 100 + 0 * sigma, np.nan * sigma)


def renoise(cloud: Cloud, rng: np.random.Generator, *, sd: float = SD) -> Cloud:
    """A cloud without noise, seen once more."""
    noise = rng.normal(0, sd, cloud.valid.shape)
    xyz = cloud.xyz * (1 + noise / cloud.xyz[..., 2])[..., None]
    return replace(cloud, xyz=xyz.astype(np.float32))


def cut(cloud: Cloud) -> Cloud:
    """The part of the picture about the block: what matters, in a tenth of the time."""
    part = np.s_[170:310, 300:460]
    sigma = cloud.sigma_mm[part]
    return Cloud(cloud.xyz[part], sigma, sigma, sigma)


def wall_with_step(size_mm: tuple[float, float, float] = (20.0, 20.0, 2.0)) -> Scene:
    """The tilted wall with a block on it, its middle on the camera's axis."""
    wall = wall_scene().objects[0]
    pose = wall.camera_from_object
    # The block's far face is in the wall; the wall's z points away from the camera.
    middle = pose.translation_mm - pose.rotation[:, 2] * size_mm[2] / 2
    block = Object("block", Box(size_mm), Pose(pose.rotation, middle), PLASTER)
    return Scene("block", (wall, block))


def balls_scene(turn_deg: float) -> tuple[Scene, Pose]:
    """The balls on a table that turned about the vertical, and ``camera_from_thing``."""
    turn = rotation_matrix(np.array([0.0, np.deg2rad(turn_deg), 0.0]))
    things = [
        Object(
            f"ball {number}",
            Sphere(radius),
            Pose(np.eye(3), MIDDLE_MM + turn @ np.array(middle)),
            PLASTER,
        )
        for number, (middle, radius) in enumerate(BALLS)
    ]
    return Scene("balls", tuple(things)), Pose(turn, MIDDLE_MM)


def off_balls(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance ``(n,)`` from the balls' surface, in their own frame."""
    each = [np.linalg.norm(points - np.array(m), axis=1) - r for m, r in BALLS]
    return np.asarray(np.min(each, axis=0))
