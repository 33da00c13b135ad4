"""Runs, links, residues and cuts by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.kernels import cuts, edges, links
from fringeworks.kernels.spatial import ABOVE, LEFT, find, join, settle, unwrap_runs

NAN = np.nan
TURN = 2 * np.pi
Ints = NDArray[np.int32]


def runs_of(phase: object, broken: object = None) -> tuple[Ints, Ints, Ints, tuple[int, int, int]]:
    shown = np.array(phase, np.float32)
    marks = np.zeros(shown.shape, np.uint8) if broken is None else np.array(broken, np.uint8)
    turns, run = np.empty(shown.shape, np.int32), np.empty(shown.shape, np.int32)
    tree = np.empty((2, shown.size), np.int32)
    return turns, run, tree, unwrap_runs(shown, marks, turns, run, tree)


class TestRuns:
    def test_turns_by_hand(self) -> None:
        # 3 to -3 goes up by 0.28: a turn more; back again: a turn less; void starts anew.
        turns, run, _, _ = runs_of([[2.0, 3.0, -3.0, -2.0, -3.0, 3.0, NAN, 1.0]])
        assert turns.tolist() == [[0, 0, 1, 1, 1, 0, 0, 0]]
        assert run.tolist() == [[0, 0, 0, 0, 0, 0, -1, 1]]

    def test_half_a_turn_is_no_turn(self) -> None:
        turns, *_ = runs_of([[-1.5, 1.6, -1.5]])  # 3.1 up, 3.1 down
        assert turns.tolist() == [[0, 0, 0]]

    def test_a_broken_link_ends_a_run(self) -> None:
        turns, run, _, counts = runs_of([[3.0, -3.0, -2.0]], [[0, LEFT, 0]])
        assert (turns.tolist(), run.tolist()) == ([[0, 0, 0]], [[0, 1, 1]])
        assert counts == (2, 0, 0)

    def test_rows_are_joined_with_their_turns(self) -> None:
        turns, run, tree, (count, _, _) = runs_of([[3.0, NAN, 0.0], [-3.0, -2.0, -1.0]])
        assert count == 3
        assert settle(run, turns, tree, count) == 1
        assert run.tolist() == [[0, -1, 0], [0, 0, 0]]
        # Up by a turn from 3 to -3; from -1 to 0 by none.
        assert turns.tolist() == [[0, 0, 1], [1, 1, 1]]

    def test_broken_rows_stay_apart(self) -> None:
        turns, run, tree, (count, _, _) = runs_of(np.zeros((2, 3)), [[0] * 3, [ABOVE] * 3])
        assert settle(run, turns, tree, count) == 2
        assert run.tolist() == [[0] * 3, [1] * 3]

    def test_residues_and_loops_are_told_apart(self) -> None:
        quarter = TURN / 4
        whirl = [[0.0, quarter], [-quarter, 2 * quarter - 0.01]]
        assert runs_of(whirl)[3] == (2, 1, 0)
        ring = np.array([[0, 1, 2], [7, NAN, 3], [6, 5, 4]]) * TURN / 8
        assert runs_of(ring - TURN * np.rint(ring / TURN))[3][1:] == (0, 1)
        assert runs_of(np.zeros((3, 3)))[3] == (3, 0, 0)


def test_a_tree_keeps_turns_over_any_joins() -> None:
    rng = np.random.default_rng(4)
    height = rng.integers(-9, 9, 300)
    tree = np.stack([np.arange(300), np.zeros(300)]).astype(np.int32)
    for _ in range(2000):
        a, b = (int(n) for n in rng.integers(0, 300, 2))
        assert join(tree, a, b, int(height[b] - height[a]))
        assert not join(tree, a, b, int(height[b] - height[a]) + 1)
    roots, turns = zip(*(find(tree, n) for n in range(300)), strict=True)
    assert set(roots) == {0}
    assert (np.array(turns) == height - height[0]).all()


class TestLinks:
    @pytest.mark.parametrize("shape", [(1, 9), (9, 1), (4, 30), (30, 4), (25, 40)])
    def test_deviations_against_plain_sums(self, shape: tuple[int, int]) -> None:
        rng = np.random.default_rng(7)
        phase = rng.uniform(-3.1, 3.1, shape).astype(np.float32)
        phase[rng.random(shape) < 0.2] = NAN
        steps = np.empty((2, *shape), np.int16)
        found = np.empty_like(steps)
        links.find_steps(phase, steps)
        links.find_deviations(steps, found)
        per_step = TURN / links.STEPS_PER_TURN
        for axis in range(2):
            rise = np.full(shape, NAN)
            step = np.diff(phase.astype(float), axis=1 - axis)
            rise[(slice(None), slice(1, None)) if axis == 0 else (slice(1, None),)] = (
                step - TURN * np.rint(step / TURN)
            )
            for i, j in np.ndindex(shape):
                box = rise[max(i - 5, 0) : i + 6, max(j - 5, 0) : j + 6]
                if np.isnan(rise[i, j]):
                    assert found[axis, i, j] == -1
                    continue
                off = abs(rise[i, j] - np.nanmean(box))
                expected = min(off, TURN - off)
                # Rounding of two steps, and the deviation is cut to whole steps.
                assert found[axis, i, j] * per_step == pytest.approx(expected, abs=3 * per_step)

    def test_links_are_sorted_by_cost_then_place(self) -> None:
        costs = np.array([[[9, 3, 5]], [[3, 9, 9]]], np.uint16)
        costs[0, 0, 0] = costs[1, 0, 2] = links.VOID_COST
        numbers = np.empty(links.COST_LEVELS, np.int32)
        links.count_costs(costs, numbers)
        assert links.sort_links(costs, -1, numbers).tolist() == [2, 1, 4, 3]
        assert links.sort_links(costs, 3, numbers).tolist() == [4, 3]

    def test_costs_of_a_plane_are_nothing(self) -> None:
        row, column = np.mgrid[:20, :20]
        plane = 2.5 * column - 1.5 * row
        shown = (plane - TURN * np.rint(plane / TURN)).astype(np.float32)
        steps = np.empty((2, 20, 20), np.int16)
        deviations, costs = np.empty_like(steps), np.empty((2, 20, 20), np.uint16)
        links.find_steps(shown, steps)
        links.find_deviations(steps, deviations)
        links.find_costs(deviations, costs)
        assert (costs[0, :, 0] == links.VOID_COST).all()
        assert (costs[1, 0] == links.VOID_COST).all()
        assert (costs[0, :, 1:] == 0).all()
        assert (costs[1, 1:] == 0).all()


def charges_of(places: dict[tuple[int, int], int], shape: tuple[int, int]) -> NDArray[np.int8]:
    """Charges ``(H + 1, W + 1)`` with ground at the rim only."""
    charges = np.full((shape[0] + 1, shape[1] + 1), cuts.GROUND, np.int8)
    charges[1:-1, 1:-1] = 0
    for place, charge in places.items():
        charges[place] = charge
    return charges


class TestCuts:
    def test_a_cut_crosses_the_links_between(self) -> None:
        # From the loop about (10, 10) to that about (10, 13): the links from above of columns
        # 10 to 12 are what lies between.
        broken = np.zeros((20, 20), np.uint8)
        cuts.grow_boxes(charges_of({(10, 10): 1, (10, 13): -1}, (20, 20)), 2, broken)
        expected = np.zeros((20, 20), np.uint8)
        expected[10, 10:13] = ABOVE
        np.testing.assert_array_equal(broken, expected)

    def test_a_lone_residue_is_cut_to_the_rim(self) -> None:
        broken = np.zeros((20, 30), np.uint8)
        cuts.grow_boxes(charges_of({(3, 12): 1}, (20, 30)), 1, broken)
        assert np.argwhere(broken == LEFT).tolist() == [[0, 12], [1, 12], [2, 12]]
        assert np.count_nonzero(broken) == 3

    def test_near_pairs_go_first(self) -> None:
        # In a row + - - +, four, two and four apart... the middle ones are of one sign.
        places = {(50, 40): 1, (50, 44): -1, (50, 46): -1, (50, 50): 1}
        broken = np.zeros((100, 100), np.uint8)
        cuts.grow_boxes(charges_of(places, (100, 100)), 4, broken)
        assert np.flatnonzero(broken[50]).tolist() == [*range(40, 44), *range(46, 50)]

    def test_far_ones_are_cut_to_the_rim_however_large_the_image(self) -> None:
        middle = cuts.LONGEST_SEARCH + 20
        shape = (2 * middle + 1, 2 * middle + 40)
        broken = np.zeros(shape, np.uint8)
        cuts.grow_boxes(charges_of({(middle, middle): 1}, shape), 1, broken)
        assert np.count_nonzero(broken) == middle


class TestEdges:
    def test_the_rim_reaches_two_pixels_to_either_side(self) -> None:
        marks = np.zeros((9, 9), np.uint8)
        marks[:, 4] = LEFT  # between columns 3 and 4
        rim = np.empty_like(marks)
        edges.widen_edges(marks, rim)
        assert np.unique(np.nonzero(rim)[1]).tolist() == [2, 3, 4, 5]
        assert rim[:, 2:6].all()
