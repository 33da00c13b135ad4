"""Scenes and effects that cannot be are refused in words."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import UsageError
from fringeworks.model import Pose
from fringeworks.twin.check import check_effects, check_scene
from fringeworks.twin.effects import (
    AmbientEffects,
    CameraEffects,
    Effects,
    ProjectorEffects,
)
from fringeworks.twin.scene import (
    Blend,
    Board,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Material,
    Mesh,
    Object,
    Plane,
    Scene,
    Shape,
    Sphere,
)

HERE = Pose.identity()
BALL = Object("ball", Sphere(1.0), HERE)
BOARD = Board(9, 6, 14.0)
ROUND = Capsule((0, 0, 0), 1.0, (1, 0, 0), 2.0)


def one(shape: Shape) -> Scene:
    return Scene("s", (Object("thing", shape, HERE),))


def made_of(material: Material) -> Scene:
    return Scene("s", (replace(BALL, material=material),))


def placed(pose: Pose) -> Scene:
    return Scene("s", (replace(BALL, camera_from_object=pose),))


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (Scene("s", ()), "scene 's' must have an object, got none"),
        (Scene("s", (BALL, BALL)), "names must differ, got 'ball' twice"),
        (Scene("s", (BALL,), posed="bal"), r"one of the objects \(ball\), got 'bal'"),
        (Scene("s", (BALL,), poses=(HERE,)), "poses must come with posed"),
        (one(Sphere(0.0)), "thing.radius_mm must be above 0 and finite"),
        (one(Sphere(math.nan)), "thing.radius_mm must be above 0"),
        (one(Cylinder(1.0, -1.0)), "thing: radius and length must be above 0"),
        (one(Cone(1.0, math.inf)), "thing: radius and height must be above 0 and finite"),
        (one(Box((1.0, 0.0, 1.0))), "thing.size_mm must be above 0"),
        (one(Plane(width_mm=0.0)), "thing.width_mm must be above 0, got 0"),
        (one(Blend(())), "thing.capsules must be one or more"),
        (one(Blend((ROUND,), smooth_mm=-1.0)), "thing.smooth_mm must be 0 or above"),
        (one(Blend((replace(ROUND, end_radius_mm=0.0),))), r"capsules\[0\]: radii must be above 0"),
        (one(Blend((replace(ROUND, end_mm=(0, 0, math.nan)),))), "ends must be finite"),
        (one(replace(BOARD, columns=1)), "thing.columns must be 2 inner corners or more, got 1"),
        (one(replace(BOARD, square_mm=0.0)), "thing.square_mm must be above 0"),
        (one(replace(BOARD, margin_mm=-1.0)), "thing.margin_mm must be 0 or above"),
        (one(replace(BOARD, print_sigma_mm=5.0)), "at most a tenth square"),
        (one(replace(BOARD, print_scale=(0.0, 0.7))), "thing.print_scale must be"),
        (one(replace(BOARD, bow_mm=(math.nan, 0.0))), "thing.bow_mm must be finite"),
        (one(replace(BOARD, kind="charuco")), "marker_mm must be above 0"),
        (one(Mesh(np.zeros((3, 3)), np.zeros((0, 3), int), "a.stl")), "a.stl must have faces"),
        (made_of(Material(albedo=1.2)), "ball.albedo must be 0 to 1, got 1.2"),
        (made_of(Material(albedo=0.8, gloss=0.3)), r"albedo \+ gloss must be at most 1, got 1.1"),
        (made_of(Material(gloss_exponent=0.0)), "gloss_exponent must be above 0"),
        (placed(Pose(2 * np.eye(3), np.zeros(3))), "rotation must be a rotation matrix"),
        (placed(Pose(np.diag([1.0, 1, -1]), np.zeros(3))), "must be a rotation matrix"),
        (placed(Pose(np.eye(3), np.array([0, 0, np.nan]))), "translation must be finite"),
        (Scene("s", (replace(BALL, velocity_mm_s=(math.inf, 0, 0)),)), "velocity_mm_s must be"),
    ],
)
def test_scenes_that_cannot_be(scene: Scene, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        check_scene(scene)


def test_sound_scenes_pass() -> None:
    shapes: list[Shape] = [Sphere(1.0), Plane(), Box((1, 2, 3)), BOARD, Blend((ROUND,)), Cone(1, 2)]
    for shape in shapes:
        check_scene(one(shape))
    check_scene(Scene("s", (BALL,), posed="ball", poses=(HERE,)))


def camera(**changes: object) -> Effects:
    return Effects(camera=replace(CameraEffects(), **changes))  # type: ignore[arg-type]


def projector(**changes: object) -> Effects:
    return Effects(projector=replace(ProjectorEffects(), **changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        (camera(exposure_ms=0.0), "camera.exposure_ms must be above 0, got 0.0"),
        (camera(full_well_e=math.nan), "camera.full_well_e must be above 0, got nan"),
        (camera(read_noise_e=-1.0), "camera.read_noise_e must be 0 or above"),
        (camera(vignetting=1.5), "camera.vignetting must be a share"),
        (camera(bits=7), "camera.bits must be 8 to 16, got 7"),
        (camera(black_level=255.0), "camera.black_level must be below 255"),
        (projector(gamma=0.0), "projector.gamma must be above 0"),
        (projector(bits=17), "projector.bits must be 8 to 16, got 17"),
        (projector(lattice="hexagon"), "projector.lattice must be one of square, diamond, none"),
        (projector(response=((0.0, 0.0), (0.5, 0.6), (1.0, 0.5))), "both rising"),
        (projector(response=((0.0, 0.0),)), "two points or more"),
        (Effects(ambient=AmbientEffects(ripple=-0.1)), "ambient.ripple must be a share"),
        (Effects(frame_interval_ms=0.0), "frame_interval_ms must be above 0"),
        (Effects(samples=2), "samples must be 1, 4 or 16, got 2"),  # type: ignore[arg-type]
        (Effects(bounces=2), "bounces must be 0 or 1, got 2"),  # type: ignore[arg-type]
    ],
)
def test_effects_that_cannot_be(effects: Effects, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        check_effects(effects)


def test_sound_effects_pass() -> None:
    check_effects(Effects())
    check_effects(Effects.ideal())
    check_effects(Effects().without_noise())
    check_effects(projector(response=((0.0, 0.0), (0.5, 0.3), (1.0, 1.0))))
