from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate.boards.charuco import charuco_board
from fringeworks.calibrate.boards.corners import find_board, find_corners
from fringeworks.errors import CalibrationError, UsageError
from fringeworks.model import CharucoTarget
from tests.calibrate.boards import Ink, board_view, photograph, seen, squares_ink

BOARD = CharucoTarget(5, 4, 10.0, 10.0, 6.0, "DICT_4X4_50")
VIEW = board_view(BOARD, square_px=32.0, tilt=0.2)
TRUTH = seen(VIEW, BOARD.corners_mm())

Array = NDArray[np.float64]


@cache
def picture() -> Array:
    return photograph(VIEW, charuco_ink(BOARD), blur_px=0.6)


def charuco_ink(board: CharucoTarget) -> Ink:
    """Squares with exact edges; in the white ones OpenCV's own drawing."""
    scale = 60
    size = ((board.columns + 1) * scale, (board.rows + 1) * scale)
    drawn = charuco_board(board).generateImage(size) < 128
    squares = squares_ink(board)

    def ink(x: Array, y: Array) -> Array:
        u = np.clip((x / board.pitch_x_mm + 1) * scale, 0, size[0] - 1).astype(int)
        v = np.clip((y / board.pitch_y_mm + 1) * scale, 0, size[1] - 1).astype(int)
        inner = np.maximum(np.abs(x % 10 - 5), np.abs(y % 10 - 5)) < board.marker_mm / 2 + 0.2
        return np.where(inner & drawn[v, u], 1.0, squares(x, y))

    return ink


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_the_whole_board() -> None:
    found = find_board(picture(), BOARD)
    np.testing.assert_array_equal(found.index, np.arange(BOARD.corner_count))
    assert set(found.reasons) == {""}
    assert rms(found.pixels - TRUTH) < 5e-3  # OpenCV's own: 0.04 and more


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_corners_keep_their_numbers_however_the_board_is_turned(turns: int) -> None:
    """Pixel (x, y) goes to (y, W - 1 - x) in a quarter turn."""
    found = find_board(np.rot90(picture(), turns), BOARD)
    expected = TRUTH
    for turn in range(turns):
        last = picture().shape[1 - turn % 2] - 1
        expected = np.stack([expected[:, 1], last - expected[:, 0]], axis=1)
    assert rms(found.pixels - expected[found.index]) < 5e-3


def test_a_part_of_the_board_is_enough() -> None:
    part = picture()[:, 85:]
    found = find_board(part, BOARD)
    assert 6 <= len(found.index) < BOARD.corner_count
    assert np.all(np.diff(found.index) > 0)
    assert rms(found.pixels + np.array([85, 0]) - TRUTH[found.index]) < 5e-3
    whole = find_corners(part, BOARD)
    assert whole.shape == (BOARD.corner_count, 2)
    np.testing.assert_array_equal(np.isfinite(whole[:, 0]).nonzero()[0], found.index)


def test_other_markers_say_so() -> None:
    other = CharucoTarget(5, 4, 10.0, 10.0, 6.0, "DICT_7X7_50")
    with pytest.raises(CalibrationError, match="0 markers of DICT_7X7_50 were read: do dictionary"):
        find_board(picture(), other)


def test_too_little_of_the_board_says_how_much() -> None:
    with pytest.raises(CalibrationError, match=r"only \d of 20 ChArUco corners.*2 markers of"):
        find_board(picture()[:90, :90], BOARD)


def test_a_mirrored_board_is_not_read() -> None:
    with pytest.raises(CalibrationError, match="is the image mirrored"):
        find_board(np.ascontiguousarray(picture()[:, ::-1]), BOARD)


@pytest.mark.parametrize(
    ("board", "message"),
    [
        (CharucoTarget(5, 4, 1.0, 1.0, 0.6, "DICT_9X9"), "dictionary must be one of OpenCV's"),
        (CharucoTarget(5, 4, 1.0, 1.0, 0.6, "aruco"), "dictionary must be one of OpenCV's"),
        (CharucoTarget(11, 9, 1.0, 1.0, 0.6, "DICT_4X4_50"), "each of the 60 white squares"),
        (CharucoTarget(5, 4, 1.0, 1.0, 1.0, "DICT_4X4_50"), "marker_mm must be above 0 and below"),
    ],
)
def test_boards_that_cannot_be(board: CharucoTarget, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        charuco_board(board)


def test_the_frame_is_opencvs() -> None:
    board = charuco_board(BOARD)
    corners = np.asarray(board.getChessboardCorners())
    np.testing.assert_allclose(corners - corners[0], BOARD.corners_mm(), atol=1e-4)
    assert isinstance(board, cv2.aruco.CharucoBoard)
