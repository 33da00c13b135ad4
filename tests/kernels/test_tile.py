"""What tiles hold: bounds that tell bits, bits that make an index, rules."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.kernels.tile import (
    BOUND_SLOTS,
    DARK,
    HIGH,
    LOW,
    TILE,
    Images,
    append_bits,
    bound_by_noise,
    bound_levels,
    clear,
    even_spread,
    find_saturated,
    noise_of,
    rule_of,
    spread_of,
)

PIXELS = 65


def bounds_of(level: float, near: float, kind: type[np.unsignedinteger[Any]]) -> Images:
    bounds: Images = np.empty(BOUND_SLOTS * TILE, kind)
    bound_levels(1, np.array([level], np.float32), np.array([near], np.float32), bounds)
    return bounds


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@given(
    level=st.floats(-10, 300, width=32),
    near=st.floats(0, 60, width=32),
)
def test_bounds_say_the_same_as_thresholds(
    kind: type[np.unsignedinteger[Any]], level: float, near: float
) -> None:
    """For every grey level: brighter than its threshold, and as near to it as is doubtful."""
    bounds, grey = bounds_of(level, near, kind), np.arange(256)
    threshold, doubt = np.float32(level), np.float32(near)
    doubtful = (grey >= bounds[LOW]) & (grey <= bounds[HIGH])
    first, last = np.ceil(threshold - doubt), np.floor(threshold + doubt)
    np.testing.assert_array_equal(doubtful, (grey >= first) & (grey <= last))
    if level >= 0:  # no grey level is dark below it, and none is that dark
        np.testing.assert_array_equal(grey > bounds[DARK], grey > threshold)


def test_bounds_by_noise() -> None:
    """Read noise 3, gain 0.5 from black level 10: sigma is 5 at 42; two of them on both sides."""
    level, bounds = np.full(PIXELS, 42, np.float32), np.empty(BOUND_SLOTS * TILE, np.uint8)
    noise = (np.float32(9), np.float32(0.5), np.float32(10))
    bound_by_noise(PIXELS, level, noise, np.float32(2), bounds)
    for slot, expected in ((LOW, 32), (HIGH, 52), (DARK, 42)):
        assert set(bounds[slot : slot + PIXELS].tolist()) == {expected}


@pytest.mark.parametrize("count", [1, 2, 7, 8])
def test_bits_in_one_call_or_in_several(count: int) -> None:
    """Against the exclusive or of all higher bits, which is what a reflected code is."""
    rng = np.random.default_rng(count)
    bits = rng.integers(0, 256, (count, 2, PIXELS)).astype(np.uint8)
    bounds = np.empty(BOUND_SLOTS * TILE, np.uint8)
    level, near = np.full(PIXELS, 127.5, np.float32), np.full(PIXELS, 10, np.float32)
    bound_levels(PIXELS, level, near, bounds)
    ones = np.bitwise_xor.accumulate(bits[:, 1] > 127.5, axis=0)
    expected = sum(ones[n].astype(int) << (count - 1 - n) for n in range(count))
    for parts in ([(0, count)], [(0, count // 2), (count // 2, count)]):
        index, doubtful = np.zeros(PIXELS, np.uint8), np.zeros(PIXELS, np.uint8)
        for part in parts:
            append_bits(bits, (1, 0, PIXELS), part, bounds, index, doubtful)
        np.testing.assert_array_equal(index, expected)
        np.testing.assert_array_equal(doubtful, (abs(bits[:, 1] - 127.5) <= 10).sum(axis=0))


@pytest.mark.parametrize("count", [3, 4, 5, 7])
def test_saturated_frames_are_found_whichever_they_are(count: int) -> None:
    for which in range(count):
        frames = np.full((count, 1, PIXELS), 100, np.uint8)
        frames[which, 0, 7] = 250
        some = np.ones(PIXELS, np.uint8)
        assert find_saturated(frames, (0, 0, PIXELS), 249.9, some)
        assert np.flatnonzero(some).tolist() == [7]
        assert not find_saturated(frames, (0, 0, PIXELS), 250.1, some)
        assert not find_saturated(frames, (0, 0, PIXELS), 300.0, some)


def test_the_first_rule_that_is_broken() -> None:
    """Limits 8 grey levels, 5 sigma and a residual of 4 sigma, sigma 2."""
    limits = (np.float32(8), np.float32(5), np.float32(4))
    marks = (np.uint8(1), np.uint8(2), np.uint8(3))

    def rule(phase: float, modulation: float, residual: float) -> int:
        phi, b, left = map(np.float32, (phase, modulation, residual))
        return int(rule_of(phi, b, left, np.float32(2), limits, marks))

    assert rule(0.1, 10, 8) == 0
    assert rule(0.1, 10, np.nan) == 0  # three frames leave no residual
    assert rule(0.1, 10, 8.1) == 3
    assert rule(0.1, 9.9, 8.1) == 2
    assert rule(np.nan, 9.9, 8.1) == 1


def test_even_shifts_are_a_case_of_any() -> None:
    c, s = np.float32(3), np.float32(-4)
    variance, zero = np.float32(2 / 3), np.float32(0)
    general = spread_of(c, s, variance, zero, variance)
    assert general == pytest.approx(np.sqrt(2 / 3) / 5, rel=3e-7)
    assert even_spread(np.float32(5), np.sqrt(variance)) == pytest.approx(general, rel=3e-7)
    assert np.isnan(even_spread(zero, np.sqrt(variance)))
    assert np.isnan(spread_of(zero, zero, variance, zero, variance))


def test_noise_below_the_black_level_is_the_readers() -> None:
    assert noise_of(*map(np.float32, (5, 4, 0.5, 10))) == 2


def test_only_a_tiles_marks_are_cleared() -> None:
    marks = np.ones(10, np.uint8)
    clear(7, marks)
    assert marks.tolist() == [0] * 7 + [1] * 3
