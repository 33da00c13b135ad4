"""The full model against points whose projections are known."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np
import pytest

from fringeworks.errors import DecodeError, ShapeError, UsageError
from fringeworks.model import Camera, ProjectorMap, Rig, Void
from fringeworks.reconstruct.full import CloudRules, triangulate
from tests.scenes import CAMERA, POSE, PROJECTOR, RIG, map_of, plane_points

TILTED = plane_points(RIG, (0.2, -0.1, -1.0), -650.0)
SHAPE = TILTED.shape[:2]
# Coordinates are float32: half a unit in the last place at 814 px is 3e-5 px. One px is worth
# 2.6 mm of depth along x and up to 290 mm along y, where this rig has hardly any baseline.
ROUNDING_PX = 3.1e-5
MM_PER_PX = {"x": 2.6, "y": 290.0, "xy": 2.6}


@pytest.mark.parametrize("axes", ["x", "y", "xy"])
def test_points_come_back_from_their_projections(axes: Literal["x", "y", "xy"]) -> None:
    cloud = triangulate(map_of(RIG, TILTED, axes=axes), RIG)
    assert cloud.valid.all()
    assert np.abs(cloud.xyz - TILTED).max() < 3 * ROUNDING_PX * MM_PER_PX[axes]
    assert cloud.frame == "camera"
    assert cloud.scale_sigma is None


def test_the_rigs_scale_is_the_clouds() -> None:
    rig = dataclasses.replace(RIG, scale_sigma=1.5e-4)
    assert triangulate(map_of(RIG, TILTED), rig).scale_sigma == 1.5e-4


@pytest.mark.parametrize("axes", ["x", "y", "xy"])
def test_predicted_sigma_is_the_observed_one(axes: Literal["x", "y", "xy"]) -> None:
    rng = np.random.default_rng(7)
    noise = rng.normal(0, 0.02, (*SHAPE, 2))
    cloud = triangulate(map_of(RIG, TILTED, axes=axes, noise=noise), RIG)
    ratio = np.std((cloud.xyz[..., 2] - TILTED[..., 2]) / cloud.sigma_mm)
    assert abs(ratio - 1) < 5 / np.sqrt(2 * TILTED[..., 0].size)


def test_two_axes_leave_one_residual_across_the_epipolar_line() -> None:
    rng = np.random.default_rng(8)
    noise = rng.normal(0, 0.02, (*SHAPE, 2))
    cloud = triangulate(map_of(RIG, TILTED, noise=noise), RIG)
    assert abs(cloud.epipolar_px.std() / 0.02 - 1) < 5 / np.sqrt(2 * TILTED[..., 0].size)
    assert np.isnan(triangulate(map_of(RIG, TILTED, axes="x"), RIG).epipolar_px).all()


def test_both_axes_weigh_by_their_sigma() -> None:
    exact = map_of(RIG, TILTED, sigma=0.02)
    assert exact.row is not None
    wrong_row = dataclasses.replace(
        exact.row,
        coordinate=exact.row.coordinate + np.float32(0.5),
        sigma=np.full_like(exact.row.sigma, 100.0),
    )
    cloud = triangulate(ProjectorMap(exact.column, wrong_row), RIG)
    assert np.abs(cloud.xyz[..., 2] - TILTED[..., 2]).max() < 1e-3


def test_a_coordinate_off_its_epipolar_line_is_void() -> None:
    good = map_of(RIG, TILTED)
    assert good.row is not None
    good.row.coordinate[100, 200] += 12.0
    cloud = triangulate(good, RIG)
    assert np.isnan(cloud.xyz[100, 200]).all()
    assert np.isnan(cloud.sigma_mm[100, 200])
    assert np.count_nonzero(~cloud.valid) == 1
    assert triangulate(good, RIG, rules=CloudRules(epipolar_px=20.0)).valid.all()


@pytest.mark.parametrize(
    ("sigma", "off_px", "kept"),
    [(0.02, 1.5, True), (0.02, 2.5, False), (0.5, 5.0, True), (0.5, 6.5, False)],
)
def test_the_default_limit_is_two_px_or_eight_sigma(
    sigma: float, off_px: float, kept: bool
) -> None:
    """Off by d across the line; the line is nearly level here. 8 hypot(0.5, 0.5) = 5.66 px."""
    coded = map_of(RIG, TILTED, sigma=sigma)
    assert coded.row is not None
    coded.row.coordinate[100, 200] += off_px
    cloud = triangulate(coded, RIG)
    assert cloud.valid[100, 200] == kept
    if kept:
        assert abs(cloud.epipolar_px[100, 200]) == pytest.approx(off_px, rel=0.01)


@pytest.mark.parametrize("axes", ["x", "xy"])
def test_a_void_coordinate_is_a_void_point(axes: Literal["x", "xy"]) -> None:
    coded = map_of(RIG, TILTED, axes=axes)
    assert coded.column is not None
    coded.column.coordinate[5, 6] = coded.column.sigma[5, 6] = np.nan
    cloud = triangulate(coded, RIG)
    assert np.isnan(cloud.xyz[5, 6]).all()
    assert np.count_nonzero(~cloud.valid) == 1


def test_depths_outside_the_window_are_void() -> None:
    depth = TILTED[..., 2]
    window = (640.0, 660.0)
    cloud = triangulate(map_of(RIG, TILTED), RIG, rules=CloudRules(z_range_mm=window))
    inside = (depth > window[0]) & (depth < window[1])
    assert np.count_nonzero(cloud.valid != inside) <= 1e-4 * depth.size


def test_the_default_window_is_the_calibrated_volume_widened_by_a_tenth() -> None:
    low, high = TILTED[..., 2].min(), TILTED[..., 2].max()
    span = float(high - low)
    rig = dataclasses.replace(RIG, volume_mm=(float(low) + span / 4, float(high) - span / 4))
    cloud = triangulate(map_of(RIG, TILTED), rig)
    depths = cloud.points()[:, 2]
    assert depths.min() == pytest.approx(low + 0.25 * span - 0.05 * span, abs=0.1)
    assert depths.max() == pytest.approx(high - 0.25 * span + 0.05 * span, abs=0.1)


def test_one_axis_of_two_can_be_chosen() -> None:
    cloud = triangulate(map_of(RIG, TILTED), RIG, rules=CloudRules(axis="x"))
    assert np.isnan(cloud.epipolar_px).all()
    assert cloud.valid.all()
    with pytest.raises(UsageError, match=r"axis must be one that the capture codes \(x\), got y"):
        triangulate(map_of(RIG, TILTED, axes="x"), RIG, rules=CloudRules(axis="y"))


def test_a_capture_of_another_camera_is_refused() -> None:
    other = Rig(Camera(640, 480, CAMERA.lens), PROJECTOR, POSE)
    with pytest.raises(ShapeError, match="must be 640x480 like the rig's camera, got 752x480"):
        triangulate(map_of(RIG, TILTED), other)


def test_an_empty_cloud_and_an_empty_window_are_errors() -> None:
    coded = map_of(RIG, TILTED)
    with pytest.raises(DecodeError, match=r"no pixel gives a point between z = 10 and 20 mm"):
        triangulate(coded, RIG, rules=CloudRules(z_range_mm=(10, 20)))
    with pytest.raises(UsageError, match="z-range must rise"):
        triangulate(coded, RIG, rules=CloudRules(z_range_mm=(20, 10)))


def test_a_rig_that_did_not_take_the_capture_is_told() -> None:
    """A projector principal point 3 px lower moves every point off its epipolar line by about 3."""
    coded = map_of(RIG, TILTED)
    assert triangulate(coded, RIG).findings == ()
    assert coded.row is not None
    coded.row.coordinate[: SHAPE[0] // 5] += 3.0
    (finding,) = triangulate(coded, RIG).findings
    assert "20% of the points in the depth range miss their epipolar line" in finding.message
    coded.row.coordinate[SHAPE[0] // 5 :] += 3.0
    with pytest.raises(DecodeError, match="this rig did not take the capture"):
        triangulate(coded, RIG)


def test_many_pixels_that_fit_no_sinusoid_are_told() -> None:
    coded = map_of(RIG, TILTED)
    assert coded.column is not None
    rows = SHAPE[0] // 20
    coded.column.void[:rows] = Void.RESIDUAL
    coded.column.coordinate[:rows] = np.nan
    assert triangulate(coded, RIG).findings == ()
    rows = SHAPE[0] // 4
    coded.column.void[:rows] = Void.RESIDUAL
    coded.column.coordinate[:rows] = np.nan
    (finding,) = triangulate(coded, RIG).findings
    assert finding.message.startswith("25% of the pixels with fringes along x are void")
    assert "gamma" in finding.remedy


def test_intensity_is_the_offset_unless_a_white_frame_is_given() -> None:
    coded = map_of(RIG, TILTED, axes="x")
    assert coded.column is not None
    assert triangulate(coded, RIG).intensity is coded.column.offset
    white = np.full(SHAPE, 7.0, np.float32)
    assert triangulate(coded, RIG, intensity=white).intensity is white


def test_a_ray_worked_by_hand() -> None:
    """Camera f 1000 at the origin, projector f 1000 moved 100 mm to the right, both straight ahead.

    The pixel at the centre looks along z. A point at z = 500 mm stands at x = -100 mm for the
    projector: column 320 - 1000 * 100 / 500 = 120. At z = 250 mm: 320 - 400 = -80.
    """
    camera = Camera(3, 3, dataclasses.replace(PINHOLE, cx=1.0, cy=1.0))
    projector = dataclasses.replace(PROJECTOR, lens=dataclasses.replace(PINHOLE, cx=320.0))
    pose = dataclasses.replace(POSE, rotation=np.eye(3), translation_mm=np.array([-100.0, 0, 0]))
    rig = Rig(camera, projector, pose)
    coded = map_of(rig, plane_points(rig, (0, 0, 1), 500.0), axes="x")
    assert coded.column is not None
    assert coded.column.coordinate[1, 1] == 120.0
    coded.column.coordinate[1, 1] = -80.0
    cloud = triangulate(coded, rig)
    np.testing.assert_allclose(cloud.xyz[1, 1], [0, 0, 250], atol=1e-4)
    # dz/du = z^2 / (f b): 250^2 / (1000 * 100) = 0.625 mm per px, times sigma 0.02 px
    assert cloud.sigma_mm[1, 1] == pytest.approx(0.0125, rel=1e-5)


PINHOLE = dataclasses.replace(
    CAMERA.lens, fx=1000.0, fy=1000.0, cx=0.0, cy=0.0, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0
)
