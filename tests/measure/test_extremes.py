"""Ranges of noise: tables, order statistics drawn at random, and PF and F of pure noise."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.geometry.forms import fit_plane, fit_sphere
from fringeworks.measure.acceptance.extremes import expected_range, rms_range, trimmed_rms
from fringeworks.measure.acceptance.trimming import fit_trimmed
from tests.measure.artefacts import ball_points

SIGMAS = 5
"""Of the mean of a sample, by its own scatter."""


def agrees(sample: NDArray[np.float64], expected: float) -> bool:
    return bool(abs(sample.mean() - expected) < SIGMAS * sample.std() / np.sqrt(len(sample)))


@pytest.mark.parametrize(
    ("count", "factor"), [(2, 1.128), (3, 1.693), (5, 2.326), (10, 3.078), (25, 3.931)]
)
def test_the_factors_of_control_charts(count: int, factor: float) -> None:
    """d2 of any table of Shewhart charts, to its three decimals; of two it is 2 / sqrt(pi)."""
    assert expected_range(count) == pytest.approx(factor, abs=6e-4)


@pytest.mark.parametrize(("count", "left_out"), [(3, 1), (20, 3), (1000, 3), (5000, 15)])
def test_the_farthest_left_out(count: int, left_out: int) -> None:
    rng = np.random.default_rng(count)
    drawn = rng.standard_normal((20_000 if count < 100 else 400, count))
    order = np.argsort(np.abs(drawn), axis=1)[:, : count - left_out]
    ranges = np.ptp(np.take_along_axis(drawn, order, axis=1), axis=1)
    assert agrees(ranges, expected_range(count, left_out))


def test_ten_thousand_points() -> None:
    """7.7 sigma of all, 5.9 of those that stay."""
    assert expected_range(10_000) == pytest.approx(7.7, abs=0.05)
    assert expected_range(10_000, 30) == pytest.approx(5.9, abs=0.05)


def test_the_range_of_deviations_whose_rms_is_known() -> None:
    """Those that stay scatter less than all: their range is told by their own rms."""
    rng = np.random.default_rng(4)
    drawn = np.sort(np.abs(rng.standard_normal((200, 5000))), axis=1)[:, : 5000 - 15]
    rms = float(np.sqrt(np.mean(drawn**2)))
    assert trimmed_rms(5000, 15) == pytest.approx(rms, rel=5 / np.sqrt(2 * drawn.size))
    assert rms_range(0.2 * rms, 5000, 15) == pytest.approx(0.2 * expected_range(5000, 15), rel=0.01)
    assert rms_range(0.2, 5000, 0) == pytest.approx(0.2 * expected_range(5000))


@pytest.mark.parametrize("per_mille", [0.0, 3.0])
def test_a_noisy_ball_has_the_range_of_its_noise(per_mille: float) -> None:
    """PF of pure noise. The fit takes four of 1000 degrees of freedom: 0.2 % of the range."""
    sd, count = 0.1, 1000
    left_out = int(per_mille)
    ranges = np.array(
        [
            fit_trimmed(
                ball_points(count, sd=sd, seed=seed), fit_sphere, per_mille=per_mille
            ).fit.range_mm
            for seed in range(100)
        ]
    )
    assert agrees(ranges, sd * expected_range(count, left_out) * np.sqrt(1 - 4 / count))


@pytest.mark.parametrize("per_mille", [0.0, 3.0])
def test_a_noisy_flat_has_the_range_of_its_noise(per_mille: float) -> None:
    """F of pure noise, likewise with three."""
    sd, count = 0.1, 2000
    left_out = int(2 * per_mille)
    rng = np.random.default_rng(1)
    ranges = []
    for _ in range(300):
        points = rng.uniform(0, 100, (count, 3)) * (1, 1, 0)
        points[:, 2] = 500 + sd * rng.standard_normal(count)
        ranges.append(fit_trimmed(points, fit_plane, per_mille=per_mille).fit.flatness_mm)
    expected = sd * expected_range(count, left_out) * np.sqrt(1 - 3 / count)
    assert agrees(np.array(ranges), expected)


def test_what_has_no_range() -> None:
    with pytest.raises(UsageError, match="left_out must be 0 to 8 of 10 deviations, got 9"):
        expected_range(10, 9)
    with pytest.raises(UsageError, match="left_out must be"):
        expected_range(10, -1)
