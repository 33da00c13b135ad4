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
from fringeworks.twin.texture import print_of

HERE = Pose.identity()
BALL = Object("ball", Sphere(1.0), HERE)
BOARD = Board(9, 6, 14.0)
CHARUCO = replace(BOARD, kind="charuco", marker_mm=10.0)
FAR = np.array([[0, 0, 0], [0, 2e6, 0], [1.0, 0, 0]])
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
        (one(Sphere(0.0)), r"thing.radius_mm must be 1e-06 to 1e\+06, got \(0.0,"),
        (one(Sphere(1e-300)), "thing.radius_mm must be 1e-06"),
        (one(Sphere(1e7)), "thing.radius_mm must be 1e-06"),
        (one(Sphere(math.nan)), "thing.radius_mm must be 1e-06 to"),
        (one(Cylinder(1.0, -1.0)), "thing: radius and length must be 1e-06"),
        (one(Cone(1.0, math.inf)), "thing: radius and height must be 1e-06"),
        (one(Box((1.0, 0.0, 1.0))), "thing.size_mm must be 1e-06"),
        (one(Plane(width_mm=0.0)), "thing.width_mm must be at least 1e-06, got 0"),
        (one(Blend(())), "thing.capsules must be one or more"),
        (one(Blend((ROUND,), smooth_mm=-1.0)), "thing.smooth_mm must be 0 to"),
        (one(Blend((replace(ROUND, end_radius_mm=0.0),))), r"capsules\[0\]: radii must be 1e-06"),
        (one(Blend((replace(ROUND, end_mm=(0, 0, math.nan)),))), r"ends must be -1e\+06 to 1e\+06"),
        (one(replace(BOARD, columns=1)), "thing.columns must be 2 inner corners or more, got 1"),
        (one(replace(BOARD, square_mm=0.0)), "thing.square_mm must be 1e-06"),
        (one(replace(BOARD, margin_mm=-1.0)), "thing.margin_mm must be 0 to"),
        (one(replace(BOARD, print_sigma_mm=5.0)), "at most a tenth square"),
        (one(replace(BOARD, print_scale=(0.0, 0.7))), "thing.print_scale must be"),
        (one(replace(BOARD, bow_mm=(math.nan, 0.0))), r"thing.bow_mm must be -1e\+06 to"),
        (one(replace(BOARD, kind="charuco")), "thing.marker_mm must be 4.2 to 13.86 on sq"),
        (one(replace(BOARD, kind="circles")), r"diameter_mm must be above 0 and below square_mm"),
        (one(replace(CHARUCO, marker_mm=1e-300)), "thing.marker_mm must be 4.2 to 13.86"),
        (one(replace(CHARUCO, marker_mm=13.99)), "thing.marker_mm must be 4.2 to 13.86"),
        (one(replace(BOARD, print_seed=10**4000)), "thing.print_seed must be 0 to 9223"),
        (
            one(Mesh(FAR, np.array([[0, 1, 2]]), "a.stl")),
            r"a.stl must .*1e\+06 mm, got 2e",
        ),
        (Scene("s", (replace(BALL, name="x" * 101),)), "name must be 1 to 100 printable char"),
        (Scene("s", (replace(BALL, name="a\x1b[2J"),)), r"printable characters, got 'a\\x1b"),
        (one(Mesh(np.zeros((3, 3)), np.zeros((0, 3), int), "a.stl")), "a.stl must have faces"),
        (made_of(Material(albedo=1.2)), "ball.albedo must be 0 to 1, got 1.2"),
        (made_of(Material(albedo=0.8, gloss=0.3)), r"albedo \+ gloss must be at most 1, got 1.1"),
        (made_of(Material(gloss_exponent=0.0)), "gloss_exponent must be above 0"),
        (made_of(Material(gloss_exponent=1e308)), r"above 0, at most 1e\+06, got 1e\+308"),
        (placed(Pose(2 * np.eye(3), np.zeros(3))), "rotation must be a rotation matrix"),
        (placed(Pose(np.diag([1.0, 1, -1]), np.zeros(3))), "must be a rotation matrix"),
        (placed(Pose(np.eye(3), np.array([0, 0, np.nan]))), r"translation must be -1e\+06 to"),
        (Scene("s", (replace(BALL, velocity_mm_s=(math.inf, 0, 0)),)), "velocity_mm_s must be"),
    ],
)
def test_scenes_that_cannot_be(scene: Scene, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        check_scene(scene)


def test_squares_of_any_size_are_drawn() -> None:
    """Only the markers' share of a square is OpenCV's to know, which draws in single precision."""
    small = replace(CHARUCO, square_mm=1.4e-5, marker_mm=1e-5)
    np.testing.assert_array_equal(print_of(small)[2], print_of(CHARUCO)[2])


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
        (camera(exposure_ms=0.0), "camera.exposure_ms must be 0.001 to 60000, got 0.0"),
        (camera(exposure_ms=1e-4), "camera.exposure_ms must be 0.001"),
        (camera(full_well_e=1e-300), "camera.full_well_e must be 1 to"),
        (camera(pixel_seed=10**4000), "camera.pixel_seed must be 0 to"),
        (projector(focus_mm=1e-3), "projector.focus_mm must be 1 to"),
        (projector(focus_mm=1e300), "projector.focus_mm must be 1 to"),
        (Effects(ambient=AmbientEffects(mains_hz=1e308)), "ambient.mains_hz must be 0 to"),
        (Effects(frame_interval_ms=1e308), "frame_interval_ms must be 0.001 to 60000"),
        (camera(full_well_e=math.nan), r"camera.full_well_e must be 1 to 1e\+15, got nan"),
        (camera(read_noise_e=-1.0), "camera.read_noise_e must be 0 to"),
        (camera(vignetting=1.5), "camera.vignetting must be a share"),
        (camera(bits=7), "camera.bits must be 8 to 16, got 7"),
        (camera(black_level=255.0), "camera.black_level must be below 255"),
        (projector(gamma=0.0), "projector.gamma must be 0.001 to"),
        (projector(bits=17), "projector.bits must be 8 to 16, got 17"),
        (projector(lattice="hexagon"), "projector.lattice must be one of square, diamond, none"),
        (projector(response=((0.0, 0.0), (0.5, 0.6), (1.0, 0.5))), "both rising"),
        (projector(response=((0.0, 0.0),)), "two points or more"),
        (Effects(ambient=AmbientEffects(ripple=-0.1)), "ambient.ripple must be a share"),
        (Effects(frame_interval_ms=0.0), "frame_interval_ms must be 0.001 to"),
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
