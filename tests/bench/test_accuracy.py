"""The deterministic metrics stay within their bars."""

import pytest

from fringeworks.bench.accuracy import STEPS, measure_accuracy
from fringeworks.bench.metric import Metric


@pytest.fixture(scope="module")
def metrics() -> dict[str, Metric]:
    return {metric.key: metric for metric in measure_accuracy(quick=True)}


def value_of(metrics: dict[str, Metric], key: str) -> float:
    value = metrics[key].value
    assert value is not None
    return value


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("kind", ["of_bound", "predicted"])
def test_phase_noise_is_the_bound_and_is_predicted(
    metrics: dict[str, Metric], steps: int, kind: str
) -> None:
    # Bar 3 %. Chance is 1 / sqrt(2 * 256 * 1024) = 0.14 %, so the bar lies at 20 sigma.
    assert value_of(metrics, f"accuracy.sigma_phi.{steps}_steps.{kind}") == pytest.approx(
        1, abs=0.03
    )


def test_no_order_is_wrong_and_nearly_none_void(metrics: dict[str, Metric]) -> None:
    # Void are residuals beyond five sigma: 6e-7 of the pixels of each of three sets.
    assert value_of(metrics, "accuracy.orders.wrong") == 0
    assert value_of(metrics, "accuracy.orders.void") < 1e-4


def test_arctangent_is_within_its_bar(metrics: dict[str, Metric]) -> None:
    assert 0 < value_of(metrics, "accuracy.arctangent.max_error") <= 5e-7


def test_a_second_run_gives_the_same_numbers(metrics: dict[str, Metric]) -> None:
    again = {metric.key: metric for metric in measure_accuracy(quick=True)}
    assert again == metrics
