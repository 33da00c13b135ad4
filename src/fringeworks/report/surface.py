"""The surface of a cloud that the interactive view shows.

Thinned to a coarser pixel grid, with normals that are smoothed as far as the noise demands, but
never across a jump.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.geometry.grid import smoothing_window
from fringeworks.geometry.surface import even_out, join_grid, node_normals
from fringeworks.model import Cloud
from fringeworks.report.solid import within_span

MOST_POINTS = 90_000
"""What an office computer still turns smoothly, and a page of one to two megabytes."""

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
    joined = join_grid(grid, sigma)
    even = even_out(grid, joined, smoothing_window(grid, sigma))
    normals = node_normals(even, joined.cells)
    cells = joined.cells | (use[thin] * np.uint8(POINT_BIT))
    return Surface(grid, cells, normals, stride, int(np.count_nonzero(cloud.valid & ~use)))
