"""The arctangent polynomial against numpy in double precision.

The bound is the methods page's: 5e-7 rad, of which rounding angles near pi to single precision
takes 1.2e-7 and each of the three operations after the polynomial as much again at most.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.kernels.arctangent import arctangent
from fringeworks.kernels.compiled import kernel

BOUND = 5e-7
PI = np.float32(np.pi)

Floats = NDArray[np.float32]


@kernel
def _angles(y: Floats, x: Floats, out: Floats) -> None:
    for i in range(out.size):
        out[i] = arctangent(y[i], x[i])


def angles(y: Floats, x: Floats) -> Floats:
    out = np.empty_like(x)
    _angles(y, x, out)
    return out


def assert_close(found: Floats, y: Floats, x: Floats) -> None:
    """Against numpy at the very arguments that were given, the circle closed at pi."""
    truth = np.arctan2(y.astype(np.float64), x.astype(np.float64))
    error = (found - truth + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(error).max() <= BOUND
    assert found.max() <= PI
    assert found.min() > -PI


# Radii from far below a grey level's rounding to above any image's, and single precision's ends.
@pytest.mark.parametrize("radius", [1e-38, 1e-30, 1e-12, 1e-3, 1.0, 255.0, 65535.0, 1e12, 1e38])
def test_dense_circle(radius: float) -> None:
    around = np.linspace(-np.pi, np.pi, 400_001)
    x, y = (radius * np.cos(around)).astype("f4"), (radius * np.sin(around)).astype("f4")
    assert_close(angles(y, x), y, x)


def test_grid_of_grey_level_sums() -> None:
    side = np.arange(-1020, 1021, 3, dtype=np.float32)
    x, y = (np.ascontiguousarray(part.ravel()) for part in np.meshgrid(side, side))
    assert_close(angles(y, x), y, x)


@pytest.mark.parametrize(
    ("y", "x", "expected"),
    [
        (0.0, 1.0, 0.0),
        (1.0, 0.0, np.pi / 2),
        (0.0, -1.0, np.pi),
        (-1.0, 0.0, -np.pi / 2),
        (1.0, 1.0, np.pi / 4),
        (1.0, -1.0, 3 * np.pi / 4),
        (-1.0, -1.0, -3 * np.pi / 4),
        (-1.0, 1.0, -np.pi / 4),
        (0.0, 0.0, 0.0),
        # Signs of zeros are not looked at: a vector on the negative x axis is at +pi.
        (-0.0, 1.0, 0.0),
        (-0.0, -1.0, np.pi),
        (-0.0, -0.0, 0.0),
        (1.0, -0.0, np.pi / 2),
        # What rounds to -pi is +pi.
        (-1e-9, -1.0, np.pi),
        (-1e-45, -1e30, np.pi),
    ],
)
def test_axes_and_zeros(y: float, x: float, expected: float) -> None:
    found = angles(np.array([y], np.float32), np.array([x], np.float32))
    assert found[0] == pytest.approx(expected, abs=BOUND)
    assert -PI < found[0] <= PI


@pytest.mark.parametrize("finite", [0.0, 1.0, -1.0, 1e38])
@pytest.mark.parametrize("infinite", [np.inf, -np.inf])
def test_one_infinity_is_an_axis(finite: float, infinite: float) -> None:
    y, x = np.array([finite, infinite], np.float32), np.array([infinite, finite], np.float32)
    assert_close(angles(y, x), y, x)


@pytest.mark.parametrize("other", [0.0, 1.0, -1.0, np.inf, -np.inf, np.nan])
def test_nan_stays_nan(other: float) -> None:
    y, x = np.array([np.nan, other], np.float32), np.array([other, np.nan], np.float32)
    assert np.isnan(angles(y, x)).all()


def test_two_infinities_have_no_direction() -> None:
    both = np.array([np.inf, -np.inf, np.inf, -np.inf], np.float32)
    assert np.isnan(angles(both, both[[0, 0, 1, 1]])).all()


finite = st.floats(width=32, allow_nan=False, allow_infinity=False)


@given(y=finite, x=finite)
def test_any_finite_arguments(y: float, x: float) -> None:
    up, across = np.array([y], np.float32), np.array([x], np.float32)
    if y == 0 and x == 0:
        assert angles(up, across)[0] == 0
    else:
        assert_close(angles(up, across), up, across)
