"""The twin's devices against OpenCV and by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from fringeworks.errors import UsageError
from fringeworks.model import Camera, Lens, Pose, Projector, Rig
from fringeworks.twin.optics import Optics, optics_of
from tests.twin.views import PROJECTOR, every_pixel, pose

RICH = replace(PROJECTOR, rational=(0.2, -0.1, 0.05))
ROUNDING_PX = 1e-9


def points_before(optics: Optics, *, count: int = 500) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Points in the camera's frame that stand before a device, within 0.4 of its axis."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.4, 0.4, (2, count))
    z = rng.uniform(300, 900, count)
    return optics.device_from_camera.inverse().apply(np.stack([x * z, y * z, z], axis=-1))


@pytest.mark.parametrize("optics", [PROJECTOR, RICH])
def test_projection_is_opencvs(optics: Optics) -> None:
    lens, place = optics.lens, optics.device_from_camera
    points = points_before(optics)
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    terms = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3, *optics.rational])
    turn = cv2.Rodrigues(place.rotation)[0]
    asked, _ = cv2.projectPoints(points, turn, place.translation_mm, matrix, terms)
    np.testing.assert_allclose(optics.pixels(points), asked.reshape(-1, 2), rtol=0, atol=1e-9)


@pytest.mark.parametrize("shift", [0.0, 2.5, -2.5])
@pytest.mark.parametrize("optics", [PROJECTOR, RICH])
def test_rays_and_pixels_are_inverse(optics: Optics, shift: float) -> None:
    optics = replace(optics, pupil_shift_mm=shift)
    pixels = every_pixel(optics, step=7.0)
    origins, directions = optics.rays(pixels)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, rtol=0, atol=1e-14)
    for distance in (200.0, 650.0, 5000.0):
        points = origins + distance * directions
        np.testing.assert_allclose(optics.pixels(points), pixels, rtol=0, atol=ROUNDING_PX)
        np.testing.assert_allclose(optics.origins_of(points), origins, rtol=0, atol=1e-10)


def test_a_wandering_pupil_by_hand() -> None:
    # Without distortion the pixel (100, 50) of f = 100 about (0, 0) has x = 1, y = 1/2, r2 = 5/4.
    optics = Optics(200, 100, Lens(100, 100, 0, 0), pupil_shift_mm=4.0)
    origins, directions = optics.rays(np.array([[100.0, 50.0]]))
    np.testing.assert_allclose(origins, [[0, 0, 5.0]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(directions, np.array([[1, 0.5, 1]]) / 1.5, rtol=0, atol=1e-12)


def test_places_are_in_the_cameras_frame() -> None:
    place = pose((0.0, np.pi / 2, 0.0), (0.0, 0.0, 30.0))  # x_device = z, z_device = 30 - x
    optics = Optics(11, 11, Lens(100, 100, 5, 5), device_from_camera=place)
    origins, directions = optics.rays(np.array([[5.0, 5.0]]))
    np.testing.assert_allclose(origins, [[30, 0, 0]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(directions, [[-1, 0, 0]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(optics.depths(np.array([[10.0, 3.0, 7.0]])), [20], atol=1e-12)


def test_what_cannot_be_seen_is_nan() -> None:
    optics = Optics(100, 100, Lens(100, 100, 50, 50, k1=-0.3))
    # r (1 - 0.3 r^2) rises to r = sqrt(1 / 0.9) = 1.054, where it is 0.703.
    points = np.array([[0, 0, -1.0], [0, 0, 0], [1.05, 0, 1], [1.06, 0, 1], [np.nan, 0, 1]])
    seen = np.isfinite(optics.pixels(points)).all(axis=1)
    assert seen.tolist() == [False, False, True, False, False]
    _, directions = optics.rays(np.array([[50 + 70.2, 50], [50 + 70.4, 50]]))
    assert np.isfinite(directions).all(axis=1).tolist() == [True, False]


def test_a_pole_of_the_rational_terms_is_the_end() -> None:
    optics = Optics(100, 100, Lens(100, 100, 50, 50), rational=(-1.0, 0.0, 0.0))  # pole at r = 1
    points = np.array([[0.99, 0, 1], [1.01, 0, 1]])
    assert np.isfinite(optics.pixels(points)).all(axis=1).tolist() == [True, False]


def test_inside_includes_half_a_pixel_around() -> None:
    optics = Optics(4, 3, Lens(1, 1, 0, 0))
    pixels = np.array([[-0.5, 0], [3.5, 2.5], [-0.51, 0], [3, 2.51], [np.nan, 1]])
    assert optics.inside(pixels).tolist() == [True, True, False, False, False]


def rig(twin: object) -> Rig:
    lens = Lens(100, 100, 5, 5)
    return Rig(Camera(10, 8, lens), Projector(6, 4, lens), Pose.identity(), further={"twin": twin})


def test_optics_of_a_rig() -> None:
    camera, projector = optics_of(rig({"projector": {"k5": 0.25, "pupil_shift_mm": 1}}))
    assert (camera.width, camera.height, camera.rational) == (10, 8, (0, 0, 0))
    assert (projector.width, projector.height, projector.rational) == (6, 4, (0, 0.25, 0))
    assert (camera.pupil_shift_mm, projector.pupil_shift_mm) == (0, 1)


@pytest.mark.parametrize(
    ("twin", "words"),
    [
        ({"camara": {}}, "rig.twin must have keys of camera, projector, got camara"),
        ({"camera": {"k7": 1.0}}, "rig.twin.camera must have keys of k4.*got k7"),
        ({"camera": {"k4": "x"}}, "rig.twin.camera.k4 must be a finite number, got 'x'"),
        ({"projector": {"k4": np.nan}}, "rig.twin.projector.k4 must be a finite number, got nan"),
        ({"projector": {"k6": 1e308}}, r"rig.twin.projector.k6 must be -1e\+06 to 1e\+06"),
        ([1], "rig.twin must be a table, got list"),
    ],
)
def test_what_a_rig_may_not_say(twin: object, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        optics_of(rig(twin))


LENS = Lens(100, 100, 5, 5)


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        (Camera(65536, 65536, LENS), "camera must have at most 89478485 pixels .* 65536x65536"),
        (Camera(10, 8, replace(LENS, fx=1e-300)), r"camera.fx must be 1 to 1e\+06 px, got 1e-300"),
        (Camera(10, 8, replace(LENS, fy=np.inf)), "camera.fy must be 1 to"),
        (Camera(10, 8, replace(LENS, k3=1e300)), r"camera.k3 must be -1e\+06 to 1e\+06"),
    ],
)
def test_devices_that_cannot_be_simulated(camera: Camera, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        optics_of(replace(rig({}), camera=camera))


@pytest.mark.parametrize("terms", [{"k4": 1e-320}, {"k6": 1e-310, "k4": -1e-320}, {}])
def test_terms_of_next_to_nothing_are_none(terms: dict[str, float]) -> None:
    camera = Camera(10, 8, replace(LENS, k1=-0.1, k3=1e-310))
    optics, _ = optics_of(replace(rig({"camera": terms}), camera=camera))
    plain = replace(optics, lens=replace(LENS, k1=-0.1), rational=(0.0, 0.0, 0.0))
    points = np.array([[10.0, 20.0, 100.0], [3e3, 0.0, 1e3]])  # the second beyond the fold
    np.testing.assert_array_equal(optics.pixels(points), plain.pixels(points))
    assert np.isfinite(plain.pixels(points)[:, 0]).tolist() == [True, False]
