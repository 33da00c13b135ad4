from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.calibrate.local_fit import LocalFit, fit_local

Array = NDArray[np.float64]
SIZE = 61
CENTRE = np.array([30.3, 29.6])


def surface(terms: tuple[float, ...]) -> Array:
    """A quadratic map about `CENTRE`: value, slopes and curvatures, per px."""
    y, x = np.mgrid[:SIZE, :SIZE].astype(float)
    x, y = x - CENTRE[0], y - CENTRE[1]
    basis = (np.ones_like(x), x, y, x * x, x * y, y * y)
    return np.asarray(sum(a * b for a, b in zip(terms, basis, strict=True)))


def fit(values: Array, *, sigma: float = 0.05, radius: float = 20.0) -> LocalFit:
    return fit_local(values, np.full(values.shape, sigma), at=CENTRE, radius=radius)


slopes = st.floats(-3, 3)
curvatures = st.floats(-2e-3, 2e-3)
quadratics = st.tuples(st.floats(0, 1000), slopes, slopes, curvatures, curvatures, curvatures)


@given(quadratics)
def test_quadratic_is_exact(terms: tuple[float, ...]) -> None:
    found = fit(surface(terms))
    assert found.value == pytest.approx(terms[0], abs=1e-8)
    assert found.support == pytest.approx(1.0)
    assert found.imbalance < 0.02


@given(quadratics)
def test_plane_is_exact_with_half_the_window_void(terms: tuple[float, ...]) -> None:
    values = surface((*terms[:3], 0.0, 0.0, 0.0))
    values[:, 30:] = np.nan
    found = fit(values)
    assert found.value == pytest.approx(terms[0], abs=1e-7)
    assert found.imbalance == pytest.approx(4 / (3 * np.pi), abs=0.05)  # of a half disc
    assert found.support == pytest.approx(0.5, abs=0.05)


@given(quadratics, st.integers(0, 10_000))
def test_thirty_percent_outliers_do_not_move_it(terms: tuple[float, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    noisy = surface(terms) + rng.normal(0, 0.05, (SIZE, SIZE))
    wrong = rng.random((SIZE, SIZE)) < 0.3
    spoilt = np.where(wrong, noisy + rng.uniform(2, 300, (SIZE, SIZE)), noisy)
    found = fit(spoilt)
    # 1257 pixels, 70 % of them good: a quadratic's centre has 3 sigma / sqrt(n) at the most
    assert found.value == pytest.approx(terms[0], abs=5 * 3 * 0.05 / np.sqrt(0.7 * 1257))
    assert found.support == pytest.approx(0.7, abs=0.1)


@pytest.mark.parametrize("offset", [5.0, 60.0, -300.0])
def test_a_quarter_with_another_code_does_not_move_it(offset: float) -> None:
    """Wrong bits come in patches, which pull harder than scattered ones."""
    truth = surface((400.0, 0.6, -0.2, 1e-4, 0.0, -1e-4))
    spoilt = truth + np.random.default_rng(1).normal(0, 0.05, truth.shape)
    spoilt[31:, 31:] += offset
    spoilt[:31, 50:] -= offset / 2
    found = fit(spoilt)
    assert found.value == pytest.approx(400.0, abs=0.03)
    assert found.support == pytest.approx(0.75, abs=0.1)


def test_predicted_sigma_is_the_sampled_one() -> None:
    rng = np.random.default_rng(3)
    truth = surface((500.0, 0.6, 0.1, 1e-4, 0.0, -2e-4))
    fits = [fit(truth + rng.normal(0, 0.05, truth.shape)) for _ in range(200)]
    errors = np.array([one.value - 500.0 for one in fits])
    predicted = np.mean([one.sigma for one in fits])
    # sd of a sampled sd over 200 draws is 5 %; Tukey's estimator is 5 % less efficient
    assert errors.std() / predicted == pytest.approx(1.0, abs=0.27)


def test_gray_code_cells_come_out_between_their_steps() -> None:
    truth = surface((500.3, 0.55, 0.02, 0.0, 0.0, 0.0))
    found = fit(np.rint(truth), sigma=1 / np.sqrt(12))
    assert found.value == pytest.approx(500.3, abs=0.05)


def test_weights_follow_sigma() -> None:
    values = surface((100.0, 0.5, 0.0, 0.0, 0.0, 0.0))
    sigma = np.full(values.shape, 0.01)
    poor = np.indices(values.shape).sum(axis=0) % 2 == 0
    values[poor] += np.random.default_rng(0).normal(0, 1.0, poor.sum())
    sigma[poor] = 1.0
    found = fit_local(values, sigma, at=CENTRE, radius=20.0)
    assert found.value == pytest.approx(100.0, abs=2e-3)


@pytest.mark.parametrize("valid", [0, 5, 11])
def test_too_few_pixels_give_nan(valid: int) -> None:
    values = np.full((SIZE, SIZE), np.nan)
    values[30, 25 : 25 + valid] = 1.0
    found = fit(values)
    assert np.isnan(found.value)
    assert found.support == 0


def test_a_line_of_pixels_gives_nan() -> None:
    values = np.full((SIZE, SIZE), np.nan)
    values[30] = 1.0
    assert np.isnan(fit(values).value)


def test_a_window_beyond_the_image_is_cut() -> None:
    values = surface((100.0, 0.5, 0.1, 0.0, 0.0, 0.0))
    found = fit_local(values, np.full(values.shape, 0.1), at=np.array([2.0, 30.0]), radius=20.0)
    assert found.value == pytest.approx(100.0 + 0.5 * (2 - CENTRE[0]) + 0.1 * (30 - CENTRE[1]))
    assert found.support < 0.6
