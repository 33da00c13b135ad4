"""Smooth functions of the camera's pixel, kept on a lattice of nodes, cubic in between.

Rows are interpolated first: between two lattice rows every number of a column is a cubic of the
image row, so that a pixel costs one polynomial per number.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Array = NDArray[np.float64]

STENCIL = 4
HALF_STEP = 0.5

BLOCK = 16
"""Rows over which the fused pass takes cubics of the row as parabolas, or as straight."""


@kernel
def stencil_at(place: float, count: int) -> tuple[int, float]:
    """First of the four of `count` nodes about a place, in steps, and how far behind it is."""
    first = min(max(math.floor(place) - 1, 0), count - STENCIL)
    return first, place - first


@kernel
def first_row(v: int, step: float, rows: int) -> float:
    """The image row from which `fill_powers` counts those of the lattice cell about row `v`."""
    return min(int(v / step), rows - 2) * step


@kernel
def fill_powers(
    nodes: Array,
    step: tuple[float, float],
    first: tuple[float, int],
    powers: NDArray[np.floating],
) -> None:
    """Coefficients ``(K, 4, n)`` by which all numbers are cubics of the row, for n columns.

    `first` is the image row from which the cubics count, and the first column.

    Parameters
    ----------
    nodes
        ``(K, rows, cols)``.
    step
        Of the lattice, px, down and across.
    """
    numbers, rows, cols = nodes.shape
    upper, behind = stencil_at(first[0] / step[0] + HALF_STEP, rows)
    line, of_rows = np.empty((STENCIL, cols)), np.empty(STENCIL)
    of_cell = np.empty(STENCIL, powers.dtype)
    for k in range(numbers):
        for n in range(cols):
            column = nodes[k, upper : upper + STENCIL, n]
            cubic_powers(column, behind - HALF_STEP, 1 / step[0], of_rows)
            line[:, n] = of_rows
        for power in range(STENCIL):
            fill_line(line[power], (step[1], first[1]), of_cell, powers[k, power])


@kernel
def fill_line(
    nodes: Array, place: tuple[float, int], of_cell: NDArray[np.floating], out: NDArray[np.floating]
) -> None:
    """Cubic interpolation of nodes to pixels; `of_cell` is worked in.

    `place` is the nodes' distance, px, and the first pixel of `out`.
    """
    step, first = place
    cols, begin = nodes.size, 0
    for cell in range(cols - 1):
        end = out.size if cell == cols - 2 else math.ceil((cell + 1) * step) - first
        end = min(end, out.size)
        if begin < end:
            m, at = stencil_at((begin + first) / step, cols)
            cubic_powers(nodes[m : m + STENCIL], at, 1 / step, of_cell)
            fill_cell(of_cell, out[begin:end])
            begin = end


@kernel
def fill_row(powers: NDArray[np.floating], down: float, out: NDArray[np.floating]) -> None:
    """Numbers ``(K, W)`` of the image row that is `down` px behind the powers' first."""
    step = np.empty(1, out.dtype)
    step[0] = down
    t = step[0]
    for k in range(out.shape[0]):
        c0, c1, c2, c3 = powers[k, 0], powers[k, 1], powers[k, 2], powers[k, 3]
        line = out[k]
        for n in range(line.size):
            line[n] = c0[n] + t * (c1[n] + t * (c2[n] + t * c3[n]))


@kernel
def cubic_powers(nodes: Array, at: float, step: float, powers: NDArray[np.floating]) -> None:
    """Coefficients by powers of n of the cubic through nodes at 0, 1, 2, 3, at ``at + n step``."""
    d1, d2 = nodes[1] - nodes[0], (nodes[2] - 2 * nodes[1] + nodes[0]) / 2
    d3 = (nodes[3] - 3 * nodes[2] + 3 * nodes[1] - nodes[0]) / 6
    powers[0] = nodes[0] + at * (d1 + (at - 1) * (d2 + (at - 2) * d3))
    powers[1] = step * (d1 + (2 * at - 1) * d2 + (3 * at * at - 6 * at + 2) * d3)
    powers[2] = step**2 * (d2 + (3 * at - 3) * d3)
    powers[3] = step**3 * d3


@kernel
def fill_cell(powers: NDArray[np.floating], out: NDArray[np.floating]) -> None:
    """A cubic at 0, 1, 2, ..."""
    c0, c1, c2, c3 = powers[0], powers[1], powers[2], powers[3]
    for n in range(out.size):
        t = np.float32(n)
        out[n] = c0 + t * (c1 + t * (c2 + t * c3))


@kernel
def middle_of(v: int) -> float:
    """The middle of the block of rows that holds row `v`."""
    return float(v // BLOCK * BLOCK) + (BLOCK - 1) / 2
