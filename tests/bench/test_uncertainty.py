"""Clouds tell their own uncertainty: small forms of the metrics, within their bars."""

from __future__ import annotations

import pytest

from fringeworks.bench.uncertainty import PERIODS_PX, STEPS, sigma_z, systematic_coverage


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("period", PERIODS_PX)
def test_predicted_sigma_of_z_is_the_observed_one(steps: int, period: float) -> None:
    """22560 pixels tell it to 0.5 %; the lamp's flicker, 0.3 % of each frame, is not in it."""
    metric = sigma_z(steps, period)
    assert metric.key == f"accuracy.sigma_z.{steps}_steps_{period:g}_px.predicted"
    assert metric.value == pytest.approx(1, abs=0.1)


def test_coverage_counts_every_point() -> None:
    """Of four calibrations; about 12 independent errors scatter the share by 6 %."""
    metric = systematic_coverage(4)
    assert metric.value is not None
    assert 0.75 < metric.value <= 1
    assert "4 calibrations" in metric.note
