"""Where the corners of a printed board truly are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.twin.scene import Board
from fringeworks.twin.texture import print_error, sheet_sizes

Array = NDArray[np.float64]


def board_corners(board: Board) -> Array:
    """``(rows * columns, 3)`` inner corners as printed, row by row, mm in the board's frame."""
    y, x = np.mgrid[: board.rows, : board.columns].astype(np.float64) * board.square_mm
    shift = print_error(board)[1:-1, 1:-1]
    x = x * (1 + board.print_scale[0]) + shift[..., 0]
    y = y * (1 + board.print_scale[1]) + shift[..., 1]
    middle_x, middle_y, half_x, half_y = sheet_sizes(board)
    bow_x = board.bow_mm[0] * (1 - ((x - middle_x) / half_x) ** 2)
    bow_y = board.bow_mm[1] * (1 - ((y - middle_y) / half_y) ** 2)
    corners = np.stack([x, y, -bow_x - bow_y], axis=-1)
    return np.asarray(corners.reshape(-1, 3), dtype=np.float64)
