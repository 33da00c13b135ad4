"""Inner corners of a checkerboard in the camera's image, to a few hundredths of a pixel.

OpenCV's SB detector says which corner is which (the classical detector where it finds nothing);
`cv2.cornerSubPix` says where each one is, in a window that follows the local size of the squares.
The SB detector's own positions are not used: on rendered boards they err by 0.04 to 0.09 px where
the refinement errs by 0.03 to 0.05, and on the 13 left images of OpenCV's chessboard sample a
calibration leaves 0.26 px with them and 0.18 px with the refinement.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import CalibrationError, ShapeError
from fringeworks.model import Capture, CheckerboardTarget, ProjectorMap

Points = NDArray[np.float64]
Image = NDArray[np.generic]

CORNER_SIGMA_PX = 0.04
"""Standard deviation, px, of a corner's coordinate where nothing better is known."""

WINDOW_SHARE = 0.28
"""Half the refinement window per local square. On OpenCV's sample the residuals fall slowly up to
0.32 and rise steeply from 0.35, where the window of a tilted square begins to hold other edges."""

SMALLEST_SQUARE_PX = 6.0
SMALLEST_IMAGE_PX = 16
ROBUST_PERCENT = (0.5, 99.5)
_SMALLEST_BOARD = (3, 3)


def board_images(capture: Capture, projector_map: ProjectorMap) -> Iterator[tuple[str, Image]]:
    """Images ``(H, W)`` to look for the board in, best first, each with what it is.

    The white frame if there is one, then the fringes' offset A, then their modulation B.
    """
    white = capture.white()
    if white is not None:
        yield "white frame", white
    axis = projector_map.axes[0]
    yield "offset of the fringes", axis.offset
    yield "modulation of the fringes", axis.modulation


def to_8_bit(image: Image) -> NDArray[np.uint8]:
    """The image with its 0.5 and 99.5 percentiles at 0 and 255; void pixels are black."""
    values = np.nan_to_num(np.asarray(image, dtype=np.float32))
    low, high = np.percentile(values, ROBUST_PERCENT)
    scaled = (values - low) * (255 / max(high - low, 1e-6))
    levels: NDArray[np.uint8] = np.clip(np.rint(scaled), 0, 255).astype(np.uint8)
    return levels


def square_sizes(corners: Points, board: CheckerboardTarget) -> NDArray[np.float64]:
    """``(n,)`` distance, px, from each corner to the nearest of its neighbours on the grid."""
    grid = corners.reshape(board.rows, board.columns, 2)
    across = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
    down = np.linalg.norm(np.diff(grid, axis=0), axis=-1)
    nearest = np.full((board.rows, board.columns), np.inf)
    nearest[:, :-1] = np.minimum(nearest[:, :-1], across)
    nearest[:, 1:] = np.minimum(nearest[:, 1:], across)
    nearest[:-1] = np.minimum(nearest[:-1], down)
    nearest[1:] = np.minimum(nearest[1:], down)
    return nearest.ravel()


def handedness(corners: Points, board: CheckerboardTarget) -> float:
    """Twice the mean signed area, px^2, of the squares: positive with x right and y down.

    A camera that sees the printed side of a board sees it positive; negative means mirrored.
    """
    grid = corners.reshape(board.rows, board.columns, 2)
    x = np.diff(grid, axis=1)[:-1]
    y = np.diff(grid, axis=0)[:, :-1]
    return float(np.nanmedian(x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]))


def find_corners(image: Image, board: CheckerboardTarget) -> Points:
    """Inner corners of the board in an image.

    Parameters
    ----------
    image
        ``(H, W)`` grey levels of any depth; NaN counts as black.
    board
        Counts of inner corners. Which of the two counts is called columns does not matter to the
        detectors; half a turn of the board cannot be told and does not matter either, since both
        devices get the same list.

    Returns
    -------
    corners
        ``(n, 2)`` camera px, in the order of `CheckerboardTarget.corners_mm`, right-handed: the
        board's x runs right and its y down when it is looked at from the front.

    Raises
    ------
    ShapeError
        The image is not two-dimensional.
    CalibrationError
        No such board, with the counts of the board that is there if one is; or squares below
        6 px.
    """
    if image.ndim != 2:
        raise ShapeError(f"image must be (H, W), got {image.shape}")
    grey = to_8_bit(image)
    corners = _detect(grey, board)
    if corners is None:
        raise CalibrationError(_why_not_found(grey, board))
    corners = _right_handed(corners, board)
    smallest = float(square_sizes(corners, board).min())
    if smallest < SMALLEST_SQUARE_PX:
        raise CalibrationError(
            f"the board is too small: its squares are {smallest:.1f} px wide in the image, at "
            f"least {SMALLEST_SQUARE_PX:g} are needed; move it nearer or print larger squares"
        )
    return _refine(image, corners, board)


def _detect(grey: NDArray[np.uint8], board: CheckerboardTarget) -> Points | None:
    """Corners as the first detector that finds them orders them."""
    size = (board.columns, board.rows)
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    if min(grey.shape) < SMALLEST_IMAGE_PX:
        return None
    found, corners = cv2.findChessboardCornersSB(grey, size, flags=flags)
    if not found:
        found, corners = cv2.findChessboardCorners(grey, size)
    if not found:
        return None
    detected = corners.reshape(-1, 2).astype(np.float64)
    height, width = grey.shape
    inside = (detected >= 0).all() and (detected <= [width - 1, height - 1]).all()
    return detected if inside else None


def _right_handed(corners: Points, board: CheckerboardTarget) -> Points:
    """The same corners with each row turned round where the detector ordered them mirrored."""
    if handedness(corners, board) > 0:
        return corners
    return corners.reshape(board.rows, board.columns, 2)[:, ::-1].reshape(-1, 2)


def _refine(image: Image, corners: Points, board: CheckerboardTarget) -> Points:
    """Sub-pixel positions from the image's own grey levels, window by local square size."""
    values = np.nan_to_num(np.asarray(image, dtype=np.float32))
    halves = np.maximum(2, (WINDOW_SHARE * square_sizes(corners, board)).astype(int))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    refined = corners.copy()
    for half in np.unique(halves):
        chosen = halves == half
        start = corners[chosen].reshape(-1, 1, 2).astype(np.float32)
        moved = cv2.cornerSubPix(values, start, (int(half), int(half)), (-1, -1), stop)
        refined[chosen] = moved.reshape(-1, 2)
    return refined


def _why_not_found(grey: NDArray[np.uint8], board: CheckerboardTarget) -> str:
    """What is there instead of the board asked for."""
    asked = f"no board of {board.columns} x {board.rows} inner corners was found"
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_LARGER
    found = min(grey.shape) >= SMALLEST_IMAGE_PX
    if found:
        found, _, meta = cv2.findChessboardCornersSBWithMeta(grey, _SMALLEST_BOARD, flags)
    if not found:
        return (
            f"{asked}, nor any other: is the whole board in the image, evenly lit, with a white "
            "margin, and are inner corners counted (one less than squares)?"
        )
    rows, columns = meta.shape[:2]
    hint = ""
    if sorted((columns + 1, rows + 1)) == sorted((board.columns, board.rows)):
        hint = " Squares were counted instead of inner corners."
    return f"{asked}, but one of {columns} x {rows} was: correct board.toml.{hint}"
