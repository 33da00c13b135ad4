"""Speed metrics come about; times themselves depend on the machine and are not judged."""

from collections.abc import Callable

import numpy as np
import pytest

from fringeworks.bench import speed
from fringeworks.bench.metric import Metric
from fringeworks.bench.peers import PEERS, Peer, Phase, fringes_package, numpy_float64, opencv_psp
from fringeworks.bench.timing import Race, race
from fringeworks.errors import DecodeError, MissingExtraError
from fringeworks.model import Frames
from fringeworks.phase.demodulate import wrap_three_steps

SIZE = (64, 48)


@pytest.fixture(scope="module")
def metrics() -> list[Metric]:
    return speed.measure_size(SIZE, seconds=0.01)


def test_every_peer_is_set_beside_both_of_ours(metrics: list[Metric]) -> None:
    keys = [metric.key for metric in metrics]
    for peer in PEERS:
        for ours in ("wrap", "demodulate"):
            assert f"speed.64x48.{ours}_vs_{peer.name}" in keys
    assert len(set(keys)) == len(keys)


def test_a_value_is_positive_or_its_absence_explained(metrics: list[Metric]) -> None:
    for metric in metrics:
        if metric.value is None:
            assert metric.note.startswith("skipped: ")
        else:
            assert metric.value > 0


@pytest.mark.parametrize("prepare", [numpy_float64, opencv_psp, fringes_package])
def test_an_installed_peer_gives_our_phase(
    prepare: Callable[[Frames], Callable[[], Phase]],
) -> None:
    frames = speed.three_steps((512, 256))
    try:
        theirs = prepare(frames)()
    except MissingExtraError as error:
        pytest.skip(str(error))
    assert speed.phase_difference(theirs, wrap_three_steps(frames)) < 0.1


def test_a_peer_with_another_sign_is_not_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    def mirrored(frames: Frames) -> Callable[[], Phase]:
        return lambda: -wrap_three_steps(frames)

    monkeypatch.setattr(speed, "PEERS", (Peer("mirrored", mirrored, 1e-6),))
    with pytest.raises(DecodeError, match="mirrored gives another phase than ours"):
        speed.measure_size(SIZE, seconds=0.01)


def test_a_missing_peer_is_skipped_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(frames: Frames) -> Callable[[], Phase]:
        raise MissingExtraError("not here")

    monkeypatch.setattr(speed, "PEERS", (Peer("absent", absent, 1e-6),))
    (metric,) = (m for m in speed.measure_size(SIZE, seconds=0.01) if m.key.endswith("p_vs_absent"))
    assert (metric.value, metric.note) == (None, "skipped: not here")


def test_phase_difference_knows_turns() -> None:
    first = np.array([np.pi, 0.0])
    second = np.array([-np.pi, 0.2])
    assert speed.phase_difference(first, second) == pytest.approx(0.2 / np.sqrt(2))


def test_a_race_takes_turns_after_a_warm_up() -> None:
    calls: list[str] = []
    result = race(lambda: calls.append("a"), lambda: calls.append("b"), seconds=0.0, turns=(3, 10))
    assert "".join(calls) == "ab" * 4
    assert len(result.ours) == len(result.theirs) == 3


def test_a_ratio_is_the_median_over_turns() -> None:
    result = Race(np.array([1.0, 2.0, 4.0]), np.array([3.0, 8.0, 40.0]))
    assert result.ratio == 4.0
    assert result.best_ratio == 3.0
