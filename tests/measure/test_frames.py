"""Frames from datum points and boards, and clouds moved between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.frames import find_datum, find_station, fit_frame, move_cloud, to_camera
from fringeworks.measure.grid_mesh import cloud_normals, mesh_cloud
from fringeworks.measure.region import Region
from fringeworks.model import Pose
from fringeworks.model.frame import Frame
from tests.measure.test_reference import plane_cloud

POSE = Pose(rotation_matrix(np.array([0.3, -0.2, 1.0])), np.array([5.0, -7.0, 11.0]))


def test_three_two_one() -> None:
    """A plane z = 700 seen from the origin: its normal is -z, x as told, y = z cross x."""
    plane = np.array([[0.0, 0, 700], [100, 0, 700], [0, 100, 700], [100, 100, 700]])
    line = np.array([[10.0, 20, 690], [60, 20, 705]])  # heights over the plane do not count
    frame = find_datum(plane, line, np.array([15.0, 33, 720]))
    pose = frame.frame_from_camera
    np.testing.assert_allclose(pose.rotation, [[1, 0, 0], [0, -1, 0], [0, 0, -1]], atol=1e-12)
    np.testing.assert_allclose(pose.apply(np.array([15.0, 20, 700])), 0, atol=1e-9)
    np.testing.assert_allclose(pose.apply(np.array([16.0, 18, 697])), [1, 2, 3], atol=1e-9)
    turned = find_datum(plane, line[::-1], np.zeros(3))
    np.testing.assert_allclose(turned.frame_from_camera.rotation[0], [-1, 0, 0], atol=1e-12)


def test_what_is_no_datum() -> None:
    plane = np.array([[0.0, 0, 700], [100, 0, 700], [0, 100, 700]])
    with pytest.raises(MeasurementError, match="line has no length in the plane"):
        find_datum(plane, np.array([[5.0, 5, 600], [5, 5, 650]]), np.zeros(3))
    with pytest.raises(MeasurementError, match="on one line"):
        find_datum(plane[[0, 0, 1]], plane[:2], np.zeros(3))
    with pytest.raises(ShapeError, match="line must be"):
        find_datum(plane, plane[:1], np.zeros(3))
    with pytest.raises(MeasurementError, match="no finite point"):
        find_datum(plane, plane[:2], np.full(3, np.nan))


def test_a_station_from_pixels_of_a_cloud() -> None:
    """The slope x / 2 towards the camera: pixel (u, v) shows (u - 10, v - 10, ...)."""
    frame = find_station(
        plane_cloud(), Region(), line_px=[(6.0, 10.0), (14.0, 10.0)], origin_px=(10.0, 12.0)
    )
    pose = frame.frame_from_camera
    # a pick is exact for a pinhole's pixels, and these are a millimetre apart everywhere
    np.testing.assert_allclose(pose.apply(np.array([0.0, 0, 500])), 0, atol=0.02)
    np.testing.assert_allclose(pose.rotation[0], np.array([1, 0, -0.5]) / 1.25**0.5, atol=1e-4)
    with pytest.raises(MeasurementError, match="no surface about pixel 90,90"):
        find_station(plane_cloud(), Region(), line_px=[(6, 10), (90, 90)], origin_px=(6, 6))


def test_there_and_back() -> None:
    cloud = plane_cloud()
    moved = move_cloud(cloud, Frame("station", POSE))
    assert moved.frame == "station"
    np.testing.assert_allclose(moved.points(), POSE.apply(cloud.points()), atol=1e-4)
    np.testing.assert_allclose(moved.seen_from_camera(), cloud.xyz, atol=1e-4)
    back = to_camera(moved)
    assert (back.frame, back.frame_from_camera) == ("camera", None)
    np.testing.assert_allclose(back.xyz, cloud.xyz, atol=1e-4)
    again = move_cloud(moved, Frame("other", Pose.identity()))
    np.testing.assert_allclose(again.xyz, cloud.xyz, atol=1e-4)
    with pytest.raises(UsageError, match="frame 'elsewhere', and where the camera stood"):
        to_camera(replace(cloud, frame="elsewhere"))


def test_a_moved_cloud_has_the_same_surface() -> None:
    """Which pixels hang together is asked of the camera, wherever the frame is."""
    cloud = plane_cloud()
    moved = move_cloud(cloud, Frame("station", POSE))
    assert len(mesh_cloud(moved).faces) == len(mesh_cloud(cloud).faces) == 800
    turned = cloud_normals(cloud) @ POSE.rotation.T
    np.testing.assert_allclose(cloud_normals(moved), turned, atol=1e-3)


def test_a_board_gives_its_frame() -> None:
    nominal = np.array([[x, y, 0.0] for y in range(3) for x in range(4)]) * 13
    frame, left = fit_frame(POSE.inverse().apply(nominal), nominal, name="board")
    assert frame.name == "board"
    np.testing.assert_allclose(frame.frame_from_camera.rotation, POSE.rotation, atol=1e-12)
    np.testing.assert_allclose(left, 0, atol=1e-9)
