"""The surface behind an organised cloud: neighbouring pixels joined wherever it does not jump.

What the interactive view shows: thinned to a coarser pixel grid, with normals that are smoothed as
far as the noise demands, but never across a jump.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.model import Cloud
from fringeworks.report.solid import smoothing_window, within_span

MOST_POINTS = 90_000
"""What an office computer still turns smoothly, and a page of one to two megabytes."""

STEEPEST = float(np.tan(np.deg2rad(80.0)))
"""A surface seen flatter than 10 degrees sends too little light back to be measured: what looks
steeper is a jump."""

JUMP_SIGMAS = 5.0
"""Steps along the line of sight that noise makes by itself."""

POINT_BIT = 16
"""Mark of a grid node that holds a point; bits 0 to 3 are the triangles of its cell."""

Points = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Surface:
    """The thinned cloud.

    Attributes
    ----------
    grid
        ``(rows, columns, 3)`` mm, NaN where void.
    cells
        ``(rows, columns)`` uint8: `POINT_BIT` where the node holds a point, and bit i where the
        triangle without corner i of the cell to the lower right of it is closed. Corners go
        round the cell from its upper left one, to the right, then down.
    normals
        ``(rows, columns, 3)`` of length 1, towards the camera; 0 where no triangle is.
    stride
        Every so manyeth pixel of the camera.
    left_out
        Points of the whole cloud that lie far outside the span of nearly all.
    """

    grid: Points
    cells: NDArray[np.uint8]
    normals: Points
    stride: int
    left_out: int

    @property
    def valid(self) -> Mask:
        return np.asarray(self.cells & POINT_BIT, dtype=bool)


@dataclass(frozen=True, slots=True)
class _Links:
    """Whether a node hangs together with the next one along its row, and down its column."""

    right: Mask
    down: Mask


def find_surface(cloud: Cloud, *, most: int = MOST_POINTS) -> Surface:
    """Thin a cloud to at most so many points and join neighbours where it does not jump.

    Raises
    ------
    UsageError
        The cloud has no points.
    """
    if not cloud.valid.any():
        raise UsageError("cloud must have points to be shown, got none")
    use = within_span(cloud.xyz)
    stride = 1
    while np.count_nonzero(use[::stride, ::stride]) > most:
        stride += 1
    thin = np.s_[::stride, ::stride]
    grid = np.where(use[thin][..., None], cloud.xyz[thin].astype(np.float64), np.nan)
    sigma = cloud.sigma_mm[thin].astype(np.float64)
    noise = np.nan_to_num(sigma)
    links = _Links(
        _hang_together((grid[:, :-1], grid[:, 1:]), (noise[:, :-1], noise[:, 1:])),
        _hang_together((grid[:-1], grid[1:]), (noise[:-1], noise[1:])),
    )
    cells = use[thin] * np.uint8(POINT_BIT)
    cells[:-1, :-1] |= _find_triangles(grid, noise, links)
    normals = _find_normals(_smooth(grid, links, smoothing_window(grid, sigma)), cells)
    return Surface(grid, cells, normals, stride, int(np.count_nonzero(cloud.valid & ~use)))


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


def _find_triangles(grid: Points, sigma: Points, links: _Links) -> NDArray[np.uint8]:
    """Bits 0 to 3 of every cell, ``(rows - 1, columns - 1)``.

    Of the two ways to halve a cell the one that closes more of it is taken, then the one with
    the shorter cut.
    """
    corners, noise = (
        [values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1]]
        for values in (grid, sigma)
    )
    sides = [links.right[:-1], links.down[:, 1:], links.right[1:], links.down[:, :-1]]
    cuts = [_hang_together((corners[i], corners[i + 2]), (noise[i], noise[i + 2])) for i in (1, 0)]
    closed = [sides[(i + 1) % 4] & sides[(i + 2) % 4] & cuts[i % 2] for i in range(4)]
    even, odd = closed[0].astype(int) + closed[2], closed[1].astype(int) + closed[3]
    with np.errstate(invalid="ignore"):
        shorter = _length(corners[1] - corners[3]) <= _length(corners[0] - corners[2])
    take_even = (even > odd) | ((even == odd) & shorter)
    taken = [closed[i] & (take_even == (i % 2 == 0)) for i in range(4)]
    return np.asarray(sum(bit.astype(np.uint8) << i for i, bit in enumerate(taken)), np.uint8)


def _smooth(grid: Points, links: _Links, window: int) -> Points:
    """Points evened out as by a window of this odd width, but along links alone.

    In a pass each link moves both its ends by a quarter of their difference towards each other,
    which along one direction spreads a point with a variance of 1/2 px^2; a window of 1 + 2 h has
    h (h + 1) / 3.
    """
    half = window // 2
    even = np.nan_to_num(grid)
    for _ in range(round(2 * half * (half + 1) / 3)):
        for axis, linked in ((0, links.down), (1, links.right)):
            step = np.diff(even, axis=axis) * (linked / 4)[..., None]
            ahead = np.moveaxis(even, axis, 0)
            ahead[:-1] += np.moveaxis(step, axis, 0)
            ahead[1:] -= np.moveaxis(step, axis, 0)
    return even


def _find_normals(grid: Points, cells: NDArray[np.uint8]) -> Points:
    """Mean over the triangles that meet in a node, each by its area."""
    points = grid.reshape(-1, 3)
    corners = _list_triangles(cells)
    first, second, third = (points[corners[:, i]] for i in range(3))
    areas = np.cross(third - first, second - first)  # towards the camera: x right, y down
    normals = np.zeros_like(points)
    for i in range(3):
        np.add.at(normals, corners[:, i], areas)
    length = np.maximum(_length(normals), np.finfo(np.float64).tiny)
    return np.asarray(normals / length[:, None]).reshape(grid.shape)


def _list_triangles(cells: NDArray[np.uint8]) -> NDArray[np.int64]:
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
