"""Chains of periods: which one is planned, and what it finds."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.errors import DecodeError
from fringeworks.model import CodedAxis, Fringe, GrayCode, Void, gray_bits
from fringeworks.phase.decode import decode_capture, decode_phases
from fringeworks.phase.temporal import find_carriers, make_carrier, plan_chain
from tests.phase.encoding import (
    BLACK,
    SENSOR_16,
    WHITE,
    Scene,
    capture_of,
    equal_shifts,
    sweep,
)


def fringes(*periods: float, zero: float = -0.5, steps: int = 4) -> list[Fringe]:
    return [Fringe("x", period, equal_shifts(steps), zero_px=zero) for period in periods]


def planned(*periods: float, reach: float) -> list[str]:
    return [str(carrier) for carrier in plan_chain(fringes(*periods), reach)]


class TestCarriers:
    def test_beat_by_hand(self) -> None:
        # 1 / (3 / 200 - 1 / 100) = 200; both are zero at 0, and so is their beat.
        beat = make_carrier(fringes(200 / 3, 100.0, zero=0.0), (1, -1))
        assert beat is not None
        assert beat.period_px == pytest.approx(200, rel=1e-12)
        assert beat.zero_px == pytest.approx(0, abs=1e-12)

    def test_beat_of_different_zeros_by_hand(self) -> None:
        # Phi = 2 pi (u / 20 - u / 30 - 3 / 20 + 6 / 30) = 2 pi (u / 60 + 1 / 20): zero at -3.
        first, second = Fringe("x", 20.0, (0, 1, 2), 3.0), Fringe("x", 30.0, (0, 1, 2), 6.0)
        beat = make_carrier([first, second], (1, -1))
        assert beat is not None
        assert beat.period_px == pytest.approx(60, rel=1e-12)
        assert beat.zero_px == pytest.approx(-3, abs=1e-12)

    def test_no_carrier_of_no_frequency(self) -> None:
        assert make_carrier(fringes(20.0, 20.0), (1, -1)) is None
        assert make_carrier(fringes(20.0, 30.0), (-1, 1)) is None

    def test_periods_fall(self) -> None:
        periods = [carrier.period_px for carrier in find_carriers(fringes(18.0, 21.0, 24.5))]
        assert periods == sorted(periods, reverse=True)
        assert len([c for c in find_carriers(fringes(18.0, 21.0, 24.5)) if not c.is_beat]) == 3


class TestPlan:
    @pytest.mark.parametrize(
        ("periods", "reach", "chain"),
        [
            # Gray cells of 100 px: straight to 100 px would have no margin at all.
            ((200 / 3, 100.0), 50.0,
             ["beat of 200 px", "fringes of 100 px", "fringes of 66.67 px"]),
            # Hierarchical: guarded coarsest period of 1.05 times 608 px, eighths, sixty-fourths.
            ((638.4, 76.0, 9.5), 304.0,
             ["fringes of 638.4 px", "fringes of 76 px", "fringes of 9.5 px"]),
            ((9.5, 638.4, 76.0), 304.0,  # in any order
             ["fringes of 638.4 px", "fringes of 76 px", "fringes of 9.5 px"]),
            # Heterodyne: 1 / (1/18 - 1/21) = 126.
            ((18.0, 21.0), 60.0, ["beat of 126 px", "fringes of 18 px"]),
            # Gray cells of the period, of half of it, and fine ones.
            ((32.0,), 16.0, ["fringes of 32 px"]),
            ((32.0,), 8.0, ["fringes of 32 px"]),
            ((32.0,), 0.5, ["fringes of 32 px"]),
            # A Gray code that is good enough leaves coarse fringes alone.
            ((32.0, 300.0), 8.0, ["fringes of 32 px"]),
        ],
    )  # fmt: skip
    def test_expected(self, periods: tuple[float, ...], reach: float, chain: list[str]) -> None:
        assert planned(*periods, reach=reach) == chain

    def test_three_frequency_heterodyne(self) -> None:
        # 49, 56, 64: beats of 392, 448 and 209; the beat of 392 and 448 is 3136 px.
        chain = plan_chain(fringes(49.0, 56.0, 64.0), 500.0)
        assert chain[0].period_px == pytest.approx(3136)
        assert chain[-1].period_px == pytest.approx(49)
        for before, after in itertools.pairwise(chain):
            # every step holds at the planned error of 0.1 rad in every set
            assert after.period_px / 2 > np.hypot(before.error_px, after.error_px)

    @pytest.mark.parametrize(
        ("periods", "reach", "words"),
        [
            ((200 / 3,), 50.0,
             ["orders of the fringes of 66.67 px", "+-50 px",
              "Gray code with cells of 66.67 px or less", "longer than 100 px"]),
            ((200 / 3, 100.0), 960.0,
             ["+-960 px", "longest carrier that leads to them is the beat of 200 px",
              "cells of 200 px or less", "longer than 1920 px"]),
            # The gap is in the middle: nothing longer than 1000 px would help.
            ((1000.0, 4.0), 500.0,
             ["step from the fringes of 1000 px is too long", "cells of 4.016 px or less",
              "of a period between 4.016 and 1000 px"]),
        ],
    )  # fmt: skip
    def test_impossible_says_what_to_add(
        self, periods: tuple[float, ...], reach: float, words: list[str]
    ) -> None:
        with pytest.raises(DecodeError) as caught:
            plan_chain(fringes(*periods), reach)
        for word in words:
            assert word in str(caught.value)

    @given(st.lists(st.floats(4, 900), min_size=1, max_size=4, unique=True), st.floats(0.5, 600))
    def test_advice_is_good(self, periods: list[float], reach: float) -> None:
        """Where no chain exists, the Gray code that the message asks for makes one."""
        try:
            plan_chain(fringes(*periods), reach)
        except DecodeError as error:
            cell = float(str(error).split("cells of ")[1].split(" px")[0])
            # The message rounds to four digits; the code may be as much smaller as one likes.
            chain = plan_chain(fringes(*periods), cell / 2 * 0.9995)
            assert chain[-1].period_px == pytest.approx(min(periods))


WIDTH = 608
PLANE = Scene(
    sweep(WIDTH, samples_per_px=8), WIDTH, offset=30000.0, modulation=25000.0, sensor=SENSOR_16
)


def decoded(scene: Scene, *periods: float, gray_px: float | None = None) -> CodedAxis:
    patterns = (
        () if gray_px is None else (GrayCode("x", gray_bits(WIDTH, gray_px), gray_px), WHITE, BLACK)
    )
    column = decode_capture(scene.capture(*fringes(*periods), *patterns)).column
    assert column is not None
    return column


class TestDecode:
    @pytest.mark.parametrize(
        ("periods", "gray_px"),
        [
            ((638.4,), None),
            ((638.4, 76.0, 9.5), None),
            ((50.0, 54.4), None),  # beat of 618 px on 608
            ((49.0, 56.0, 64.0), None),
            ((200 / 3, 100.0), 100.0),
            ((9.5, 76.0), 76.0),
        ],
    )
    def test_whole_projector(self, periods: tuple[float, ...], gray_px: float | None) -> None:
        axis = decoded(PLANE, *periods, gray_px=gray_px)
        finest = min(periods)
        # Rounding to half of 25000 in four frames: phase off by 0.5 sqrt 2 / 25000 at most; the
        # arctangent by 5e-7; single precision of 608 px by 3e-5.
        bound = finest / (2 * np.pi) * (0.5 * np.sqrt(2) / 25000 + 5e-7) + 5e-5
        assert np.abs(axis.coordinate - PLANE.u).max() <= bound
        assert axis.phase is not None
        assert axis.phase.fringe.period_px == finest

    @given(
        count=st.integers(2, 3),
        seed=st.integers(0, 10_000),
        zero=st.sampled_from([-0.5, 0.0, 40.0]),
    )
    def test_any_periods_that_have_a_chain(self, count: int, seed: int, zero: float) -> None:
        rng = np.random.default_rng(seed)
        coarse = WIDTH * rng.uniform(1.05, 1.5)
        periods = [coarse / rng.uniform(4, 9) ** n for n in range(count)]
        sets = fringes(*periods, zero=zero, steps=int(rng.integers(3, 6)))
        column = decode_capture(PLANE.capture(*sets)).column
        assert column is not None
        assert np.abs(column.coordinate - PLANE.u).max() < 0.02

    def test_margin_is_the_least_of_all_steps(self) -> None:
        axis = decoded(PLANE, 638.4, 76.0, 9.5)
        assert axis.phase is not None
        # The first step starts from the centre, 304 px from both edges: 1 - 304 / 319.2 there.
        margin = axis.phase.margin
        np.testing.assert_allclose(margin, 1 - np.abs(PLANE.u - 303.5) / 319.2, atol=1e-3)

    def test_relative_without_a_chain(self) -> None:
        decoding = decode_phases(PLANE.capture(*fringes(32.0, 64.0)))
        assert not decoding.coded
        ((wrapped, reason),) = decoding.relative
        assert wrapped.fringe.period_px == 32.0
        assert "the orders of the fringes of 32 px cannot be told" in reason
        with pytest.raises(DecodeError, match=r"no axis has a projector coordinate\. axis x: the"):
            decoding.projector_map()

    def test_a_set_that_the_chain_leaves_out_voids_nothing(self) -> None:
        scene = dataclasses.replace(PLANE, blur_px=0.0)
        code = GrayCode("x", gray_bits(WIDTH, 16.0), 16.0)
        fine, coarse = fringes(32.0, 300.0)
        dark = np.full_like(scene.frames(coarse), 30000)
        sets = [(p, scene.frames(p)) for p in (fine, code, WHITE, BLACK)]
        capture = capture_of(*sets, (coarse, dark), extent=WIDTH, sensor=SENSOR_16)
        column = decode_capture(capture).column
        assert column is not None
        assert column.route == ("Gray code of 16 px cells", "fringes of 32 px")
        assert np.isfinite(column.coordinate).all()

    def test_a_set_in_the_chain_does(self) -> None:
        sets = [(fringe, PLANE.frames(fringe)) for fringe in fringes(638.4, 76.0, 9.5)]
        sets[1][1][:, :, :100] = 30000
        column = decode_capture(capture_of(*sets, extent=WIDTH, sensor=SENSOR_16)).column
        assert column is not None
        assert np.isnan(column.coordinate[:, :100]).all()
        assert np.isfinite(column.coordinate[:, 100:]).all()
        assert set(column.void[0, :100]) == {Void.MODULATION}
