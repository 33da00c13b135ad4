from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fringeworks.geometry.minimise import Block, Model, minimise

Array = NDArray[np.float64]
TIMES = np.linspace(0, 4, 40)


def decay(parameters: Array) -> Array:
    height, rate, floor = parameters
    return np.asarray(height * np.exp(-rate * TIMES) + floor)


def blocks_of(measured: Array, parts: int) -> Model:
    """A model in `parts` blocks of the decay's residuals."""

    def model(parameters: Array) -> Iterator[Block]:
        height, rate, _ = parameters
        falling = np.exp(-rate * TIMES)
        jacobian = -np.stack([falling, -height * TIMES * falling, np.ones_like(TIMES)], axis=1)
        residuals = measured - decay(parameters)
        for rows in np.array_split(np.arange(len(TIMES)), parts):
            yield residuals[rows], jacobian[rows], np.arange(3, dtype=np.intp)

    return model


@pytest.mark.parametrize("parts", [1, 4])
@pytest.mark.parametrize("huber", [1.5, 1e6])
def test_the_same_minimum_as_scipy(parts: int, huber: float) -> None:
    rng = np.random.default_rng(8)
    measured = decay(np.array([50.0, 1.3, 4.0])) + rng.normal(0, 1, len(TIMES))
    measured[[3, 20]] += [30.0, -25.0]
    start = np.array([20.0, 0.5, 0.0])
    found = minimise(blocks_of(measured, parts), start, huber=huber)

    def residuals(parameters: Array) -> Array:
        return measured - decay(parameters)

    other = least_squares(residuals, start, loss="huber", f_scale=huber, xtol=1e-12, ftol=1e-14)
    assert found.converged
    np.testing.assert_allclose(found.parameters, other.x, rtol=1e-5)


def test_exact_data_are_met_exactly() -> None:
    truth = np.array([50.0, 1.3, 4.0])
    found = minimise(blocks_of(decay(truth), 2), np.array([30.0, 1.0, 0.0]), huber=2.0)
    assert found.converged
    np.testing.assert_allclose(found.parameters, truth, rtol=1e-8)


def test_what_is_no_number_does_not_converge() -> None:
    measured = np.full(len(TIMES), np.nan)
    found = minimise(blocks_of(measured, 1), np.array([30.0, 1.0, 0.0]), huber=2.0)
    assert not found.converged


def test_a_gradient_that_lies_does_not_converge() -> None:
    def model(parameters: Array) -> Iterator[Block]:
        yield parameters + 5, -np.eye(2), np.arange(2, dtype=np.intp)

    assert not minimise(model, np.zeros(2), huber=10.0).converged
