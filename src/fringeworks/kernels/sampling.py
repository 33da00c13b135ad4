"""Reading a coarse grid at every pixel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Array = NDArray[np.float64]


@kernel
def split(place: float, count: int) -> tuple[int, float]:
    """The cell of a grid of `count` nodes in which a place lies, and how far along; held inside."""
    cell = min(max(math.floor(place), 0), count - 2)
    return cell, place - cell


@kernel
def on_line(values: Array, share: float) -> float:
    """Between the two first values."""
    return float(values[0] + share * (values[1] - values[0]))


@kernel
def read_sigma(
    depth: NDArray[np.float32],
    grid: Array,
    start: tuple[float, float, float],
    per: tuple[float, float, float],
    scale: float,
    out: NDArray[np.float32],
) -> None:
    """Standard deviations of depths, from variances on a grid of 1 / z, row and column.

    Parameters
    ----------
    depth
        ``(H, W)`` mm; NaN where void.
    grid
        ``(S, R, C)``, two nodes and more each way: variance of the depth over z^4, 1 / mm^2.
        Read linearly between its nodes.
    start, per
        1 / z, row and column of the first node, and nodes per unit of each.
    scale
        Relative standard deviation of all lengths, which adds in quadrature.
    out
        ``(H, W)`` mm; NaN where void.
    """
    height, width = depth.shape
    inverses, rows, columns = grid.shape
    for v in range(height):
        j, along_v = split((v - start[1]) * per[1], rows)
        for u in range(width):
            z = float(depth[v, u])
            if math.isnan(z):
                out[v, u] = np.float32(math.nan)
                continue
            i, along_z = split((1 / z - start[0]) * per[0], inverses)
            k, along_u = split((u - start[2]) * per[2], columns)
            near = on_line(grid[i, j, k : k + 2], along_u)
            near += along_v * (on_line(grid[i, j + 1, k : k + 2], along_u) - near)
            far = on_line(grid[i + 1, j, k : k + 2], along_u)
            far += along_v * (on_line(grid[i + 1, j + 1, k : k + 2], along_u) - far)
            share = near + along_z * (far - near)
            out[v, u] = np.float32(math.sqrt(max(share, 0.0) * z**4 + (scale * z) ** 2))
