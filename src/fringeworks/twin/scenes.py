"""Named scenes and rigs: the paper's instrument and what is put before it.

The rig is the paper's: a 752x480 camera of 0.30 mm per pixel at 600 mm and a DLP3000, 608x684 on
a lattice whose rows are half as far apart as its columns, its image raised above its axis. What
the paper leaves out is chosen: a baseline of 189 mm at 16 degrees, lenses with distortion. The
scenes fit that rig's view, 540 to 780 mm deep.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from fringeworks.errors import UsageError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import (
    Camera,
    CharucoTarget,
    CheckerboardTarget,
    CirclesTarget,
    Lens,
    Pose,
    Projector,
    Rig,
    Target,
)
from fringeworks.twin.scene import (
    Blend,
    Board,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Material,
    Object,
    Plane,
    Scene,
    Sphere,
)

Named = TypeVar("Named")

CAMERA = Camera(752, 480, Lens(1974.0, 1974.0, 381.3, 236.2, -0.10, 0.05, 2e-4, -2e-4))
PROJECTOR = Projector(608, 684, Lens(1013.0, 2026.0, 300.4, 712.7, -0.03, 0.02, 5e-4, -5e-4))
PROJECTOR_CENTRE_MM = (178.0, 64.0, 8.0)
AIM_MM = (0.0, 0.0, 660.0)
"""The middle of the projector's image lies on this point of the camera's axis."""

WORKING_DEPTH_MM = (540.0, 780.0)

CYLINDER_RADIUS_MM = 52.5
PLASTER = Material(albedo=0.75)
GLOSSY = Material(albedo=0.4, gloss=0.3, gloss_exponent=60.0)
SATIN = Material(albedo=0.15, gloss=0.2, gloss_exponent=12.0)
PAPER = Material(albedo=0.8, dark_albedo=0.06)
UPRIGHT = (90.0, 0.0, 0.0)
"""Rotation, degrees, that turns a shape's z axis into -y: upwards."""


def named_scene(name: str) -> Scene:
    """The scene called `name`, one of `SCENES`; UsageError for another name."""
    return _choose(name, SCENES, "scene")()


def named_rig(name: str) -> Rig:
    """The rig called `name`, one of `RIGS`; UsageError for another name."""
    return _choose(name, RIGS, "rig")()


def _choose(name: str, known: Mapping[str, Named], what: str) -> Named:
    if name not in known:
        raise UsageError(f"{what} must be a file or one of {', '.join(known)}, got '{name}'")
    return known[name]


def paper_rig() -> Rig:
    """The paper's rig, lenses within what a calibration can describe."""
    return Rig(CAMERA, PROJECTOR, _aimed_pose(), volume_mm=WORKING_DEPTH_MM)


def warped_rig() -> Rig:
    """The same with lenses that the five terms do not describe, and not quite central."""
    beyond = {
        "camera": {"k4": 0.02, "k5": -0.01, "k6": 0.01, "pupil_shift_mm": 0.5},
        "projector": {"k4": -0.02, "k5": 0.01, "k6": 0.0, "pupil_shift_mm": 1.0},
    }
    return replace(paper_rig(), further={"twin": beyond})


def _aimed_pose() -> Pose:
    """projector_from_camera of a level projector whose image's middle meets `AIM_MM`."""
    centre, lens = np.array(PROJECTOR_CENTRE_MM), PROJECTOR.lens
    aim = np.array(AIM_MM) - centre
    yaw = np.arctan2(aim[0], aim[2])
    rise = np.arctan2(aim[1], np.hypot(aim[0], aim[2]))
    lifted = np.arctan(((PROJECTOR.height - 1) / 2 - lens.cy) / lens.fy)
    turned = rotation_matrix(np.array([0.0, yaw, 0.0])) @ rotation_matrix(
        np.array([lifted - rise, 0.0, 0.0])
    )
    return Pose(turned.T, -turned.T @ centre)


def place(
    position_mm: tuple[float, float, float], rotation_deg: tuple[float, float, float] = (0, 0, 0)
) -> Pose:
    """camera_from_object: where the shape's origin is and its rotation vector, degrees."""
    return Pose(
        rotation_matrix(np.deg2rad(np.array(rotation_deg, dtype=np.float64))),
        np.array(position_mm, dtype=np.float64),
    )


def _cylinder(position_mm: tuple[float, float, float], length_mm: float) -> Object:
    shape = Cylinder(CYLINDER_RADIUS_MM, length_mm)
    return Object("cylinder", shape, place(position_mm, UPRIGHT), PLASTER)


def cylinder_scene() -> Scene:
    """The paper's plaster cylinder, R = 52.5 mm, upright and alone."""
    return Scene("cylinder", (_cylinder((4.0, 2.0, 700.0), 130.0),))


def two_scene() -> Scene:
    """The paper's isolated objects: the cylinder on the left, a cone on the right."""
    cone = Object("cone", Cone(38.0, 110.0), place((62.0, 52.0, 665.0), UPRIGHT), PLASTER)
    return Scene("two", (_cylinder((-58.0, 0.0, 705.0), 120.0), cone))


def hand_scene() -> Scene:
    """A free-form hand of plaster, about 130 mm long, its back towards the camera."""
    return Scene("hand", (Object("hand", hand(), place((0.0, 8.0, 660.0)), PLASTER),))


def wall_scene() -> Scene:
    """A wall over the whole view, tilted by ten degrees."""
    wall = Object("wall", Plane(), place((0.0, 0.0, 700.0), (-6.0, 8.0, 0.0)), Material(0.8))
    return Scene("wall", (wall,))


def step_scene() -> Scene:
    """Two boxes of 20 and 40 mm height before a wall."""
    wall = Object("wall", Plane(), place((0.0, 0.0, 720.0)), Material(0.8))
    low = Object("low", Box((60.0, 90.0, 20.0)), place((-45.0, 0.0, 710.0)), PLASTER)
    high = Object("high", Box((60.0, 90.0, 40.0)), place((45.0, 0.0, 700.0)), PLASTER)
    return Scene("step", (wall, low, high))


def balls_scene() -> Scene:
    """A ball bar: two matt spheres of 20 mm radius, their centres 120 mm apart."""
    ball = Sphere(20.0)
    left = Object("left", ball, place((-57.0, 12.0, 672.0)), PLASTER)
    right = Object("right", ball, place((57.0, -12.0, 702.0)), PLASTER)
    gap = right.camera_from_object.translation_mm - left.camera_from_object.translation_mm
    middle = (right.camera_from_object.translation_mm + left.camera_from_object.translation_mm) / 2
    span = 60.0 * gap / np.linalg.norm(gap)
    placed = [
        replace(ball_object, camera_from_object=Pose(np.eye(3), middle + sign * span))
        for ball_object, sign in ((left, -1.0), (right, 1.0))
    ]
    return Scene("balls", tuple(placed))


def contrast_scene() -> Scene:
    """Near black beside near white beside gloss: more than one exposure can show."""
    wall = Object("wall", Plane(), place((0.0, 0.0, 730.0), (-6.0, 8.0, 0.0)), Material(0.35))
    solids = (
        Object("white", Box((46.0, 46.0, 30.0)), place((-66.0, -36.0, 700.0)), Material(0.95)),
        Object("black", Box((46.0, 46.0, 30.0)), place((-6.0, -36.0, 700.0)), Material(0.03)),
        Object("glossy", Sphere(24.0), place((62.0, -34.0, 695.0)), GLOSSY),
        Object("satin", Cylinder(22.0, 60.0), place((-62.0, 40.0, 700.0), UPRIGHT), SATIN),
        Object("dark", Sphere(26.0), place((4.0, 42.0, 695.0)), Material(0.06)),
        Object("grey", Cone(26.0, 60.0), place((68.0, 70.0, 695.0), UPRIGHT), Material(0.2)),
    )
    return Scene("contrast", (wall, *solids))


BOARD = Board(columns=11, rows=8, square_mm=13.0)


def board_scene() -> Scene:
    """A printed checkerboard, 11x8 corners of 13 mm, in fourteen poses: what calibrates a rig."""
    poses = tuple(board_pose(*row) for row in BOARD_POSES)
    return Scene("board", (Object("board", BOARD, poses[0], PAPER),), posed="board", poses=poses)


BOARD_POSES: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...] = (
    ((0, 0, 650), (0, 0, 0)),
    ((-20, -4, 600), (0, 28, 4)),
    ((20, 4, 610), (4, -30, -3)),
    ((14, 8, 630), (28, 3, 2)),
    ((-14, -8, 630), (-30, -2, -4)),
    ((-50, 22, 700), (20, 22, 0)),
    ((50, -18, 700), (-22, -20, 5)),
    ((48, 17, 690), (22, -24, -5)),
    ((-48, -22, 690), (-20, 24, 6)),
    ((0, 0, 735), (6, -6, 90)),
    ((58, 22, 750), (8, 34, 3)),
    ((-60, -25, 755), (-8, -34, 0)),
    ((40, -27, 740), (36, 6, -8)),
    ((-12, 6, 585), (-10, 10, 0)),
)
"""Where the board's middle is, mm, and the board's rotation vector, degrees."""


def board_pose(
    middle_mm: tuple[float, float, float], rotation_deg: tuple[float, float, float]
) -> Pose:
    """camera_from_board that puts the middle of the corners of `BOARD` at `middle_mm`."""
    turned = place(middle_mm, rotation_deg)
    corners = np.array([BOARD.columns - 1, BOARD.rows - 1, 0]) * BOARD.square_mm / 2
    return replace(turned, translation_mm=turned.translation_mm - turned.rotation @ corners)


def target_of(board: Board) -> Target:
    """What a calibration is told of a board: its nominal pitch, not what went wrong in print."""
    size = (board.columns, board.rows, board.square_mm, board.square_mm)
    if board.kind == "circles" and board.diameter_mm is not None:
        return CirclesTarget(*size, board.diameter_mm)
    if board.kind == "charuco" and board.marker_mm is not None:
        return CharucoTarget(*size, board.marker_mm, board.dictionary)
    return CheckerboardTarget(*size)


def hand() -> Blend:
    """Palm, four fingers, thumb and wrist, mm: x to the right, y down, z away from the camera."""
    chains = [chain for finger in FINGERS for chain in _chain(finger)]
    return Blend(tuple(chains), smooth_mm=6.0)


FINGERS: tuple[tuple[tuple[float, float, float, float], ...], ...] = (
    ((-16, 44, 2, 14), (-17, 14, 0, 13), (-21, -14, 0, 9)),
    ((0, 46, 2, 14), (-3, 12, -2, 13), (-7, -18, -1, 9)),
    ((14, 44, 2, 13), (11, 14, -1, 13), (7, -16, -1, 9)),
    ((20, 40, 3, 12), (22, 16, 0, 11), (20, -10, 0, 8)),
    ((-21, -14, 0, 9), (-25, -34, -3, 8), (-27, -50, 1, 7), (-28, -58, 4, 6)),
    ((-7, -18, -1, 9), (-9, -42, -5, 8.5), (-10, -60, -1, 7.5), (-10, -69, 2, 6.5)),
    ((7, -16, -1, 9), (8, -39, -5, 8.5), (9, -56, -1, 7.5), (9, -64, 3, 6.5)),
    ((20, -10, 0, 8), (25, -28, -3, 7.5), (28, -41, 0, 6.5), (29, -48, 3, 5.5)),
    ((-18, 40, 0, 12), (-34, 20, -6, 10.5), (-46, 2, -8, 9), (-51, -12, -6, 7.5)),
    ((0, 48, 2, 20), (0, 62, 3, 19)),
)
"""Rows of x, y, z and radius, mm, joined one after the other: palm, fingers, thumb, wrist."""


def _chain(rows: tuple[tuple[float, float, float, float], ...]) -> list[Capsule]:
    return [Capsule(a[:3], a[3], b[:3], b[3]) for a, b in pairwise(rows)]


SCENES: Mapping[str, Callable[[], Scene]] = MappingProxyType(
    {
        "cylinder": cylinder_scene,
        "two": two_scene,
        "hand": hand_scene,
        "wall": wall_scene,
        "step": step_scene,
        "balls": balls_scene,
        "contrast": contrast_scene,
        "board": board_scene,
    }
)

RIGS: Mapping[str, Callable[[], Rig]] = MappingProxyType({"paper": paper_rig, "warped": warped_rig})
