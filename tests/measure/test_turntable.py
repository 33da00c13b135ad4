"""A turntable's axis from corners on circles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.turntable import find_axis, turn_frame

Z = np.array([0.05, -0.9, -0.3]) / np.linalg.norm([0.05, -0.9, -0.3])
CENTRE = np.array([10.0, 40.0, 700.0])
TURNS = np.deg2rad([0.0, 25.0, 60.0, 100.0, -50.0])


def corners(sd: float = 0.0) -> NDArray[np.float64]:
    """``(5, 88, 3)`` of a board that stands askew on the table."""
    x, y = np.meshgrid(np.arange(11) * 13.0 - 60, np.arange(8) * 13.0 - 90)
    board = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    first = board @ rotation_matrix(np.array([0.2, 0.3, 0.1])).T + CENTRE
    rng = np.random.default_rng(3)
    turned = [(first - CENTRE) @ rotation_matrix(t * Z).T + CENTRE for t in TURNS]
    return np.array(turned) + rng.normal(0, sd, (5, 88, 3))


def test_the_axis_is_found() -> None:
    points = corners()
    points[1, 5] = np.nan
    found = find_axis(points)
    assert found.corners == 87
    assert found.rms_mm < 1e-9
    pose = found.table.frame_from_camera
    np.testing.assert_allclose(pose.rotation[2], Z, atol=1e-12)
    np.testing.assert_allclose(pose.apply(CENTRE)[:2], 0, atol=1e-9)
    np.testing.assert_allclose(found.angles_rad, TURNS, atol=1e-12)
    assert np.linalg.det(pose.rotation) == pytest.approx(1)
    # the table's x looks at the camera
    assert pose.apply(np.zeros(3))[0] > 0
    assert pose.apply(np.zeros(3))[1] == pytest.approx(0, abs=1e-9)


def test_turned_frames_bring_all_views_together() -> None:
    points = corners()
    found = find_axis(points)
    together = [
        turn_frame(found.table, angle).frame_from_camera.apply(view)
        for angle, view in zip(found.angles_rad, points, strict=True)
    ]
    for view in together[1:]:
        np.testing.assert_allclose(view, together[0], atol=1e-9)


def test_noise_is_left_over() -> None:
    """0.03 mm an axis; means take one of five views, axis and angles 8 of 1320 coordinates."""
    found = find_axis(corners(0.03))
    freedom = (4 * 88 * 3 - 8) / (5 * 88)
    assert found.rms_mm == pytest.approx(0.03 * np.sqrt(freedom), rel=5 / np.sqrt(2 * 1048))
    along = found.table.frame_from_camera.rotation[2]
    assert np.linalg.norm(np.cross(along, Z)) < 1e-3
    assert np.linalg.norm(found.table.frame_from_camera.apply(CENTRE)[:2]) < 0.03


def test_refusals() -> None:
    with pytest.raises(ShapeError, match=r"must be \(views, n, 3\), got \(88, 3\)"):
        find_axis(corners()[0])
    with pytest.raises(MeasurementError, match=r"needs 3 views .*, got 2 with 88"):
        find_axis(corners()[:2])
    with pytest.raises(MeasurementError, match="hardly turns between the views"):
        find_axis(np.repeat(corners(1e-6)[:1], 4, axis=0) + np.arange(4)[:, None, None])
