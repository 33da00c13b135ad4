"""Corners of a ChArUco board: its markers say which they are, so a part of it in view is enough."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.boards.found import (
    FoundCorners,
    Image,
    grid_steps,
    on_board,
    refuse_small,
    to_8_bit,
)
from fringeworks.calibrate.boards.saddle import refine_saddles
from fringeworks.errors import CalibrationError, UsageError
from fringeworks.model import CharucoTarget

LEAST_CORNERS = 6

MARKER_BLUR_PX = 1.5
"""A marker's edge spreads so far into the white about it."""

LEAST_ARM_PX = 1.5

Indices = NDArray[np.intp]


def find_charuco(image: Image, board: CharucoTarget) -> FoundCorners:
    """As `find_board`; those corners that have a neighbour in view along x, and along y.

    Pixels of the markers take no part: the fit looks at the edges' white margins only.

    Raises
    ------
    CalibrationError
        Fewer than six corners, with the number of markers that were read; or squares below 6 px.
    UsageError
        No such dictionary, or one with too few markers for the board.
    """
    markers = charuco_board(board)
    pixels, index, _, seen = _detector(markers).detectBoard(to_8_bit(image))
    chosen, corners = _in_order(pixels, index)
    grid = on_board(chosen, corners, board)
    steps = grid_steps(grid, board)[chosen]
    whole = np.isfinite(steps).all(axis=(1, 2))
    if whole.sum() < LEAST_CORNERS:
        raise CalibrationError(_why_not_found(board, int(whole.sum()), seen))
    refuse_small(grid, board)
    chosen, corners, steps = chosen[whole], corners[whole], steps[whole]
    refined = refine_saddles(image, corners, steps, arm=_arms(steps, board))
    return FoundCorners(chosen, refined.pixels, refined.sigma, refined.reasons, refined.blur_px)


def charuco_board(board: CharucoTarget) -> cv2.aruco.CharucoBoard:
    """OpenCV's description of the board.

    Raises
    ------
    UsageError
        No such dictionary, one with too few markers, or markers that do not fit the squares.
    """
    code = getattr(cv2.aruco, board.dictionary, None)
    if not board.dictionary.startswith("DICT_") or not isinstance(code, int):
        raise UsageError(
            f"dictionary must be one of OpenCV's, such as DICT_4X4_250, got {board.dictionary!r}"
        )
    dictionary = cv2.aruco.getPredefinedDictionary(code)
    squares = (board.columns + 1, board.rows + 1)
    wanted, held = squares[0] * squares[1] // 2, len(dictionary.bytesList)
    if wanted > held:
        raise UsageError(
            f"dictionary must hold a marker for each of the {wanted} white squares, got "
            f"{board.dictionary} with {held}: take a larger one"
        )
    side = min(board.pitch_x_mm, board.pitch_y_mm)
    if not 0 < board.marker_mm < side:
        raise UsageError(
            f"marker_mm must be above 0 and below the squares' {side:g}, got {board.marker_mm:g}"
        )
    return cv2.aruco.CharucoBoard(squares, side, board.marker_mm, dictionary)


def _detector(markers: cv2.aruco.CharucoBoard) -> cv2.aruco.CharucoDetector:
    """One that finds small and blurred markers: by more thresholds, and where others say.

    On the twin's boards blurred by 1.5 px it reads 96 to 100 % of the markers, as it stands 50
    to 87 %.
    """
    how, markers_how = cv2.aruco.CharucoParameters(), cv2.aruco.DetectorParameters()
    how.tryRefineMarkers, how.minMarkers = True, 1
    markers_how.adaptiveThreshWinSizeStep, markers_how.adaptiveThreshWinSizeMax = 4, 31
    return cv2.aruco.CharucoDetector(markers, how, markers_how)


def _in_order(pixels: Image | None, index: Image | None) -> tuple[Indices, NDArray[np.float64]]:
    if pixels is None or index is None:
        return np.empty(0, np.intp), np.empty((0, 2))
    chosen = index.ravel().astype(np.intp)
    order = np.argsort(chosen)
    return chosen[order], pixels.reshape(-1, 2).astype(np.float64)[order]


def _arms(steps: NDArray[np.float64], board: CharucoTarget) -> NDArray[np.float64]:
    """Width of the white about the markers, in squares, less what their edges spread."""
    sides = np.linalg.norm(steps, axis=-1).min(axis=-1)
    margin = (1 - board.marker_mm / min(board.pitch_x_mm, board.pitch_y_mm)) / 2
    arms: NDArray[np.float64] = np.maximum(margin * sides - MARKER_BLUR_PX, LEAST_ARM_PX) / sides
    return arms


def _why_not_found(board: CharucoTarget, corners: int, seen: Image | None) -> str:
    markers = 0 if seen is None else len(seen)
    return (
        f"only {corners} of {board.corner_count} ChArUco corners were found, at least "
        f"{LEAST_CORNERS} are needed; {markers} markers of {board.dictionary} were read: do "
        "dictionary, columns and rows fit the board, is the image mirrored, are a marker's cells "
        "at least 3 px wide?"
    )
