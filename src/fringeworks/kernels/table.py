"""The full model as a table: smooth functions of the pixel, kept on a lattice, cubic in between.

What a pixel's ray and lens distortion make of a coordinate changes slowly from pixel to pixel. So
a few numbers per pixel, known every few pixels, give back the depth without any iteration: the ray
(x, y, 1), the coordinate at a depth of reference, and a *bent line* from there on,
``s (c1 + c2 s + c3 s^2) / (1 + b s)``. Without distortion that is equation (1), with c2 = c3 = 0.

One axis: the bent line is the depth over the coordinate. Two axes: each coordinate is a polynomial
in ``w = s / (1 + b s)``, s the depth from the reference on, which straightens both at once, and the
depth is found by least squares as `triangulate` does.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import Real, kernel
from fringeworks.kernels.lattice import fill_powers, fill_row, first_row
from fringeworks.kernels.triangulate import (
    CONVERGED_MM,
    NEWTON_STEPS,
    across_line,
    correct_depth,
)

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

RAY, LINE = 2, 5
"""Numbers of a node: the ray's x and y, then the coordinate of reference, c1, c2, c3 and b; or,
for two axes, b and then of each coordinate that of reference and c1 to c4."""

NUMBERS = RAY + LINE
PAIR = RAY + 1
"""Where the two axes' numbers begin."""

CURVED = 4
"""Numbers that the fused pass takes as parabolas: the ray, the coordinate of reference and c1."""

ZERO, ONE, TWO, THREE = np.float32(0), np.float32(1), np.float32(2), np.float32(3)
NAN = np.float32(math.nan)


@kernel
def straighten(s: Real, bend: Real) -> Real:
    """``1 / (1 + bend s)``; NaN beyond its pole."""
    below = ONE + bend * s
    return ONE / (below if below > ZERO else NAN)


@kernel
def bent_line(s: Real, c1: Real, c2: Real, c3: Real, share: Real) -> Real:
    """``s (c1 + c2 s + c3 s^2) share``, `share` being ``1 / (1 + bend s)``."""
    return s * (c1 + s * (c2 + s * c3)) * share


@kernel
def bent_slope(line: Real, s: Real, c1: Real, c2: Real, c3: Real, turn: Real) -> Real:
    """Slope of `bent_line` over `share`, its value being `line`; `turn` is ``bend``."""
    return c1 + s * (TWO * c2 + s * (THREE * c3)) - turn * line


@kernel
def polynomial_at(w: float, line: Array) -> tuple[float, float]:
    """``w (c1 + c2 w + c3 w^2 + c4 w^3)`` and its slope, by a pixel's numbers."""
    c1, c2, c3, c4 = line[0], line[1], line[2], line[3]
    slope = c1 + w * (2 * c2 + w * (3 * c3 + w * 4 * c4))
    return w * (c1 + w * (c2 + w * (c3 + w * c4))), slope


@kernel
def solve_pair(
    missed: tuple[float, float],
    lines: tuple[Array, Array],
    bend: float,
    weight: tuple[float, float],
) -> tuple[float, float, float]:
    """Depth from the reference on, its sigma and the residual across the epipolar line.

    `missed` are column and row less those of reference; `lines` their c1 to c4. NaN where the
    iteration does not end.
    """
    first, _ = correct_depth(missed, (lines[0][0], lines[1][0]), weight)
    w = first
    for _ in range(NEWTON_STEPS):
        column, by_column = polynomial_at(w, lines[0])
        row, by_row = polynomial_at(w, lines[1])
        miss, slopes = (missed[0] - column, missed[1] - row), (by_column, by_row)
        step, information = correct_depth(miss, slopes, weight)
        w += step
        share = 1 / (1 - bend * w)
        if abs(step) * share * share < CONVERGED_MM:
            s = w * share if share > 0 else math.nan
            return s, share * share / math.sqrt(information), across_line(miss, slopes)
    return math.nan, math.nan, math.nan


@kernel
def pair_at(
    measured: tuple[float, float], spread: tuple[float, float], pixel: Array
) -> tuple[float, float, float]:
    """`solve_pair` of a pixel's thirteen numbers; NaN where a sigma is."""
    if math.isnan(spread[0] + spread[1]):
        return math.nan, math.nan, math.nan
    column, row = pixel[PAIR:], pixel[PAIR + LINE :]
    return solve_pair(
        (measured[0] - column[0], measured[1] - row[0]),
        (column[1:], row[1:]),
        pixel[RAY],
        (1 / spread[0] ** 2, 1 / spread[1] ** 2),
    )


@kernel
def triangulate_by_table(
    coordinates: NDArray[np.float32],
    sigmas: NDArray[np.float32],
    nodes: Array,
    step: tuple[float, float],
    axis: int,
    depths: tuple[float, float, float],
    xyz: Floats,
    sigma_z: Floats,
    epipolar: Floats,
) -> None:
    """Points, mm, of every camera pixel, as `triangulate` without iteration through lenses.

    `coordinates` and `sigmas` are its; `axis` the table's; `depths` the one of reference and the
    two between which a point is kept.
    """
    _, height, width = coordinates.shape
    numbers, powers = np.empty((nodes.shape[0], width)), np.empty((nodes.shape[0], 4, width))
    first = -1.0
    nan = np.float32(math.nan)
    for v in range(height):
        if first != first_row(v, step[0], nodes.shape[1]):
            first = first_row(v, step[0], nodes.shape[1])
            fill_powers(nodes, step, (first, 0), powers)
        fill_row(powers, v - first, numbers)
        for u in range(width):
            xyz[v, u, 0], xyz[v, u, 1], xyz[v, u, 2] = nan, nan, nan
            sigma_z[v, u], epipolar[v, u] = nan, nan
            pixel = numbers[:, u]
            if axis == 2:
                measured = (float(coordinates[0, v, u]), float(coordinates[1, v, u]))
                spread = (float(sigmas[0, v, u]), float(sigmas[1, v, u]))
                s, sigma, across = pair_at(measured, spread, pixel)
            else:
                at = float(coordinates[axis, v, u]) - pixel[2]
                share = straighten(at, pixel[6])
                s = bent_line(at, pixel[3], pixel[4], pixel[5], share)
                slope = share * bent_slope(s, at, pixel[3], pixel[4], pixel[5], pixel[6])
                sigma, across = abs(slope) * float(sigmas[axis, v, u]), math.nan
            z = depths[0] + s
            if z > depths[1] and z < depths[2] and sigma == sigma:
                xyz[v, u, 0], xyz[v, u, 1], xyz[v, u, 2] = pixel[0] * z, pixel[1] * z, z
                sigma_z[v, u], epipolar[v, u] = sigma, across
