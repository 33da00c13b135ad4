"""The table's formulas by closed forms: bent lines, polynomials, the lattice between its nodes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fringeworks.kernels.lattice import fill_powers, fill_row, first_row, stencil_at
from fringeworks.kernels.table import bent_line, bent_slope, polynomial_at, straighten
from fringeworks.kernels.table_fit import fit_bent_line, fit_polynomial

small = st.floats(-0.5, 0.5)


@given(c1=st.floats(0.5, 2), c2=small, c3=small, bend=st.floats(0.05, 0.3))
def test_a_bent_line_is_found_again(c1: float, c2: float, c3: float, bend: float) -> None:
    """Through four of its points, to rounding times the fit's condition."""
    assume(abs(c1 * bend**3 - c2 * bend**2 + c3 * bend) > 1e-2)  # else a polynomial: no bend
    s, found = np.array([-1.0, -0.4, 0.5, 1.2]), np.empty(4)
    fit_bent_line(s, bent_line(s, c1, c2, c3, 1 / (1 + bend * s)), found)
    np.testing.assert_allclose(found, [c1, c2, c3, bend], atol=1e-9)


@given(coefficients=st.lists(small, min_size=4, max_size=4))
def test_a_polynomial_is_found_again(coefficients: list[float]) -> None:
    s, found = np.array([-1.0, -0.4, 0.5, 1.2]), np.empty(4)
    fit_polynomial(s, s * np.polyval(coefficients[::-1], s), found)
    np.testing.assert_allclose(found, coefficients, atol=1e-12)


@given(s=st.floats(-2, 2), c1=small, c2=small, c3=small, bend=st.floats(-0.3, 0.3))
def test_slopes_are_derivatives(s: float, c1: float, c2: float, c3: float, bend: float) -> None:
    """Against central differences, whose error is of the third derivative times h^2 / 6."""
    h = 1e-4

    def line(at: float) -> float:
        return float(bent_line(at, c1, c2, c3, straighten(at, bend)))

    slope = straighten(s, bend) * bent_slope(line(s), s, c1, c2, c3, bend)
    assert slope == pytest.approx((line(s + h) - line(s - h)) / (2 * h), abs=1e-6)
    numbers = np.array([c1, c2, c3, bend])
    _, slope = polynomial_at(s, numbers)
    ends = [polynomial_at(s + d, numbers)[0] for d in (-h, h)]
    assert slope == pytest.approx((ends[1] - ends[0]) / (2 * h), abs=1e-6)


def test_there_is_nothing_beyond_the_pole() -> None:
    assert straighten(4.0, -0.2) == pytest.approx(5.0)
    assert math.isnan(straighten(5.0, -0.2))
    assert math.isnan(straighten(6.0, -0.2))


def test_stencils_stay_on_the_lattice() -> None:
    assert stencil_at(0.0, 6) == (0, 0.0)
    assert stencil_at(2.5, 6) == (1, 1.5)
    assert stencil_at(5.0, 6) == (2, 3.0)


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("begin", [0, 37])
def test_cubics_are_interpolated_exactly(kind: type, begin: int) -> None:
    """A cubic of row and column, at every pixel, whichever cell it lies in."""
    step, rows, cols, width, height = (8.0, 7.25), 7, 9, 59, 49

    def cubic(v: Any, u: Any) -> Any:
        return 1 + 0.1 * v - 0.2 * u + 1e-3 * u * v + 1e-5 * v**3 - 2e-5 * u**3

    nodes = cubic(step[0] * np.arange(rows)[:, None], step[1] * np.arange(cols))[None]
    n = width - begin
    powers: Any = np.empty((1, 4, n), kind)
    out: Any = np.empty((1, n), kind)
    for v in range(height):
        first = first_row(v, step[0], rows)
        assert first <= v
        fill_powers(nodes, step, (first, begin), powers)
        fill_row(powers, v - first, out)
        expected = cubic(float(v), np.arange(begin, width, dtype=float))
        rounding = 1e-11 if kind is np.float64 else 1e-5
        np.testing.assert_allclose(out[0], expected, atol=rounding)
