from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import CalibrationSettings, View, observe_board
from fringeworks.calibrate.observe import ONE_SIDED, SCATTERED, TOO_FEW
from fringeworks.errors import CalibrationError, UsageError
from fringeworks.geometry.lens import project
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Capture, CheckerboardTarget, ProjectorMap, Sensor, Sequence
from fringeworks.model.sequence import PatternSet, Uniform
from tests.calibrate.synthetic import (
    BOARD,
    PROJECTOR,
    RELATION,
    reference,
    true_projector_map,
)
from tests.scenes import coded_axis

Array = NDArray[np.float64]
POSE, PICTURE = reference()
SIGMA = 0.05


def capture_of(image: NDArray[np.uint8]) -> Capture:
    white = Sequence(608, 684, (PatternSet(Uniform(1.0)),))
    return Capture(white, (image[None],), Sensor(255.0), name="pose_7")


def map_from(pixels: Array) -> ProjectorMap:
    return ProjectorMap(
        coded_axis("x", pixels[..., 0], SIGMA), coded_axis("y", pixels[..., 1], SIGMA)
    )


@pytest.fixture(scope="module")
def capture() -> Capture:
    return capture_of(PICTURE)


@pytest.fixture(scope="module")
def pixels() -> Array:
    clean = true_projector_map(POSE)
    return clean + np.random.default_rng(2).normal(0, SIGMA, clean.shape)


@pytest.fixture(scope="module")
def view(capture: Capture, pixels: Array) -> View:
    return observe_board(capture, map_from(pixels), BOARD)


def expected(view: View) -> Array:
    """Projector px of the corners, ordered as the view's."""
    in_camera = BOARD.corners_mm() @ rotation_matrix(POSE[:3]).T + POSE[3:]
    true = project(in_camera @ rotation_matrix(RELATION[:3]).T + RELATION[3:], PROJECTOR)
    near = np.abs(true - view.projector_px).sum() < np.abs(true[::-1] - view.projector_px).sum()
    return true if near else true[::-1]


def test_projector_coordinates_of_the_corners(view: View) -> None:
    assert view.kept.all()
    assert view.left_out == {}
    assert view.image == "white frame"
    errors = view.projector_px - expected(view)
    # the camera's corner error (0.03 px, times 0.5 and 1.0 projector px per camera px) dominates
    assert np.sqrt(np.mean(errors**2, axis=0)) == pytest.approx([0.0, 0.0], abs=0.05)
    assert np.median(view.projector_sigma_px) < 0.01


def test_dark_squares_may_be_void(capture: Capture, pixels: Array) -> None:
    dark = capture.frames[0][0] < 100
    void = np.where(dark[..., None], np.nan, pixels)
    view = observe_board(capture, map_from(void), BOARD)
    assert view.kept.all()
    assert np.sqrt(np.mean((view.projector_px - expected(view)) ** 2)) < 0.06


def test_wrong_codes_on_dark_squares_do_not_pull(
    view: View, capture: Capture, pixels: Array
) -> None:
    rng = np.random.default_rng(3)
    wrong = (capture.frames[0][0] < 100) & (rng.random(pixels.shape[:2]) < 0.6)
    spoilt = np.where(wrong[..., None], rng.uniform(0, 600, pixels.shape), pixels)
    found = observe_board(capture, map_from(spoilt), BOARD)
    assert found.kept.all()
    assert np.abs(found.projector_px - view.projector_px).max() < 0.05


def test_every_corner_left_out_has_its_reason(view: View, capture: Capture, pixels: Array) -> None:
    holed = pixels.copy()
    x, y = np.rint(view.camera_px[0]).astype(int)
    holed[y - 40 : y + 41, x - 40 : x + 41] = np.nan
    x, y = np.rint(view.camera_px[50]).astype(int)
    rng = np.random.default_rng(0)
    holed[y - 30 : y + 31, x - 30 : x + 31] = rng.uniform(0, 600, (61, 61, 2))
    found = observe_board(capture, map_from(holed), BOARD)
    assert found.reasons[0] == TOO_FEW
    assert np.isnan(found.projector_px[0]).all()
    assert found.reasons[50] == SCATTERED
    assert sum(found.left_out.values()) == (~found.kept).sum()
    assert found.kept.sum() + sum(found.left_out.values()) == BOARD.corner_count


def test_a_corner_at_the_edge_of_the_lit_field_is_one_sided(
    view: View, capture: Capture, pixels: Array
) -> None:
    middle = np.abs(view.camera_px[:, 0] - np.median(view.camera_px[:, 0]))
    index = int(np.argmin(middle))
    edge = int(view.camera_px[index, 0])
    cut = pixels.copy()
    cut[:, edge + 1 :] = np.nan
    found = observe_board(capture, map_from(cut), BOARD)
    assert found.reasons[index] == ONE_SIDED
    beyond = found.camera_px[:, 0] > edge + 40
    inside = found.camera_px[:, 0] < edge - 40
    assert {found.reasons[i] for i in np.flatnonzero(beyond)} == {TOO_FEW}
    assert {found.reasons[i] for i in np.flatnonzero(inside)} == {""}


def test_one_axis_is_not_enough(capture: Capture, pixels: Array) -> None:
    half = replace(map_from(pixels), row=None)
    with pytest.raises(CalibrationError, match=r"pose_7: only axis x .*calibration needs both"):
        observe_board(capture, half, BOARD)


def test_no_board_names_the_capture(capture: Capture, pixels: Array) -> None:
    other = CheckerboardTarget(12, 9, 13.0, 13.0)
    with pytest.raises(CalibrationError, match=r"^pose_7: no board of 12 x 9 .*Squares were"):
        observe_board(capture, map_from(pixels), other)


def test_modulation_stands_in_for_a_white_frame(capture: Capture, pixels: Array) -> None:
    dark = capture_of(np.full_like(capture.frames[0][0], 7))
    seen = map_from(pixels)
    assert seen.column is not None
    picture = capture.frames[0][0].astype(np.float32)
    column = replace(seen.column, modulation=picture)
    found = observe_board(dark, replace(seen, column=column), BOARD)
    assert found.image == "modulation of the fringes"


def test_mostly_dark_says_where_the_corners_went(capture: Capture, pixels: Array) -> None:
    dark = np.full_like(pixels, np.nan)
    dark[:60, :60] = 1.0
    with pytest.raises(CalibrationError, match=r"pose_7: only 0 of 88 corners .*88 too few"):
        observe_board(capture, map_from(dark), BOARD)


def test_mirrored_projector_is_a_fault(capture: Capture, pixels: Array) -> None:
    flipped = pixels * [-1, 1] + [607, 0]
    with pytest.raises(CalibrationError, match=r"pose_7: .*mirrored against the camera's"):
        observe_board(capture, map_from(flipped), BOARD)


@pytest.mark.parametrize(
    "bad", [{"window_squares": 0.0}, {"huber": -1.0}, {"trim_share": 0.7}, {"trim_sigmas": 0.0}]
)
def test_settings_that_make_no_sense(bad: dict[str, float]) -> None:
    with pytest.raises(UsageError, match=next(iter(bad))):
        CalibrationSettings(**bad)  # type: ignore[arg-type]
