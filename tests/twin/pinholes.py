"""A small rig whose every number can be worked out by hand, and scenes for it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Camera, Lens, Pose, Projector, Rig
from fringeworks.twin.scene import Material, Object, Plane, Scene, Shape

CAMERA = Camera(101, 81, Lens(1000.0, 1000.0, 50.0, 40.0))
PROJECTOR = Projector(201, 101, Lens(500.0, 500.0, 100.0, 50.0))
RIG = Rig(CAMERA, PROJECTOR, Pose(np.eye(3), np.array([-100.0, 0.0, 0.0])))
"""The projector stands 100 mm to the right of the camera and looks the same way."""

NO_NOISE = np.random.default_rng(0)
"""For frames in which nothing is random: whatever is drawn does not matter."""


def at(x: float, y: float, z: float, rotation: NDArray[np.float64] | None = None) -> Pose:
    turn = np.eye(3) if rotation is None else rotation
    return Pose(turn, np.array([x, y, z]))


def only(shape: Shape, pose: Pose, material: Material | None = None) -> Scene:
    """A scene of one thing."""
    return Scene("test", (Object("thing", shape, pose, material or Material(albedo=1.0)),))


def wall(z_mm: float, albedo: float = 1.0) -> Scene:
    """An endless plane that faces the rig."""
    return only(Plane(), at(0.0, 0.0, z_mm), Material(albedo=albedo))
