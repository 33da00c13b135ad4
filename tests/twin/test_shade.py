"""Gains against hand-written optics, and rendered phase against the truth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Axis, Camera, Frames, Rig
from fringeworks.patterns import equal_shifts
from fringeworks.twin.cast import Caster
from fringeworks.twin.effects import CameraEffects, Effects, ProjectorEffects
from fringeworks.twin.optics import optics_of
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
    Shape,
    Sphere,
)
from fringeworks.twin.scenes import paper_rig, place, warped_rig
from fringeworks.twin.shade import View, find_view, spread_rays, vignetting
from fringeworks.twin.stage import Stage
from tests.twin.pinholes import NO_NOISE, RIG, at, only, wall

Array = NDArray[np.float64]

IDEAL = Effects.ideal()


def look(scene: Scene, effects: Effects = IDEAL, rig: Rig = RIG) -> View:
    camera, projector = optics_of(rig)
    return find_view(Caster(scene), camera, projector, effects=effects)


# Rays


@pytest.mark.parametrize("count", [1, 4, 16])
def test_rays_stand_like_rooks(count: int) -> None:
    places = spread_rays(count)
    lines = np.sort((places + 0.5) * count - 0.5, axis=0)
    np.testing.assert_allclose(lines, np.arange(count)[:, None] * [1, 1], atol=1e-12)
    np.testing.assert_allclose(places.T @ places / count, np.eye(2) * places[:, 0].var())


# Gains by hand


def test_gain_of_a_facing_wall() -> None:
    # Pixel (70, 30) sees (10, -5, 500); the projector at (100, 0, 0) sees it at (10, 45) px,
    # d^2 = 90^2 + 5^2 + 500^2 = 258125 mm^2 away, under a cosine of 500 / d.
    effects = replace(IDEAL, projector=replace(IDEAL.projector, focus_mm=600.0))
    column, row, _, gain = look(wall(500.0, albedo=0.8), effects).samples[30, 70]
    assert (column, row) == pytest.approx((10, 45), abs=1e-5)
    assert gain == pytest.approx(0.8 * 500 / math.sqrt(258125) * 600**2 / 258125, rel=1e-6)


@pytest.mark.parametrize("degrees", [-40.0, 0.0, 25.0, 60.0])
@pytest.mark.parametrize("z", [600.0, 800.0])
def test_irradiance_falls_as_cosine_over_squared_distance(degrees: float, z: float) -> None:
    turn = rotation_matrix(np.array([0.0, math.radians(degrees), 0.0]))
    view = look(only(Plane(), at(0.0, 0.0, z, turn)))
    normal = -turn[:, 2]  # towards the rig
    rows, columns = np.mgrid[:81, :101]
    rays = np.stack([(columns - 50) / 1000, (rows - 40) / 1000, np.ones(rows.shape)], axis=-1)
    points = rays * (z * normal[2] / (rays @ normal))[..., None]
    to_light = np.array([100.0, 0.0, 0.0]) - points
    far = np.linalg.norm(to_light, axis=-1)
    expected = np.maximum(to_light @ normal / far, 0) * (650 / far) ** 2
    u = 500 * (points[..., 0] - 100) / points[..., 2] + 100
    expected[(u < -0.5) | (u > 200.5)] = 0
    assert (expected > 0).any()
    np.testing.assert_allclose(view.samples[:, :, 3], expected, rtol=1e-6)


def test_back_of_a_surface_is_dark() -> None:
    # Lit from x = 100 the plane x = 50 is, as seen by the camera, dark.
    turn = rotation_matrix(np.array([0.0, math.pi / 2, 0.0]))
    view = look(only(Plane(), at(5.0, 0.0, 0.0, turn)))
    assert (view.reflected > 0).any()
    assert (view.samples[..., 3] == 0).all()


def test_gloss_in_the_mirror_direction() -> None:
    # A wall facing halfway between camera and projector mirrors one into the other: the lobe's
    # full height, gloss (n + 2) / 2 = 0.2 x 26 = 5.2, on top of albedo 0.5. A distance z away
    # the angle to each is atan(50 / z) and the mirror stands at x = 50.
    material = Material(albedo=0.5, gloss=0.2, gloss_exponent=50.0)
    view = look(only(Plane(), at(0.0, 0.0, 1000.0), material))
    matt = look(only(Plane(), at(0.0, 0.0, 1000.0), Material(albedo=0.5)))
    factor = 0.5 * view.samples[40, :, 3] / matt.samples[40, :, 3]
    # Pixel 100 sees x = 50.
    assert factor[100] == pytest.approx(0.5 + 5.2, rel=1e-5)
    # Pixel 50 sees x = 0: mirrored about the normal the light from x = 100 goes to x = -100, an
    # angle atan(0.1) from the camera.
    lobe = 5.2 * math.cos(math.atan(0.1)) ** 50
    assert factor[50] == pytest.approx(0.5 + lobe, rel=1e-5)


def test_vignetting_by_hand() -> None:
    camera, _ = optics_of(RIG)  # 101 x 81 about (50, 40): corners at 50.5, 40.5
    corner2 = 50.5**2 + 40.5**2
    pixels = np.array([[50.0, 40.0], [100.5, 80.5], [-0.5, 80.5], [60.0, 40.0]])
    expected = [1, 0.75, 0.75, 1 - 0.25 * 100 / corner2]
    np.testing.assert_allclose(vignetting(pixels, camera, 0.25), expected, rtol=1e-12)


def test_both_vignettings_dim_the_light() -> None:
    plain, scene = look(wall(700.0)), wall(700.0)
    effects = replace(
        IDEAL,
        camera=replace(IDEAL.camera, vignetting=0.2),
        projector=replace(IDEAL.projector, vignetting=0.3),
    )
    dim = look(scene, effects)
    camera, projector = optics_of(RIG)
    expected = plain.samples[..., 3].ravel().astype(float)
    pixels = np.stack(np.meshgrid(np.arange(101.0), np.arange(81.0)), axis=-1).reshape(-1, 2)
    shown = plain.samples[:, :, :2].reshape(-1, 2).astype(float)
    expected = expected * vignetting(pixels, camera, 0.2) * vignetting(shown, projector, 0.3)
    np.testing.assert_allclose(dim.samples[..., 3].ravel(), expected, rtol=1e-5)
    np.testing.assert_allclose(dim.reflected.ravel(), vignetting(pixels, camera, 0.2), rtol=1e-6)


def test_shadow_of_a_sheet() -> None:
    # Light from (100, 0, 0) that passes the edges x = -10 and 10 of a sheet at z = 640 meets the
    # wall at z = 800 at -10 - 110 / 4 = -37.5 and 10 - 90 / 4 = -12.5 mm: pixels 3.1 and 34.4.
    # The sheet itself is seen from pixel 34.4 to 65.6.
    sheet = Object("sheet", Plane(20.0, 1000.0), at(0.0, 0.0, 640.0))
    both = Scene("test", (sheet, *wall(800.0).objects))
    gain = look(both).samples[40, :, 3]
    alone = look(wall(800.0)).samples[40, :, 3]
    assert (alone > 0).all()
    assert (gain[4:35] == 0).all()
    assert (gain[35:66] > alone[35:66]).all()  # nearer
    beside = np.r_[0:4, 66:101]
    np.testing.assert_array_equal(gain[beside], alone[beside])


def test_defocus_chooses_the_levels() -> None:
    effects = replace(IDEAL, projector=ProjectorEffects(blur_px=0.5, focus_mm=500.0))
    sharp = look(wall(500.0), effects)
    np.testing.assert_allclose(sharp.sigmas_px, [0.5])
    turn = rotation_matrix(np.array([0.0, 0.5, 0.0]))
    view = look(only(Plane(), at(0.0, 0.0, 600.0, turn)), effects)
    lit = view.samples[..., 3] > 0
    level = view.samples[..., 2][lit]
    found = np.interp(level, np.arange(len(view.sigmas_px)), view.sigmas_px**2)
    columns = np.nonzero(lit)[1]
    x, normal = (columns - 50) / 1000, turn[:, 2]
    z = 600 * normal[2] / (x * normal[0] + normal[2])
    expected = 0.5**2 + (3.2 * (1000 / z - 2)) ** 2
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_nothing_where_nothing_is() -> None:
    view = look(only(Sphere(10.0), at(0.0, 0.0, 600.0)))
    assert view.samples[0, 0, 3] == 0
    assert view.reflected[0, 0] == 0
    assert view.samples[40, 50, 3] > 0


# Rendered phase


PERIOD_PX, STEPS = 32.0, 8
EXPOSURE_MS = 14.0

SURFACES: dict[str, tuple[Shape, tuple[float, float, float], tuple[float, float, float]]] = {
    "plane": (Plane(), (0, 0, 680), (10, -20, 5)),
    "sphere": (Sphere(60.0), (5, 3, 690), (0, 0, 0)),
    "cylinder": (Cylinder(52.5, 130.0), (4, 2, 700), (90, 0, 10)),
    "cone": (Cone(50.0, 110.0), (0, 50, 680), (80, 0, 0)),
    "box": (Box((90.0, 70.0, 60.0)), (0, 5, 690), (25, 35, 10)),
    "blend": (
        Blend(
            (Capsule((-40, 0, 0), 25, (10, 10, 0), 15), Capsule((0, -30, 0), 15, (30, 30, 9), 9))
        ),
        (0, 0, 660),
        (0, 20, 0),
    ),
    "bowed board": (Board(11, 8, 13.0, bow_mm=(1.0, 2.0)), (-60, -40, 650), (10, 15, 4)),
}


def thumbnail(rig: Rig) -> Rig:
    """The rig with a camera of a sixth of the pixels on each axis, over the same view."""
    lens = rig.camera.lens
    small = replace(lens, fx=lens.fx / 6, fy=lens.fy / 6, cx=lens.cx / 6, cy=lens.cy / 6)
    return replace(rig, camera=Camera(126, 80, small))


def render_fringes(axis: Axis, rig: Rig) -> list[Frames]:
    """16-bit images of 8-step fringes, by hand."""
    width, height = rig.projector.width, rig.projector.height
    pixels = np.arange(width if axis == "x" else height)
    images: list[Frames] = []
    for shift in equal_shifts(STEPS):
        light = 0.5 + 0.5 * np.cos(2 * np.pi * (pixels + 0.5) / PERIOD_PX - shift)
        levels = np.round(light * 65535).astype(np.uint16)
        line = levels[None] if axis == "x" else levels[:, None]
        images.append(np.ascontiguousarray(np.broadcast_to(line, (height, width))))
    return images


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("lenses", ["distorted", "beyond five terms"])
@pytest.mark.parametrize("name", SURFACES)
def test_rendered_phase_is_the_true_coordinate(name: str, lenses: str, axis: Axis) -> None:
    rig = thumbnail(paper_rig() if lenses == "distorted" else warped_rig())
    shape, position, rotation = SURFACES[name]
    stage = Stage(only(shape, place(position, rotation)), rig, IDEAL)
    frames = [
        stage.expose(image, rng=NO_NOISE, exposure_ms=EXPOSURE_MS)
        for image in render_fringes(axis, rig)
    ]
    shifts = np.array(equal_shifts(STEPS))
    stack = np.stack(frames).astype(np.float64)
    sine, cosine = (np.tensordot(f(shifts), stack, 1) for f in (np.sin, np.cos))
    modulation = 2 / STEPS * np.hypot(sine, cosine)
    truth = stage.truth().column if axis == "x" else stage.truth().row
    # Dim pixels are left to rounding: 0.29 grey levels times sqrt(2 / 8) over a modulation of 4000
    # are 3.6e-5 rad, 1.8e-4 px; five of these sigmas stay below the bar of 1e-3 px.
    bright = (modulation > 4000) & (stack.max(axis=0) < 65535)
    off = np.angle(np.exp(1j * (np.arctan2(sine, cosine) - 2 * np.pi * (truth + 0.5) / PERIOD_PX)))
    error_px = off[bright] * PERIOD_PX / (2 * np.pi)
    assert np.count_nonzero(bright) > 1000
    assert np.isfinite(truth[bright]).all()
    assert np.abs(error_px).max() < 1e-3
    assert np.count_nonzero(np.isfinite(truth) & (modulation == 0)) == 0


def test_four_rays_average_the_pixel() -> None:
    camera = CameraEffects(bits=16, vignetting=0.0, blur_px=0.0)
    four = look(wall(600.0), replace(IDEAL, camera=camera, samples=4)).samples[..., 0]
    one = look(wall(600.0), replace(IDEAL, camera=camera)).samples[..., 0]
    height, width = one.shape
    pixels = four.reshape(height, 2, width, 2).swapaxes(1, 2).reshape(height, width, 4)
    np.testing.assert_allclose(pixels.mean(axis=2), one, atol=1e-4)
    # Pixel pitch 0.6 mm, projector 0.6 / 600 x 500 = 0.5 px: rays are 1/8 px apart.
    np.testing.assert_allclose(
        np.sort(pixels[40, 50]), 16.6667 + 0.125 * np.arange(-1.5, 2), atol=1e-3
    )
    # Each ray lies in its own quarter: the left ones left of the right ones.
    assert (pixels[..., ::2] < pixels[..., 1::2]).all()
