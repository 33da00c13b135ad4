"""What is printed on a board, and what is wrong with it."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.kernels.sheet import Sheet
from fringeworks.twin.scene import Board, Object

Array = NDArray[np.float64]

CELL_PX = 8
"""Pixels per marker cell of the drawing that is looked at in the cells' middles."""


def sheet_of(thing: Object, board: Board) -> Sheet:
    """A board's print at the object's place, with the object's albedos."""
    pose = thing.camera_from_object.inverse()
    across, down, ink = print_of(board)
    shifts = np.ascontiguousarray(np.moveaxis(print_error(board), -1, 0))
    area = ink * np.diff(down)[:, None] * np.diff(across)
    return Sheet(
        rotation=np.ascontiguousarray(pose.rotation, dtype=np.float64),
        translation=np.ascontiguousarray(pose.translation_mm, dtype=np.float64),
        across=across,
        down=down,
        sums=np.pad(area.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0))),
        circles=(_radius(board) if board.kind == "circles" else 0.0, board.columns, board.rows),
        scale_x=1 + board.print_scale[0],
        scale_y=1 + board.print_scale[1],
        shifts_x=shifts[0],
        shifts_y=shifts[1],
        square=float(board.square_mm),
        white=thing.material.albedo,
        black=thing.material.dark_albedo,
    )


def sheet_sizes(board: Board) -> tuple[float, float, float, float]:
    """Middle x, y of the sheet and half its sides, mm in the board's frame."""
    wide, high = (board.columns + 1) * board.square_mm, (board.rows + 1) * board.square_mm
    x, y = wide / 2 - board.square_mm, high / 2 - board.square_mm
    return x, y, wide / 2 + board.margin_mm, high / 2 + board.margin_mm


def print_of(board: Board) -> tuple[Array, Array, Array]:
    """Grid lines across and down, mm, and the share of ink in the cells between them.

    Circles are none of these cells: theirs are empty.
    """
    steps = np.array([0.0])
    if board.kind == "charuco":
        steps = _marker_steps(board)
    across, down = _lines(board.columns + 1, steps), _lines(board.rows + 1, steps)
    match board.kind:
        case "charuco":
            ink = _draw_charuco(board, across, down)
        case "circles":
            _radius(board)
            ink = np.zeros((len(down) - 1, len(across) - 1))
        case _:
            ink = _draw_squares(board)
    return (across - 1) * board.square_mm, (down - 1) * board.square_mm, ink


def print_error(board: Board) -> Array:
    """``(rows + 2, columns + 2, 2)``: how far each corner, outer ones too, is off its place, mm.

    Normal with `print_sigma_mm` along x and along y, from `print_seed`.
    """
    rng = np.random.default_rng(board.print_seed)
    return rng.normal(0.0, 1.0, (board.rows + 2, board.columns + 2, 2)) * board.print_sigma_mm


def _lines(squares: int, steps: Array) -> Array:
    """Grid lines over all squares, in squares from the print's edge."""
    every = (np.arange(squares)[:, None] + steps).ravel()
    return np.append(every, float(squares))


def _draw_squares(board: Board) -> Array:
    """Black where row and column of a square are both even or both odd."""
    row, column = np.mgrid[: board.rows + 1, : board.columns + 1]
    return np.asarray((row + column) % 2 == 0, dtype=np.float64)


def _marker_steps(board: Board) -> Array:
    """Edges of a marker's cells within a square, in squares: its bits and a black rim of one."""
    cells = _dictionary(board).markerSize + 2
    share = _marker_share(board)
    return np.append(0.0, (1 - share) / 2 + np.arange(cells + 1) * share / cells)


def _draw_charuco(board: Board, across: Array, down: Array) -> Array:
    """OpenCV's drawing, looked at in the middle of each cell."""
    dictionary = _dictionary(board)
    size = (board.columns + 1, board.rows + 1)
    if size[0] * size[1] // 2 > len(dictionary.bytesList):
        raise UsageError(
            f"board.dictionary must have a marker for each of the {size[0] * size[1] // 2} white "
            f"squares, got {board.dictionary} with {len(dictionary.bytesList)}: take a larger one"
        )
    share = _marker_share(board)
    drawn = cv2.aruco.CharucoBoard(size, 1.0, share, dictionary)
    cell = share / (dictionary.markerSize + 2)
    side = math.ceil(CELL_PX / cell)
    image = drawn.generateImage((size[0] * side, size[1] * side))
    middles = [((lines[1:] + lines[:-1]) / 2 * side).astype(np.intp) for lines in (down, across)]
    return np.asarray(image[np.ix_(*middles)] < 128, dtype=np.float64)


def _radius(board: Board) -> float:
    """Of a circle, mm."""
    if board.diameter_mm is None or not 0 < board.diameter_mm < board.square_mm:
        raise UsageError(
            f"board.diameter_mm must be above 0 and below square_mm ({board.square_mm:g}) for "
            f"circles, got {board.diameter_mm}"
        )
    return board.diameter_mm / 2


def _marker_share(board: Board) -> float:
    """Side of a marker, in squares."""
    if board.marker_mm is None or not 0 < board.marker_mm < board.square_mm:
        raise UsageError(
            f"board.marker_mm must be above 0 and below square_mm ({board.square_mm:g}) for a "
            f"ChArUco board, got {board.marker_mm}"
        )
    return board.marker_mm / board.square_mm


def _dictionary(board: Board) -> cv2.aruco.Dictionary:
    code = getattr(cv2.aruco, board.dictionary, None)
    if not board.dictionary.startswith("DICT_") or not isinstance(code, int):
        raise UsageError(
            "board.dictionary must be one of OpenCV's, such as DICT_4X4_250, "
            f"got {board.dictionary!r}"
        )
    return cv2.aruco.getPredefinedDictionary(code)
