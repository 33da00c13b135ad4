"""Normal equations of the extended model's fit (the paper's equation 8), summed in one pass.

No Jacobian of all points is kept: only that of a few points at a time.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import inlined, kernel, summing
from fringeworks.kernels.paper_model import (
    Equation,
    extended_ray,
    fraction,
    phase_from_centre,
    turned_ray,
)

Array = NDArray[np.float64]

COLUMNS = ("C1", "C2", "C3", "C4", "Kfp", "Kphi", "Kfc", "Kz")
"""What the depth is differentiated by; Ku0 and Kv0 act through C3 and C4 alone."""

ROWS = len(COLUMNS) + 1
BLOCK = 128
"""Points at a time: their rows stay in the nearest cache."""

Slopes = tuple[float, float, float, float, float, float, float, float, float]


@inlined
def depth_slopes(x: float, y: float, coordinate: float, equation: Equation) -> Slopes:
    """Depth z, mm, then its derivatives by `COLUMNS`."""
    d1, d2 = extended_ray(x, y, equation)
    c, d = turned_ray(d1, d2, equation)
    w = phase_from_centre(coordinate, equation)
    up, down = fraction(w, c, d, equation)
    q = 1 / down
    z = up * q
    by_c1, by_c2 = equation.focal * q, -w * q
    by_c3, by_c4 = -z * by_c1, -z * by_c2
    by_phase = (d * z - equation.b) * q
    along, ahead = equation.along, equation.ahead
    by_d1 = along[0] * by_c3 + ahead[0] * by_c4
    by_d2 = along[1] * by_c3 + ahead[1] * by_c4
    by_focal = -(d1 / equation.x_focal * by_d1 + d2 / equation.y_focal * by_d2)
    by_projector = equation.per_px * (equation.a - c * z) * q
    depth = z + equation.offset
    return depth, by_c1, by_c2, by_c3, by_c4, by_projector, by_phase, by_focal, 1.0


@kernel
def sum_normal_equations(
    rays: Array, coordinates: Array, depths: Array, weights: Array, equation: Equation
) -> Array:
    """``(9, 9)`` lower triangle of the sum of ``w a a^T``, a the slopes, then the residual.

    Slopes are by `COLUMNS`.

    Parameters
    ----------
    rays
        ``(2, n)`` x and y of the calibrated rays (x, y, 1).
    coordinates, depths
        ``(n,)`` projector px and what z should be, mm; the residual is depth less z.
    weights
        ``(n,)`` of the squares, or ``(1,)`` where all count the same.
    """
    rows, out = np.zeros((ROWS, BLOCK)), np.zeros((ROWS, ROWS))
    x, y = rays[0], rays[1]  # whole rows lie one number after the other, and the compiler knows it
    count, same = len(coordinates), len(weights) == 1
    for start in range(0, count, BLOCK):
        some = slice(start, min(start + BLOCK, count))
        _fill_rows(x[some], y[some], coordinates[some], depths[some], equation, rows)
        _weigh_rows(weights if same else weights[some], rows)
        size = some.stop - start
        for i in range(ROWS):
            for j in range(i + 1):
                out[i, j] += _dot(rows[i][:size], rows[j][:size])
    return out


@kernel
def _fill_rows(
    x: Array, y: Array, coordinates: Array, depths: Array, equation: Equation, rows: Array
) -> None:
    c1, c2, c3, c4, kfp, kphi = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    kfc, kz, rest = rows[6], rows[7], rows[8]
    for n in range(len(x)):
        z, c1[n], c2[n], c3[n], c4[n], kfp[n], kphi[n], kfc[n], kz[n] = depth_slopes(
            x[n], y[n], coordinates[n], equation
        )
        rest[n] = depths[n] - z


@kernel
def _weigh_rows(weights: Array, rows: Array) -> None:
    if len(weights) == 1:
        rows *= math.sqrt(weights[0])
        return
    roots = np.sqrt(weights)
    for i in range(len(rows)):
        row = rows[i]
        for n in range(len(roots)):
            row[n] *= roots[n]


@summing
def _dot(a: Array, b: Array) -> float:
    total = 0.0
    for n in range(len(a)):
        total += a[n] * b[n]
    return total


@summing
def sum_squares(rays: Array, coordinates: Array, depths: Array, equation: Equation) -> float:
    """Sum of the squared residuals alone, mm^2, all counting the same."""
    x, y = rays[0], rays[1]
    total = 0.0
    for n in range(len(coordinates)):
        slopes = depth_slopes(x[n], y[n], coordinates[n], equation)
        total += (depths[n] - slopes[0]) ** 2
    return total


@kernel
def slopes_of(rays: Array, coordinates: Array, equation: Equation) -> Array:
    """``(n, 8)`` derivatives by `COLUMNS` at few points ``(2, n)``: to look at, not to fit by."""
    out = np.empty((len(coordinates), len(COLUMNS)))
    for n in range(len(coordinates)):
        slopes = depth_slopes(rays[0, n], rays[1, n], coordinates[n], equation)
        for column in range(len(COLUMNS)):
            out[n, column] = slopes[column + 1]
    return out
