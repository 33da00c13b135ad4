"""Spatial unwrapping, regions, and orders from a depth window, against known orders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.files.capture import read_capture
from fringeworks.model import (
    Capture,
    CodedAxis,
    PatternSet,
    Sensor,
    Sequence,
    UnwrappedPhase,
    WrappedPhase,
)
from fringeworks.model.phase import VOID_REGION
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.demodulate import MaskRules, demodulate
from fringeworks.phase.objects import by_objects, depth_window
from fringeworks.phase.orders import AxisFrames
from fringeworks.phase.regions import branch_cuts, find_regions, find_residues
from fringeworks.phase.spatial import unwrap_links, unwrap_spatial
from fringeworks.phase.window import CoordinateWindow
from fringeworks.twin.scenes import named_scene, paper_rig
from fringeworks.twin.simulate import simulate
from tests.phase.unwrapping import (
    CASES,
    COLUMN,
    FRINGE,
    ROW,
    SHAPE,
    TURN,
    Array,
    as_wrapped,
    by_reliability,
    hill,
    wrap,
)

Real = Callable[[str], Path]


def wrong_share(unwrapped: UnwrappedPhase, order: Array) -> float:
    """Share of the pixels with an order that are off their region's commonest offset."""
    known = np.isfinite(order) & (unwrapped.region >= 0)
    region, off = unwrapped.region[known], (order - unwrapped.turns)[known].astype(np.int64)
    off -= off.min()
    size = int(off.max()) + 1
    counts = np.bincount(region * size + off, minlength=unwrapped.region_count * size)
    return 1 - float(counts.reshape(-1, size).max(axis=1).sum()) / region.size


class TestUnwrap:
    @pytest.mark.parametrize("name", CASES)
    @pytest.mark.parametrize("seed", range(3))
    def test_never_more_wrong_orders_than_by_reliability(self, name: str, seed: int) -> None:
        case = CASES[name](np.random.default_rng(seed))
        unwrapped = unwrap_spatial(as_wrapped(case.wrapped))
        assert case.wrong(unwrapped.turns) <= case.wrong(by_reliability(case.wrapped))

    @pytest.mark.parametrize("name", CASES)
    def test_never_more_wrong_orders_than_scikit_image(self, name: str) -> None:
        peer = pytest.importorskip("skimage.restoration")
        case = CASES[name](np.random.default_rng(11))
        wrapped, filled = case.wrapped, np.nan_to_num(case.wrapped)
        theirs = np.ma.getdata(peer.unwrap_phase(np.ma.masked_array(filled, ~case.valid)))
        turns = np.rint((theirs - filled) / TURN).astype(np.int64)
        unwrapped = unwrap_spatial(as_wrapped(wrapped))
        assert case.wrong(unwrapped.turns) <= case.wrong(turns)

    @given(st.integers(0, 2**32 - 1), st.floats(0.02, 0.7))
    def test_smooth_phase_is_exact_whatever_the_mask(self, seed: int, void: float) -> None:
        # Steps below pi: no residue, no open loop, and each region right but for its constant.
        phase = hill()
        valid = np.random.default_rng(seed).random(SHAPE) > void
        unwrapped = unwrap_spatial(as_wrapped(np.where(valid, wrap(phase), np.nan)))
        order = np.where(valid, np.rint((phase - wrap(phase)) / TURN), np.nan)
        assert (unwrapped.residues, unwrapped.open_loops, unwrapped.torn_links) == (0, 0, 0)
        assert wrong_share(unwrapped, order) == 0

    @pytest.mark.parametrize("valid", [True, False])
    def test_all_or_nothing(self, valid: bool) -> None:
        flat = np.full((4, 5), 1.0 if valid else np.nan)
        unwrapped = unwrap_spatial(as_wrapped(flat))
        assert unwrapped.region_count == int(valid)
        assert (unwrapped.region == (0 if valid else VOID_REGION)).all()
        np.testing.assert_array_equal(np.isnan(unwrapped.phase), np.isnan(flat))

    def test_regions_are_numbered_as_they_come(self) -> None:
        stripes = np.where(COLUMN % 10 == 0, np.nan, 1.0)
        unwrapped = unwrap_spatial(as_wrapped(stripes))
        assert unwrapped.region_count == SHAPE[1] // 10
        valid = np.isfinite(stripes)
        np.testing.assert_array_equal(unwrapped.region[valid], (COLUMN // 10)[valid])

    def test_without_order_and_with_order_agree(self) -> None:
        # A dipole of noise, three pixels long, must not change the phase elsewhere.
        phase = hill()
        spoiled = phase.copy()
        spoiled[40, 70:73] += (2.2, 3.0, 3.1)
        smooth = unwrap_spatial(as_wrapped(wrap(phase)))
        dipole = unwrap_spatial(as_wrapped(wrap(spoiled)))
        assert (smooth.residues, smooth.torn_links) == (0, 0)
        assert (dipole.residues, dipole.torn_links) == (2, 1)
        differs = smooth.turns - dipole.turns != smooth.turns[0, 0] - dipole.turns[0, 0]
        assert np.count_nonzero(differs) <= 3

    def test_a_ring_that_does_not_close_says_so(self) -> None:
        angle = np.arctan2(ROW - 45.0, COLUMN - 65.0)
        ring = abs(np.hypot(ROW - 45, COLUMN - 65) - 30) < 8
        unwrapped = unwrap_spatial(as_wrapped(np.where(ring, angle, np.nan)))
        assert (unwrapped.residues, unwrapped.region_count) == (0, 1)
        assert unwrapped.open_loops > 0
        assert 15 <= unwrapped.torn_links <= 40  # one cut through the ring, 15 pixels wide

    def test_broken_links_divide(self) -> None:
        broken = np.zeros(SHAPE, np.uint8)
        broken[:, 60] = 1
        unwrapped = unwrap_links(as_wrapped(wrap(hill())), broken)
        assert unwrapped.region_count == 2
        np.testing.assert_array_equal(unwrapped.region, COLUMN >= 60)


class TestResidues:
    def test_a_whirl_is_one_residue(self) -> None:
        angle = np.arctan2(ROW - 20.5, COLUMN - 30.5)  # rising clockwise as the image is seen
        residues = find_residues(as_wrapped(angle))
        assert np.argwhere(residues).tolist() == [[20, 30]]
        assert residues[20, 30] == 1
        assert find_residues(as_wrapped(-angle))[20, 30] == -1

    def test_void_pixels_have_none(self) -> None:
        angle = np.arctan2(ROW - 20.5, COLUMN - 30.5)
        angle[20, 30] = np.nan
        assert not find_residues(as_wrapped(angle)).any()

    def test_cuts_leave_no_residue_and_no_loop(self) -> None:
        rng = np.random.default_rng(3)
        wrapped = as_wrapped(wrap(hill() + rng.normal(0, 0.9, SHAPE)))
        assert np.count_nonzero(find_residues(wrapped)) > 100
        unwrapped = unwrap_links(wrapped, branch_cuts(wrapped))
        assert (unwrapped.residues, unwrapped.open_loops) == (0, 0)


def two_levels(jump: Array | float, *, change: float = 0.0) -> tuple[WrappedPhase, Array]:
    """A ramp with a jump in the middle, and its orders; the right half is brighter by `change`."""
    rng = np.random.default_rng(5)
    right = COLUMN >= 65
    phase = 0.3 * COLUMN + 0.02 * ROW + np.where(right, jump, 0.0) + rng.normal(0, 0.02, SHAPE)
    level = (1 + change * right) * (1 + rng.normal(0, 0.014, SHAPE))
    wrapped = as_wrapped(wrap(phase), brightness=level)
    return wrapped, np.rint((phase - wrap(phase)) / TURN)


class TestRegions:
    @pytest.mark.parametrize("jump", [0.8, 2.0, np.pi, 4.0, 5.4])
    def test_a_jump_divides(self, jump: float) -> None:
        wrapped, order = two_levels(jump)
        regions = find_regions(wrapped)
        assert regions.region_count == 2
        np.testing.assert_array_equal(regions.region, COLUMN >= 65)
        assert wrong_share(regions, order) == 0

    @pytest.mark.parametrize("change", [0.8, -0.5])
    def test_a_whole_turn_is_hidden_but_for_the_brightness(self, change: float) -> None:
        wrapped, order = two_levels(TURN)
        assert wrong_share(find_regions(wrapped), order) > 0.4
        wrapped, order = two_levels(TURN, change=change)
        assert wrong_share(find_regions(wrapped), order) <= 0.02  # one column where they meet

    def test_a_gap_in_an_edge_is_closed(self) -> None:
        # The jump swings about a whole turn: for three rows at a time it looks like none.
        wrapped, order = two_levels(TURN + 1.5 * np.sin((ROW + 2) / 4))
        assert wrong_share(unwrap_spatial(wrapped), order) > 0.1
        assert wrong_share(find_regions(wrapped), order) <= 0.001

    @pytest.mark.parametrize("sigma", [0.02, 0.1, 0.2])
    def test_noise_does_not_divide(self, sigma: float) -> None:
        rng = np.random.default_rng(8)
        level = 1 + rng.normal(0, sigma / np.sqrt(2), SHAPE)  # a visibility of one: at worst
        wrapped = as_wrapped(
            wrap(hill() + rng.normal(0, sigma, SHAPE)), sigma=sigma, brightness=level
        )
        regions = find_regions(wrapped)
        assert np.mean(regions.region == 0) > 0.999

    def test_small_regions_are_kept(self) -> None:
        phase = np.full((20, 20), np.nan)
        phase[3, 4], phase[10:12, 10], phase[15, 5:9] = 1.0, 2.0, 3.0
        regions = find_regions(as_wrapped(phase))
        assert regions.region_count == 3
        np.testing.assert_array_equal(regions.region >= 0, np.isfinite(phase))

    def test_residues_are_cut(self) -> None:
        # A slit whose jump grows from none to a turn and a half and back has residues on it.
        phase, order = self.slit()
        regions = find_regions(as_wrapped(wrap(phase)))
        assert wrong_share(regions, order) < 0.01

    @staticmethod
    def slit() -> tuple[Array, Array]:
        jump = 3 * np.pi * np.clip(np.sin((ROW - 15) / 60 * np.pi), 0, None)
        right = (COLUMN >= 65) & (ROW > 15) & (ROW < 75)
        phase = 0.2 * COLUMN + np.where(right, jump * np.exp(-(COLUMN - 65) / 40), 0)
        return phase, np.rint((phase - wrap(phase)) / TURN)

    @pytest.mark.parametrize("name", ["two", "step", "balls"])
    def test_orders_are_continuous_on_the_twin(self, name: str) -> None:
        sequence = Sequence(608, 684, (PatternSet(FRINGE),))
        seen = simulate(named_scene(name), paper_rig(), sequence, rng=np.random.default_rng(1))
        wrapped = demodulate(seen.capture.frames[0], FRINGE, seen.capture.sensor)
        regions = find_regions(wrapped)
        order = np.rint((seen.truth.column + 0.5) / 32 - wrapped.phase / TURN)
        assert wrong_share(regions, order) <= 1e-4
        sizes = np.bincount(regions.region[regions.region >= 0])
        assert np.sort(sizes)[-4:].sum() >= 0.97 * sizes.sum()


def frames_of(wrapped: WrappedPhase, window: CoordinateWindow | None) -> AxisFrames:
    sequence = Sequence(608, 684, (PatternSet(FRINGE),))
    stack = np.zeros((3, *wrapped.phase.shape), np.uint8)
    capture = Capture(sequence, (stack,), Sensor(255.0))
    return AxisFrames(capture, "x", (wrapped,), window)


def window_about(coordinate: Array, below: Array | float, above: float) -> CoordinateWindow:
    low, high = coordinate - below, coordinate + above
    return CoordinateWindow(low.astype(np.float32), high.astype(np.float32))


class TestObjects:
    """A plane whose phase falls with depth, seen at columns 100 to 250 of the projector."""

    coordinate: Array = 100 + COLUMN * 1.1 + 0.2 * ROW
    phase: Array = TURN * (coordinate + 0.5) / 32
    order: NDArray[np.int64] = np.rint((phase - wrap(phase)) / TURN).astype(np.int64)

    def test_a_narrow_window_tells_every_order(self) -> None:
        window = window_about(self.coordinate, 20, 10)
        ordered = depth_window(frames_of(as_wrapped(wrap(self.phase)), window))
        np.testing.assert_array_equal(ordered.phase.order, self.order)
        # The middle of the window is 5 px off, of half a period.
        np.testing.assert_allclose(ordered.phase.margin, 1 - 5 / 16, atol=1e-4)

    def test_pixels_outside_or_with_a_wide_window_are_void(self) -> None:
        below = np.where(COLUMN < 40, 20.0, 25.0)  # 32 px or more from column 40 on
        window = window_about(self.coordinate + np.where(ROW < 30, 16, 0), below, 8.0)
        ordered = depth_window(frames_of(as_wrapped(wrap(self.phase)), window))
        known = np.isfinite(ordered.phase.margin)
        np.testing.assert_array_equal(known, COLUMN < 40)
        assert (ordered.phase.order[~known] == -1).all()
        missed = window_about(self.coordinate - 16, 10, 10)
        void = depth_window(frames_of(as_wrapped(wrap(self.phase)), missed)).phase
        assert np.isnan(void.margin).all()

    def test_too_wide_a_window_is_refused(self) -> None:
        with pytest.raises(DecodeError, match=r"narrower than the fringes' period of 32 px.*608"):
            depth_window(frames_of(as_wrapped(wrap(self.phase)), None))

    def test_a_long_object_is_placed_in_a_wide_window(self) -> None:
        # It fills 160 px of a window of 170: moved by a period, a good part is outside.
        flat = CoordinateWindow(*(np.full(SHAPE, v, np.float32) for v in (95.0, 265.0)))
        ordered = by_objects(frames_of(as_wrapped(wrap(self.phase)), flat))
        np.testing.assert_array_equal(ordered.phase.order, self.order)
        assert np.isfinite(ordered.phase.margin).all()

    def test_two_numbers_that_fit_leave_an_object_void(self) -> None:
        flat = CoordinateWindow(*(np.full(SHAPE, v, np.float32) for v in (60.0, 300.0)))
        ordered = by_objects(frames_of(as_wrapped(wrap(self.phase)), flat))
        assert np.isnan(ordered.phase.margin).all()
        assert ordered.route == ("0 of 1 regions in their depth window",)

    def test_each_object_has_its_own_number(self) -> None:
        wrapped = as_wrapped(np.where(abs(COLUMN - 60) < 3, np.nan, wrap(self.phase)))
        known = np.isfinite(wrapped.phase)
        window = window_about(self.coordinate, 30, 30)
        ordered = by_objects(frames_of(wrapped, window))
        np.testing.assert_array_equal(ordered.phase.order[known], self.order[known])
        assert ordered.route == ("2 of 2 regions in their depth window",)

    def test_nothing_valid(self) -> None:
        wrapped = as_wrapped(np.full(SHAPE, np.nan))
        ordered = by_objects(frames_of(wrapped, window_about(self.coordinate, 9, 9)))
        assert (ordered.phase.order == -1).all()

    def test_pixels_without_a_window_go_with_their_region(self) -> None:
        window = window_about(self.coordinate, 15, 15)
        low = np.where(ROW < 20, np.float32(np.nan), window.low_px)
        ordered = by_objects(frames_of(as_wrapped(wrap(self.phase)), replace(window, low_px=low)))
        np.testing.assert_array_equal(ordered.phase.order, self.order)


class TestMugs:
    """Regions of the real mugs, each with one order, against the decode by two periods."""

    @pytest.fixture(scope="class")
    @staticmethod
    def coded(real: Real) -> tuple[CodedAxis, ...]:
        rules = MaskRules(modulation_share=10 / 255)
        return decode_phases(read_capture(real("psp3-gray-mugs")), rules=rules).coded

    @pytest.mark.parametrize("n", [0, 1])
    def test_one_order_for_each_region(self, coded: tuple[CodedAxis, ...], n: int) -> None:
        phase = coded[n].phase
        assert phase is not None
        order = np.where(np.isnan(phase.margin), np.nan, phase.order)
        regions = find_regions(phase.wrapped)
        assert np.count_nonzero(np.isfinite(order)) > 1.3e6
        assert wrong_share(regions, order) <= 0.01
        # Not for being in pieces: most of it is in the largest few.
        sizes = np.sort(np.bincount(regions.region[regions.region >= 0]))
        assert sizes[-50:].sum() > 0.7 * sizes.sum()
