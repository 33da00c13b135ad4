"""A smooth polynomial of three variables that never runs away: what a model leaves, px.

Camera pixel (u, v) and projector coordinate, the latter less a plane over the image, are brought
from a box to [-1, 1] and held there: outside the box the polynomial stays what it is on its faces.
Its terms are products of Chebyshev polynomials ``T_i(a) T_j(b) T_k(c)`` with i + j + k up to the
order, i outermost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Three = tuple[float, float, float]


class Polynomial(NamedTuple):
    """A field as the kernels take it.

    `middle` is the plane over the image that is taken from the coordinate, px and px per px;
    `low` and `high` are the corners of the box.
    """

    order: int
    middle: Three
    low: Three
    high: Three
    coefficients: Array


@kernel
def held(value: float, low: float, high: float) -> float:
    """A value of the box's side from -1 to 1; beyond its ends, the end."""
    return min(max(2 * (value - low) / (high - low) - 1, -1.0), 1.0)


@kernel
def residual_at(u: float, v: float, coordinate: float, field: Polynomial) -> float:
    """The polynomial, px, at camera pixel (u, v) and a projector coordinate; NaN at NaN."""
    order, middle, low, high = field.order, field.middle, field.low, field.high
    apart = coordinate - (middle[0] + middle[1] * u + middle[2] * v)
    a, b, c = held(u, low[0], high[0]), held(v, low[1], high[1]), held(apart, low[2], high[2])
    out, term = 0.0 * coordinate, 0
    ta, na = 1.0, a
    for i in range(order + 1):
        tb, nb = 1.0, b
        for j in range(order + 1 - i):
            tc, nc, line = 1.0, c, 0.0
            for _ in range(order + 1 - i - j):
                line += field.coefficients[term] * tc
                tc, nc = nc, 2 * c * nc - tc
                term += 1
            out += ta * tb * line
            tb, nb = nb, 2 * b * nb - tb
        ta, na = na, 2 * a * na - ta
    return out


@kernel
def residuals_at(places: Array, field: Polynomial, out: Array) -> None:
    """The polynomial, px, at places ``(n, 3)``: u, v and coordinate; into `out` ``(n,)``."""
    for n in range(len(places)):
        out[n] = residual_at(places[n, 0], places[n, 1], places[n, 2], field)


@kernel
def take_residual(coordinate: Floats, field: Polynomial, out: Floats) -> None:
    """Coordinates ``(H, W)``, px, less the polynomial there; NaN stays NaN."""
    height, width = coordinate.shape
    for v in range(height):
        for u in range(width):
            measured = float(coordinate[v, u])
            out[v, u] = measured - residual_at(float(u), float(v), measured, field)
