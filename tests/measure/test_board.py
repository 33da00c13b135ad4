"""A board's corners on its cloud: exact on exact clouds, robust on bad ones."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.geometry.lens import project
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.board import corner_spacing, fit_board, point_at
from fringeworks.model import Cloud
from tests.scenes import CAMERA, RIG, plane_points

COLUMNS, ROWS, PITCH = 6, 4, 20.0
TILT = rotation_matrix(np.array([0.3, -0.4, 0.1]))
CENTRE = np.array([-50.0, -30.0, 700.0])


def board() -> tuple[Cloud, NDArray[np.float64], NDArray[np.float64]]:
    """A tilted plane as cloud, the corners on it in px, and in mm."""
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(float)
    flat = np.stack([x * PITCH, y * PITCH, 0 * x], axis=-1).reshape(-1, 3)
    corners = flat @ TILT.T + CENTRE
    normal = TILT[:, 2]
    xyz = plane_points(RIG, (normal[0], normal[1], normal[2]), float(normal @ CENTRE))
    ones = np.ones(xyz.shape[:2], np.float32)
    return (
        Cloud(xyz.astype(np.float32), ones, ones, ones),
        project(corners, CAMERA.lens.vector),
        corners,
    )


def test_corners_of_an_exact_cloud() -> None:
    """float32 rounds 700 mm to 3e-5 mm; the lens' distortion bends rays by far less."""
    cloud, pixels, corners = board()
    spacing = corner_spacing(cloud, pixels, columns=COLUMNS, rows=ROWS)
    assert np.abs(spacing.corners_mm.reshape(-1, 3) - corners).max() < 2e-3
    assert spacing.along_x_mm.shape == (ROWS, COLUMNS - 1)
    assert spacing.along_y_mm.shape == (ROWS - 1, COLUMNS)
    assert spacing.mean_mm == pytest.approx(PITCH, abs=1e-3)
    assert spacing.sd_mm < 2e-3


def test_voids_and_wild_points_about_the_corners() -> None:
    """Dark squares are void, and a tenth of what is left is misread by 50 mm."""
    cloud, pixels, corners = board()
    rng = np.random.default_rng(3)
    xyz = cloud.xyz * rng.normal(1, 0.5 / 700, (*cloud.xyz.shape[:2], 1)).astype(np.float32)
    wild = rng.random(xyz.shape[:2]) < 0.1
    xyz[wild] *= np.float32(1 + 50 / 700)
    xyz[rng.random(xyz.shape[:2]) < 0.5] = np.nan
    spoilt = Cloud(xyz, cloud.sigma_mm, cloud.intensity, cloud.epipolar_px)
    spacing = corner_spacing(spoilt, pixels, columns=COLUMNS, rows=ROWS)
    assert spacing.mean_mm == pytest.approx(PITCH, abs=0.05)
    assert np.abs(spacing.corners_mm.reshape(-1, 3) - corners).max() < 0.3


def test_the_plane_of_a_board_is_as_rough_as_the_cloud_predicts() -> None:
    cloud, pixels, _ = board()
    rng = np.random.default_rng(2)
    sigma = np.float32(0.5)
    scale = 1 + rng.normal(0, sigma, cloud.sigma_mm.shape) / cloud.xyz[..., 2]
    rough = Cloud(
        (cloud.xyz * scale[..., None]).astype(np.float32),
        np.full_like(cloud.sigma_mm, sigma),
        cloud.intensity,
        cloud.epipolar_px,
    )
    plane = fit_board(rough, pixels, columns=COLUMNS, rows=ROWS)
    across = abs(float(TILT[:, 2] @ CENTRE)) / 700
    assert plane.predicted_rms_mm == pytest.approx(0.5 * across, rel=0.1)
    tolerance = 5 / np.sqrt(2 * len(plane.fit.deviations_mm))
    assert plane.fit.form_rms_mm == pytest.approx(plane.predicted_rms_mm, rel=tolerance)


def test_a_corner_outside_the_cloud_has_no_point() -> None:
    cloud, pixels, _ = board()
    pixels[0] = (-500.0, 20.0)
    spacing = corner_spacing(cloud, pixels, columns=COLUMNS, rows=ROWS)
    assert np.isnan(spacing.corners_mm[0, 0]).all()
    assert len(spacing.all_mm) == ROWS * (COLUMNS - 1) + COLUMNS * (ROWS - 1) - 2
    assert spacing.mean_mm == pytest.approx(PITCH, abs=1e-3)
    assert np.isnan(point_at(cloud, np.array([1e6, 1e6]), radius=5.0)).all()


def test_what_cannot_be_measured() -> None:
    cloud, pixels, _ = board()
    with pytest.raises(ShapeError, match=r"corners_px must be \(24, 2\), got \(23, 2\)"):
        corner_spacing(cloud, pixels[1:], columns=COLUMNS, rows=ROWS)
    with pytest.raises(ShapeError, match="corners_px must be"):
        fit_board(cloud, pixels[1:], columns=COLUMNS, rows=ROWS)
    void = Cloud(cloud.xyz * np.float32(np.nan), cloud.sigma_mm, cloud.intensity, cloud.sigma_mm)
    with pytest.raises(MeasurementError, match="only 0 pairs of neighbouring corners"):
        corner_spacing(void, pixels, columns=COLUMNS, rows=ROWS)
    with pytest.raises(MeasurementError, match="a plane needs at least 3 points"):
        fit_board(void, pixels, columns=COLUMNS, rows=ROWS)
