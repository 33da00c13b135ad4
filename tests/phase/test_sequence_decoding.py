"""Which start a region's letters say: by hand, and against every start tried one by one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.model import Fringe, Noise, UnwrappedPhase, WrappedPhase
from fringeworks.phase.sequence_decoding import (
    LEAST_NATS,
    OUTSIDE_NATS,
    Evidence,
    Starts,
    admissible_starts,
    doubt_fringes,
    find_starts,
    gather_evidence,
    place_regions,
)
from fringeworks.phase.window import CoordinateWindow

FRINGE = Fringe("x", 10.0, (0.0, 1.0, 2.0), zero_px=0.0)


def unwrapped_of(turns: NDArray[np.int_], region: NDArray[np.int_]) -> UnwrappedPhase:
    """Phase zero everywhere, NaN where the region is negative."""
    flat = np.where(region < 0, np.nan, 0.0).astype(np.float32)
    void = np.zeros(region.shape, np.uint8)
    wrapped = WrappedPhase(
        FRINGE, flat, flat, flat, flat, flat, Noise(1.0, 0.0, 0.0, "camera"), void
    )
    count = int(region.max(initial=-1)) + 1
    return UnwrappedPhase(wrapped, turns.astype(np.int32), region.astype(np.int32), count)


def evidence_of(letters: list[list[list[float]]], lowest: list[int]) -> Evidence:
    table = np.array(letters)
    return Evidence(table, np.full(table.shape[:2], 3), np.array(lowest))


def test_evidence_is_summed_by_fringe() -> None:
    turns = np.array([[-2, -2, -1, 5, 5, 0]])
    region = np.array([[0, 0, 0, 1, 1, -1]])
    letters = np.array([[[1.0, 2, 4, 8, np.nan, 99]], [[0, 0, 1, 0, 0, 99]]])
    found = gather_evidence(unwrapped_of(turns, region), letters)
    assert found.lowest.tolist() == [-2, 5]
    assert found.pixels.tolist() == [[2, 1], [2, 0]]
    assert found.letters[..., 0].tolist() == [[3, 4], [8, 0]]
    assert found.letters[..., 1].tolist() == [[0, 1], [0, 0]]


def test_two_fringes_by_hand() -> None:
    """Letters 0 then 1 stand at order 2 alone in 1 0 0 1 1; turn zero is one below the lowest."""
    evidence = evidence_of([[[0.0, -9.0], [-9.0, 0.0]]], [1])
    starts = find_starts(evidence, np.array([1, 0, 0, 1, 1]))
    assert starts.order.tolist() == [1]
    # Second: 0 0 (orders 1, 2) or 1 1 (3, 4), one letter wrong.
    assert starts.lead.tolist() == [9.0]


def test_shortfall_by_hand() -> None:
    """Letters 0 then 1 where only 0 0 and 1 0 can follow: one of two fringes falls short by 9."""
    evidence = evidence_of([[[0.0, -9.0], [-9.0, 0.0]]], [0])
    assert find_starts(evidence, np.array([1, 0, 0])).shortfall.tolist() == [4.5]


def test_no_fringe_is_surer_than_its_doubt() -> None:
    """Two letters: at most ln(0.995 / 0.005), however many nats its pixels say."""
    doubted = doubt_fringes(evidence_of([[[0.0, -900.0], [0.0, 0.0]]], [0]))
    np.testing.assert_allclose(doubted.letters[0, 0], np.log([0.995, 0.005]), rtol=1e-12)
    np.testing.assert_allclose(doubted.letters[0, 1], np.log([0.5, 0.5]), rtol=1e-12)


def test_letters_that_stand_twice_are_a_tie() -> None:
    evidence = evidence_of([[[0.0, -9.0]]], [0])
    assert find_starts(evidence, np.array([1, 0, 0, 1])).lead.tolist() == [0.0]


def test_the_window_breaks_a_tie_and_may_leave_one_or_none() -> None:
    evidence = evidence_of([[[0.0, -9.0]]] * 3, [0, 0, 0])
    bounds = np.array([0.5, 1.5, 5.0]), np.array([1.5, 3.5, 5.0])
    starts = find_starts(evidence, np.array([1, 0, 0, 1]), admissible=bounds)
    assert starts.order[:2].tolist() == [1, 2]
    assert starts.lead.tolist() == [np.inf, 9.0, -np.inf]


def test_every_start_one_by_one() -> None:
    rng = np.random.default_rng(4)
    letters, first = rng.integers(0, 3, 12), 2
    table = rng.normal(0, 5, (20, 5, 3))
    pixels = rng.integers(0, 4, (20, 5))
    table[pixels == 0] = 0
    lowest = rng.integers(-3, 4, 20)
    found = find_starts(Evidence(table, pixels, lowest), letters, first=first)
    for region in range(20):
        scores = {}
        for start in range(-20, 30):
            orders = start + lowest[region] + np.arange(5)
            if orders[-1] < first or orders[0] > first + 11:
                continue
            inside = (orders >= first) & (orders < first + 12)
            scores[start] = -OUTSIDE_NATS * pixels[region, ~inside].sum() + sum(
                table[region, turn, letters[orders[turn] - first]]
                for turn in np.flatnonzero(inside)
            )
        ranked = sorted(scores.values(), reverse=True)
        assert scores[int(found.order[region])] == pytest.approx(ranked[0], abs=1e-9)
        assert found.lead[region] == pytest.approx(ranked[0] - ranked[1], abs=1e-9)


def test_window_bounds_by_hand() -> None:
    """Phase zero, period 10: a window of 23 to 58 px admits orders 3 to 5, less the turns."""
    turns, region = np.array([[1, 1, 0]]), np.array([[0, 0, 1]])
    low = np.array([[23.0, 23.0, np.nan]], np.float32)
    window = CoordinateWindow(low, low + 35)
    least, most = admissible_starts(unwrapped_of(turns, region), window)
    np.testing.assert_allclose(least, [1.3, -np.inf], rtol=1e-6)
    np.testing.assert_allclose(most, [4.8, np.inf], rtol=1e-6)
    assert np.isinf(admissible_starts(unwrapped_of(turns, region), None)).all()


def test_a_few_pixels_may_contradict_the_window() -> None:
    region = np.zeros((1, 200), int)
    low = np.full((1, 200), 20.0, np.float32)
    low[0, :3] = 500.0
    least, _ = admissible_starts(unwrapped_of(region, region), CoordinateWindow(low, low + 30))
    assert least.tolist() == [2.0]


def test_unsure_regions_stay_relative() -> None:
    turns, region = np.array([[0, 1, 0, 0]]), np.array([[0, 0, 1, -1]])
    leads = np.array([LEAST_NATS, LEAST_NATS - 1e-6])
    starts = Starts(np.array([4, 7]), leads, np.zeros(2))
    placed = place_regions(unwrapped_of(turns, region), starts)
    assert placed.order.tolist() == [[4, 5, -1, -1]]
    unlikely = Starts(np.array([4, 7]), 9 * leads, np.array([1.51, 1.49]))
    assert place_regions(unwrapped_of(turns, region), unlikely).order.tolist() == [[-1, -1, 7, -1]]
    # tanh(ln 100 / 2) = 99 / 101
    np.testing.assert_allclose(placed.margin, [[99 / 101, 99 / 101, np.nan, np.nan]], rtol=1e-6)


def test_no_region_at_all() -> None:
    nothing = np.full((2, 3), -1)
    unwrapped = unwrapped_of(np.zeros((2, 3), int), nothing)
    starts = find_starts(gather_evidence(unwrapped, np.zeros((2, 2, 3))), np.array([0, 1]))
    assert (place_regions(unwrapped, starts).order == -1).all()
