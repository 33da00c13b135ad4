"""The residual polynomial against numpy's Chebyshev series, held on the faces of its box."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebval3d
from numpy.typing import NDArray

from fringeworks.kernels.residual import Polynomial, residual_at, residuals_at, take_residual
from fringeworks.model.residual import count_terms

Array = NDArray[np.float64]

MIDDLE, LOW, HIGH = (120.0, 0.6, -0.05), (0.0, 0.0, -60.0), (751.0, 479.0, 40.0)
INSIDE = np.array([[0.0, 0.0, 90.0], [300.5, 200.0, 285.0], [751.0, 479.0, 560.0]])


def polynomial(order: int) -> Polynomial:
    terms = np.random.default_rng(order).normal(size=count_terms(order))
    return Polynomial(order, MIDDLE, LOW, HIGH, terms)


def evaluate(places: Array, field: Polynomial) -> Array:
    out = np.empty(len(places))
    residuals_at(places, field, out)
    return out


def by_numpy(places: Array, field: Polynomial) -> Array:
    """The same from a cube of coefficients in which only low total degrees are not zero."""
    cube = np.zeros((field.order + 1,) * 3)
    spans = range(field.order + 1)
    low = [(i, j, k) for i in spans for j in spans for k in spans if i + j + k <= field.order]
    cube[tuple(np.array(low).T)] = field.coefficients
    u, v, coordinate = places.T
    apart = coordinate - (MIDDLE[0] + MIDDLE[1] * u + MIDDLE[2] * v)
    corners = np.array([LOW, HIGH])
    a, b, c = (2 * (np.array([u, v, apart]).T - corners[0]) / (corners[1] - corners[0]) - 1).T
    return np.asarray(chebval3d(a, b, c, cube))


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_it_is_a_sum_of_chebyshev_products(order: int) -> None:
    field = polynomial(order)
    # sums of up to 56 terms of size one
    np.testing.assert_allclose(evaluate(INSIDE, field), by_numpy(INSIDE, field), atol=1e-13)


def test_outside_it_stays_what_it_is_on_the_face() -> None:
    """The third variable is the coordinate less the plane, whatever u and v are held at."""
    field = polynomial(4)
    outside = np.array(
        [[300.5, 200.0, 1e4], [300.5, -50.0, 285.0 + 0.05 * 50], [900.0, 0.0, 700.0]]
    )
    faces = np.array([[300.5, 200.0, 290.3 + 40], [300.5, 0.0, 285.0], [751.0, 0.0, 610.6]])
    faces[0, 2] = MIDDLE[0] + MIDDLE[1] * 300.5 + MIDDLE[2] * 200 + HIGH[2]
    faces[1, 2] = outside[1, 2] + MIDDLE[2] * 50
    faces[2, 2] = 700.0 - MIDDLE[1] * 149
    np.testing.assert_allclose(evaluate(outside, field), evaluate(faces, field), atol=1e-12)
    assert abs(residual_at(300.5, 200.0, 1e9, field)) < 100


def test_it_is_taken_from_a_map_and_void_stays_void() -> None:
    field = polynomial(3)
    coordinate = np.full((3, 4), 285.0, np.float32)
    coordinate[1, 2] = np.nan
    out = np.empty_like(coordinate)
    take_residual(coordinate, field, out)
    assert np.isnan(out).sum() == 1
    assert np.isnan(out[1, 2])
    expected = 285.0 - residual_at(3.0, 2.0, 285.0, field)
    assert out[2, 3] == np.float32(expected)
