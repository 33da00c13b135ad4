"""The bars on real captures: four poses of a Gray code on a printed board, full and half size."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fringeworks.calibrate import ImageSize, View, calibrate_captures, calibrate_rig
from fringeworks.calibrate.record import read_record
from fringeworks.files.capture import read_capture
from fringeworks.geometry.forms import fit_plane
from fringeworks.model import CheckerboardTarget, Rig
from tests.calibrate.synthetic import square_sides, triangulate_corners

BOARD = CheckerboardTarget(columns=7, rows=9, pitch_x_mm=75.0, pitch_y_mm=75.0)
BARS = {  # camera, projector, joint; px
    "procam-graycode": (0.34, 0.22, 0.29),
    "procam-half": (0.19, 0.26, 0.23),
}


@pytest.fixture(scope="module", params=BARS)
def calibrated(
    request: pytest.FixtureRequest, real: Callable[[str], Path]
) -> tuple[str, Rig, list[View]]:
    folder = real(request.param)
    captures = (read_capture(folder / f"capture_{index}") for index in range(4))
    rig = calibrate_captures(captures, BOARD)
    record = read_record(rig.further)
    assert record is not None
    return request.param, rig, [entry.view for entry in record.views]


def test_residuals(calibrated: tuple[str, Rig, list[View]]) -> None:
    name, rig, _ = calibrated
    quality = rig.quality
    assert quality is not None
    reached = (quality.camera_rms_px, quality.projector_rms_px, quality.joint_rms_px)
    assert all(rms <= bar for rms, bar in zip(reached, BARS[name], strict=True)), reached
    assert quality.views_used == 4
    assert quality.observations_offered == 252
    assert quality.observations_used >= 0.98 * 252
    assert rig.baseline_mm == pytest.approx(673.7, abs=3.0)  # plain OpenCV: 673.7 and 672.4


def test_squares(calibrated: tuple[str, Rig, list[View]]) -> None:
    _, rig, views = calibrated
    for view in views:  # every corner that was seen, those left out too
        points = triangulate_corners(rig, view.camera_px, view.projector_px)
        assert square_sides(points, BOARD).mean() == pytest.approx(75.0, abs=0.1), view.name


@pytest.mark.parametrize("left_out", range(4))
def test_squares_of_the_pose_left_out(
    calibrated: tuple[str, Rig, list[View]], left_out: int
) -> None:
    _, full, views = calibrated
    view = views[left_out]
    rig = calibrate_rig(
        [other for other in views if other is not view],
        BOARD,
        camera_size=ImageSize(full.camera.width, full.camera.height),
        projector_size=ImageSize(full.projector.width, full.projector.height),
    )
    points = triangulate_corners(rig, view.camera_px, view.projector_px)
    assert square_sides(points, BOARD).mean() == pytest.approx(75.0, abs=0.15)
    assert fit_plane(points[view.kept]).form_rms_mm <= 0.7
    volume = full.volume_mm
    assert volume is not None
    assert np.all((points[:, 2] > volume[0] - 50) & (points[:, 2] < volume[1] + 50))
