"""Truth by hand: a wall, a ball before it, and what the projector cannot reach."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fringeworks.errors import UsageError
from fringeworks.model import Pose
from fringeworks.twin.cast import Caster
from fringeworks.twin.check import check_view
from fringeworks.twin.optics import Optics
from fringeworks.twin.scene import Object, Plane, Scene, Sphere
from fringeworks.twin.truth import Truth, find_truth
from tests.twin.views import (
    CAMERA,
    PROJECTOR,
    PROJECTOR_MM,
    every_pixel,
    pose,
    rays_by_opencv,
)

SMALL = replace(CAMERA, height=120)
WALL = Object("wall", Plane(), pose((0.1, -0.2, 0.0), (0.0, 0.0, 700.0)))
BALL = Object("ball", Sphere(30.0), pose((0.0, 0.0, 0.0), (0.0, -50.0, 600.0)))


def truth_of(*things: Object, projector: Optics = PROJECTOR) -> Truth:
    return find_truth(Caster(Scene("test", things)), SMALL, projector)


def test_a_wall_by_closed_form() -> None:
    truth = truth_of(WALL)
    rays = rays_by_opencv(SMALL, every_pixel(SMALL))
    place = WALL.camera_from_object
    normal = place.rotation[:, 2]
    distance = (place.translation_mm @ normal) / (rays @ normal)
    # OpenCV's undistortion stops at 1e-12 of the image plane: 1e-9 mm here.
    points = (rays * distance[:, None]).reshape(truth.xyz.shape)
    np.testing.assert_allclose(truth.xyz, points, rtol=0, atol=1e-8)
    assert (truth.surface == 0).all()
    assert truth.names == ("wall",)


def test_projector_coordinates_are_opencvs() -> None:
    truth = truth_of(WALL, BALL)
    lens, place = PROJECTOR.lens, PROJECTOR.device_from_camera
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    terms = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    lit = np.isfinite(truth.column)
    assert (lit == np.isfinite(truth.row)).all()
    turn = cv2.Rodrigues(place.rotation)[0]
    asked, _ = cv2.projectPoints(truth.xyz[lit], turn, place.translation_mm, matrix, terms)
    np.testing.assert_allclose(truth.column[lit], asked[:, 0, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(truth.row[lit], asked[:, 0, 1], rtol=0, atol=1e-9)
    assert (np.abs(asked[:, 0, 0] - 303.5) <= 304).all()
    assert (np.abs(asked[:, 0, 1] - 341.5) <= 342).all()


def test_shadow_and_far_side_are_dark() -> None:
    truth, free = truth_of(WALL, BALL), truth_of(WALL)
    centre = BALL.camera_from_object.translation_mm
    projector = PROJECTOR_MM
    way = truth.xyz - projector
    gap = np.linalg.norm(np.cross(way, centre - projector), axis=-1) / np.linalg.norm(way, axis=-1)
    wall = (truth.surface == 0) & np.isfinite(free.column)
    np.testing.assert_array_equal(np.isfinite(truth.column[wall]), gap[wall] > 30)
    facing = np.einsum("ijk,ijk->ij", truth.xyz - centre, -way) > 0
    ball = truth.surface == 1
    inside = PROJECTOR.inside(PROJECTOR.pixels(truth.xyz.reshape(-1, 3))).reshape(ball.shape)
    np.testing.assert_array_equal(np.isfinite(truth.column[ball]), (facing & inside)[ball])
    assert (~facing[ball]).sum() > 100
    assert (gap[wall] < 30).sum() > 1000


def test_a_sheet_is_lit_only_on_the_side_that_is_seen() -> None:
    # A sheet on edge between the two devices: each sees its own side, and nothing is in the way.
    sheet = Object("sheet", Plane(200.0, 200.0), pose((0.0, 1.45, 0.0), (30.0, 0.0, 650.0)))
    normal = sheet.camera_from_object.rotation[:, 2]
    sides = [(end - [30.0, 0, 650]) @ normal for end in (np.zeros(3), PROJECTOR_MM)]
    assert sides[0] * sides[1] < 0
    truth = truth_of(sheet)
    assert (truth.surface == 0).sum() > 1000
    points = truth.xyz[truth.surface == 0]
    assert PROJECTOR.inside(PROJECTOR.pixels(points)).any()
    assert np.isnan(truth.column).all()


def test_nothing_met_is_nan() -> None:
    truth = truth_of(BALL)
    void = truth.surface == -1
    assert void.any()
    assert np.isnan(truth.xyz[void]).all()
    assert np.isnan(truth.column[void]).all()
    assert np.isfinite(truth.xyz[~void]).all()


def test_a_wandering_pupil_is_in_the_truth() -> None:
    shifted = replace(PROJECTOR, pupil_shift_mm=2.0)
    one, other = truth_of(WALL), truth_of(WALL, projector=shifted)
    both = np.isfinite(one.column) & np.isfinite(other.column)
    moved = np.abs(one.row - other.row)[both]
    # At r = 0.3 the ray starts 2 r^2 = 0.18 mm further on: f r 0.18 / 700 = 0.15 rows at most.
    assert 0.02 < moved.max() < 0.15
    points = other.xyz[both]
    pixels = np.stack([other.column[both], other.row[both]], axis=-1)
    origins, directions = shifted.rays(pixels)
    gap = np.linalg.norm(np.cross(points - origins, directions), axis=-1)
    assert gap.max() < 1e-9


def test_a_scene_outside_the_view() -> None:
    away = replace(BALL, camera_from_object=pose((0, 0, 0), (0.0, 0.0, -600.0)))
    with pytest.raises(
        UsageError, match=r"scene 'away': the camera sees nothing of it \(ball\).*position_mm"
    ):
        check_view(truth_of(away), scene="away")


def test_a_projector_that_points_away() -> None:
    turned = replace(PROJECTOR, device_from_camera=Pose(np.diag([-1.0, 1, -1]), np.zeros(3)))
    with pytest.raises(
        UsageError,
        match=r"scene 's': the projector lights nothing.*the rig points away.*device_from_rig",
    ):
        check_view(truth_of(WALL, projector=turned), scene="s")


def test_a_sound_view_passes() -> None:
    check_view(truth_of(WALL, BALL), scene="s")
