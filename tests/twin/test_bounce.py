"""One bounce of light against the integrating sphere and sums over projector pixels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Camera, Lens, Rig
from fringeworks.twin.bounce import block_means, find_bounce
from fringeworks.twin.cast import Caster
from fringeworks.twin.effects import Effects
from fringeworks.twin.optics import optics_of
from fringeworks.twin.scene import Box, Material, Object, Plane, Scene, Sphere
from fringeworks.twin.stage import Stage
from tests.twin.pinholes import NO_NOISE, PROJECTOR, RIG, at, only, wall

EFFECTS = replace(Effects.ideal(), bounces=1)
FOCUS_MM = EFFECTS.projector.focus_mm

WIDE = replace(RIG, camera=Camera(101, 81, Lens(100.0, 100.0, 50.0, 40.0)))
"""With a camera that sees 53 degrees, the projector's light and what it does not light."""

WHITE = np.ones((PROJECTOR.height, PROJECTOR.width), np.float32)


def indirect(scene: Scene, light: np.ndarray = WHITE, rig: Rig = WIDE) -> np.ndarray:
    camera, projector = optics_of(rig)
    bounce = find_bounce(Caster(scene), camera, projector, effects=EFFECTS.projector)
    return bounce.gather(light, width=camera.width, height=camera.height)


def solid_angle(width: float, height: float) -> float:
    """Of a centred rectangle one focal length away."""
    a, b = width / 2, height / 2
    return 4 * math.asin(a * b / math.sqrt((1 + a * a) * (1 + b * b)))


def test_integrating_sphere() -> None:
    # Inside a sphere every point lights every other one alike, cos cos / (pi r^2) = 1 / (4 pi R^2):
    # irradiance is albedo x flux over its whole area, everywhere.
    scene = only(Sphere(900.0), at(30.0, 20.0, 100.0), Material(albedo=0.6))
    flux = FOCUS_MM**2 * solid_angle(201 / 500, 101 / 500)
    expected = 0.6 * flux / (4 * math.pi * 900**2)
    found = indirect(scene)
    # A disc of area S shows S / (pi r^2 + S) of itself, not S / pi r^2: of 576 patches that costs
    # the sum of S / (pi r^2 + S) / 576, up to 1.2 % among them and nothing away from them.
    np.testing.assert_allclose(found, expected, rtol=0.012)
    assert np.median(found) == pytest.approx(expected, rel=2e-3)


def test_blocks_of_light() -> None:
    scene = only(Sphere(900.0), at(0.0, 0.0, 100.0), Material(albedo=0.6))
    half = WHITE.copy()
    half[:, 101:] = 0
    half[:, 100] = 0.5
    # Rows and columns off the middle are seen under another angle, but both halves alike.
    assert indirect(scene, half).mean() == pytest.approx(indirect(scene).mean() / 2, rel=1e-2)
    np.testing.assert_allclose(block_means(np.full((50, 70), 0.25, np.float32)), 0.25)
    ramp = np.arange(240, dtype=np.float32)[:, None] * np.ones((1, 48), np.float32)
    np.testing.assert_allclose(block_means(ramp)[:, 0], 4.5 + 10 * np.arange(24))


def test_wall_lights_the_floor() -> None:
    # A wall at z = 800 and a floor at y = 120. The floor's irradiance is summed over projector
    # pixels of the upper half, whose light meets the wall alone.
    floor_pose = at(0.0, 120.0, 0.0, rotation_matrix(np.array([math.pi / 2, 0.0, 0.0])))
    floor = Object("floor", Plane(), floor_pose, Material(albedo=0.3))
    back = Object("wall", Plane(), at(0.0, 0.0, 800.0), Material(albedo=0.7))
    light = WHITE.copy()
    light[50:] = 0
    found = indirect(Scene("corner", (floor, back)), light)
    row, column = 64, 40  # looks down by 24 / 100: meets the floor at z = 500
    place = np.array([-10 / 100, 24 / 100, 1.0]) * 500
    v, u = np.mgrid[:50, :201].astype(float)
    ray = np.stack([(u - 100) / 500, (v - 50) / 500, np.ones_like(u)], axis=-1)
    angle = 1 / (500**2 * (ray**2).sum(axis=-1) ** 1.5)
    lit = np.array([100.0, 0.0, 0.0]) + 800 * ray
    to_floor = place - lit
    far = np.linalg.norm(to_floor, axis=-1)
    cosines = (-to_floor[..., 2] / far) * (to_floor[..., 1] / far)
    flux = 0.7 * FOCUS_MM**2 * angle
    expected = float((flux * cosines / (math.pi * far**2)).sum())
    # Bilinear over 8 px of the camera.
    assert found[row, column] == pytest.approx(expected, rel=0.02)


def test_one_wall_gets_nothing_from_itself() -> None:
    assert indirect(wall(700.0)).max() == 0


def test_a_screen_keeps_light_away() -> None:
    # Light above y = 0 passes over a screen that stands on the floor at z = 600 and meets the wall
    # at z = 800. From there to the floor at z = 500 it would have to cross the screen's plane at
    # y = 120 - (120 + 80) / 3 = 53 mm or lower down.
    floor_pose = at(0.0, 120.0, 0.0, rotation_matrix(np.array([math.pi / 2, 0.0, 0.0])))
    floor = Object("floor", Plane(), floor_pose)
    back = Object("wall", Plane(), at(0.0, 0.0, 800.0))
    screen = Object("screen", Box((4000.0, 120.0, 2.0)), at(0.0, 60.0, 600.0))
    light = WHITE.copy()
    light[50:] = 0
    assert indirect(Scene("free", (floor, back)), light)[64, 50] > 0
    assert indirect(Scene("screened", (floor, back, screen)), light)[64, 50] == 0


def test_faces_of_one_object_are_kept_apart() -> None:
    # A box on its edge, x = 0, shows the camera two faces. The wall at x = 160 is lit beyond
    # z = 500, where it is seen from the right face alone: pixels 50 to 60, the left has 40 to 50.
    eighth = rotation_matrix(np.array([0.0, math.pi / 4, 0.0]))
    quarter = rotation_matrix(np.array([0.0, math.pi / 2, 0.0]))
    box = Object("box", Box((100.0, 400.0, 100.0)), at(0.0, 0.0, 700.0, eighth))
    side = Object("side", Plane(), at(160.0, 0.0, 0.0, quarter))
    light = WHITE.copy()
    light[:, :100] = light[:, 159:] = 0
    found = indirect(Scene("edge", (box, side)), light)[40]
    # Receivers of the other face count for a thousandth.
    assert found[42:50].max() < 2e-3 * found[51:58].min()


def test_the_camera_sees_the_bounce() -> None:
    scene = only(Sphere(900.0), at(0.0, 0.0, 100.0), Material(albedo=0.6))
    image = np.full((101, 201), 65535, np.uint16)
    frames = [
        Stage(scene, WIDE, effects).expose(image, rng=NO_NOISE).astype(np.float64)
        for effects in (EFFECTS, Effects.ideal())
    ]
    gained = (frames[0] - frames[1]) / 65535
    # 0.08 / ms x 10 ms; seen again with the albedo.
    flux = FOCUS_MM**2 * solid_angle(201 / 500, 101 / 500)
    expected = 0.8 * 0.6 * 0.6 * flux / (4 * math.pi * 900**2)
    assert gained.mean() == pytest.approx(expected, rel=0.005)
    # As in the integrating sphere, and rounding to one of 62 grey levels.
    np.testing.assert_allclose(gained, expected, rtol=0.012 + 0.5 / 62)
