"""The surface behind an organised cloud: neighbouring pixels joined wherever it does not jump.

Grids are ``(rows, columns, 3)``, mm, about the camera's centre, NaN where void. Where the
depth jumps, the surface stays open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.grid import smoothing_window

STEEPEST = float(np.tan(np.deg2rad(80.0)))
"""A surface seen flatter than 10 degrees sends too little light back to be measured: what looks
steeper is a jump."""

JUMP_SIGMAS = 5.0
"""Steps along the line of sight that noise makes by itself."""

Points = NDArray[np.float64]
Mask = NDArray[np.bool_]
Cells = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class GridSurface:
    """Which neighbours of a grid hang together.

    Attributes
    ----------
    right, down
        ``(rows, columns - 1)`` and ``(rows - 1, columns)``: whether a node hangs together with the
        next one along its row, and down its column.
    cells
        ``(rows, columns)`` uint8: bit i is set where the triangle without corner i of the cell to
        the lower right of the node is closed. Corners go round the cell from its upper left one,
        to the right, then down.
    """

    right: Mask
    down: Mask
    cells: Cells

    def triangles(self) -> NDArray[np.int64]:
        """``(n, 3)`` node numbers; corners go round as right-handed normals towards the camera."""
        return np.asarray(list_triangles(self.cells)[:, ::-1])


def join_grid(grid: Points, sigma: Points) -> GridSurface:
    """Join the neighbours of a grid where it does not jump.

    `sigma` is the noise of each node along the line of sight, mm; NaN counts as none.
    """
    noise = np.nan_to_num(sigma)
    right = _hang_together((grid[:, :-1], grid[:, 1:]), (noise[:, :-1], noise[:, 1:]))
    down = _hang_together((grid[:-1], grid[1:]), (noise[:-1], noise[1:]))
    cells = np.zeros(grid.shape[:2], np.uint8)
    if min(cells.shape) > 1:
        cells[:-1, :-1] = _find_triangles(grid, noise, (right, down))
    return GridSurface(right, down, cells)


def surface_normals(grid: Points, sigma: Points) -> Points:
    """Unit normals ``(rows, columns, 3)``, towards the camera; 0 where no triangle is.

    The surface is first evened out as its noise demands, but never across a jump.
    """
    surface = join_grid(grid, sigma)
    return node_normals(even_out(grid, surface, smoothing_window(grid, sigma)), surface.cells)


def _hang_together(points: tuple[Points, Points], sigma: tuple[Points, Points]) -> Mask:
    """Whether neighbours are on one surface.

    The step along the line of sight is one that the step across it explains at the steepest
    slope, or else noise of both sigmas, mm.
    """
    near, far = np.sort([_length(points[0]), _length(points[1])], axis=0)
    across = _length(np.cross(*points)) / far
    with np.errstate(invalid="ignore"):
        return np.asarray(far - near <= STEEPEST * across + JUMP_SIGMAS * np.hypot(*sigma))


def _length(vectors: Points) -> Points:
    return np.asarray(np.linalg.norm(vectors, axis=-1))


def _find_triangles(grid: Points, sigma: Points, links: tuple[Mask, Mask]) -> Cells:
    """Bits 0 to 3 of every cell, ``(rows - 1, columns - 1)``.

    Of the two ways to halve a cell the one that closes more of it is taken, then the one with
    the shorter cut.
    """
    right, down = links
    corners, noise = (
        [values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1]]
        for values in (grid, sigma)
    )
    sides = [right[:-1], down[:, 1:], right[1:], down[:, :-1]]
    cuts = [_hang_together((corners[i], corners[i + 2]), (noise[i], noise[i + 2])) for i in (1, 0)]
    closed = [sides[(i + 1) % 4] & sides[(i + 2) % 4] & cuts[i % 2] for i in range(4)]
    even, odd = closed[0].astype(int) + closed[2], closed[1].astype(int) + closed[3]
    with np.errstate(invalid="ignore"):
        shorter = _length(corners[1] - corners[3]) <= _length(corners[0] - corners[2])
    take_even = (even > odd) | ((even == odd) & shorter)
    taken = [closed[i] & (take_even == (i % 2 == 0)) for i in range(4)]
    return np.asarray(sum(bit.astype(np.uint8) << i for i, bit in enumerate(taken)), np.uint8)


def even_out(grid: Points, surface: GridSurface, window: int) -> Points:
    """Points evened out as by a window of this odd width, but along links alone.

    In a pass each link moves both its ends by a quarter of their difference towards each other,
    which along one direction spreads a point with a variance of 1/2 px^2; a window of 1 + 2 h has
    h (h + 1) / 3.
    """
    half = window // 2
    even = np.nan_to_num(grid)
    for _ in range(round(2 * half * (half + 1) / 3)):
        for axis, linked in ((0, surface.down), (1, surface.right)):
            step = np.diff(even, axis=axis) * (linked / 4)[..., None]
            ahead = np.moveaxis(even, axis, 0)
            ahead[:-1] += np.moveaxis(step, axis, 0)
            ahead[1:] -= np.moveaxis(step, axis, 0)
    return even


def node_normals(grid: Points, cells: Cells) -> Points:
    """Mean over the triangles that meet in a node, each by its area; 0 where none does."""
    points = grid.reshape(-1, 3)
    corners = list_triangles(cells)
    first, second, third = (points[corners[:, i]] for i in range(3))
    areas = np.cross(third - first, second - first)  # towards the camera: x right, y down
    normals = np.zeros_like(points)
    for i in range(3):
        np.add.at(normals, corners[:, i], areas)
    length = np.maximum(_length(normals), np.finfo(np.float64).tiny)
    return np.asarray(normals / length[:, None]).reshape(grid.shape)


def list_triangles(cells: Cells) -> NDArray[np.int64]:
    """``(n, 3)`` node numbers, row by row of the grid, each triangle in the order of its cell."""
    columns = cells.shape[1]
    around = np.array([0, 1, columns + 1, columns])
    return np.concatenate(
        [
            np.flatnonzero(cells.ravel() >> without & 1)[:, None]
            + np.roll(around, -without - 1)[:3]
            for without in range(4)
        ]
    )
