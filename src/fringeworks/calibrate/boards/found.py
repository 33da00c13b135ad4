"""What was found of a board in an image, and the sizes of its squares there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import CalibrationError
from fringeworks.model import Target

Points = NDArray[np.float64]
Image = NDArray[np.generic]

SMALLEST_SQUARE_PX = 6.0
ROBUST_PERCENT = (0.5, 99.5)


@dataclass(frozen=True, slots=True, eq=False)
class FoundCorners:
    """Corners of a board, or centres of its circles, in an image; k of its n.

    Attributes
    ----------
    index
        ``(k,)`` which of the board's, in the order of `corners_mm`, rising.
    pixels
        ``(k, 2)`` camera px.
    sigma
        ``(k, 2)`` standard deviations of the coordinates, px.
    reasons
        Why a corner stands where the detector saw it and not to a hundredth of a pixel; empty
        where all is well.
    blur_px
        Standard deviation of the image's blur; NaN where it was not fitted.
    """

    index: NDArray[np.intp]
    pixels: Points
    sigma: Points
    reasons: tuple[str, ...]
    blur_px: float = np.nan

    def on_board(self, board: Target) -> Points:
        """``(n, 2)`` px of all of the board's corners, NaN where not seen."""
        return on_board(self.index, self.pixels, board)


def on_board(index: NDArray[np.intp], pixels: Points, board: Target) -> Points:
    """``(n, 2)``: `pixels` at their places on the board, NaN elsewhere."""
    grid = np.full((board.corner_count, 2), np.nan)
    grid[index] = pixels
    return grid


def to_8_bit(image: Image) -> NDArray[np.uint8]:
    """The image with its 0.5 and 99.5 percentiles at 0 and 255; void pixels are black."""
    values = np.nan_to_num(np.asarray(image, dtype=np.float32))
    low, high = np.percentile(values, ROBUST_PERCENT)
    scaled = (values - low) * (255 / max(high - low, 1e-6))
    levels: NDArray[np.uint8] = np.clip(np.rint(scaled), 0, 255).astype(np.uint8)
    return levels


def square_sizes(corners: Points, board: Target) -> NDArray[np.float64]:
    """``(n,)`` distance, px, from each corner to the nearest of its neighbours on the grid.

    NaN for corners that were not seen, or none of whose neighbours was.
    """
    grid = corners.reshape(board.rows, board.columns, 2)
    across = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
    down = np.linalg.norm(np.diff(grid, axis=0), axis=-1)
    nearest = np.full((board.rows, board.columns), np.nan)
    nearest[:, :-1] = np.fmin(nearest[:, :-1], across)
    nearest[:, 1:] = np.fmin(nearest[:, 1:], across)
    nearest[:-1] = np.fmin(nearest[:-1], down)
    nearest[1:] = np.fmin(nearest[1:], down)
    return nearest.ravel()


def grid_steps(corners: Points, board: Target) -> Points:
    """``(n, 2, 2)`` px: the way from each corner to the next along x, and along y.

    Half the way between both neighbours, the way to one where only one is there; NaN without.
    """
    grid = corners.reshape(board.rows, board.columns, 2)
    steps = np.stack([_step(grid, 1), _step(grid, 0)], axis=2)
    return steps.reshape(-1, 2, 2)


def _step(grid: Points, axis: int) -> Points:
    void = np.full_like(np.take(grid, [0], axis=axis), np.nan)
    ways = np.diff(grid, axis=axis)
    after = np.concatenate([ways, void], axis=axis)
    before = np.concatenate([void, ways], axis=axis)
    both = (before + after) / 2
    one = np.where(np.isnan(after), before, after)
    return np.where(np.isnan(both), one, both)


def handedness(corners: Points, board: Target) -> float:
    """Twice the mean signed area, px^2, of the squares: positive with x right and y down.

    A camera that sees the printed side of a board sees it positive; negative means mirrored.
    """
    grid = corners.reshape(board.rows, board.columns, 2)
    x = np.diff(grid, axis=1)[:-1]
    y = np.diff(grid, axis=0)[:, :-1]
    return float(np.nanmedian(x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]))


def right_handed(corners: Points, board: Target) -> Points:
    """The same corners with each row turned round where the detector ordered them mirrored."""
    if handedness(corners, board) > 0:
        return corners
    return corners.reshape(board.rows, board.columns, 2)[:, ::-1].reshape(-1, 2)


def refuse_small(corners: Points, board: Target) -> None:
    """Raise `CalibrationError` where squares are below 6 px."""
    smallest = float(np.nanmin(square_sizes(corners, board)))
    if smallest < SMALLEST_SQUARE_PX:
        raise CalibrationError(
            f"the board is too small: its squares are {smallest:.1f} px wide in the image, at "
            f"least {SMALLEST_SQUARE_PX:g} are needed; move it nearer or print larger squares"
        )
