"""Gray indices by brute force, and the one unwrapping formula."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.kernels.orders import combine_phases, gray_index, unwrap

Ints = NDArray[np.int32]

TURN = 2 * np.pi


def reflected_codes(bits: int) -> list[str]:
    """All codewords by the definition: the list before, then the same reflected."""
    codes = [""]
    for _ in range(bits):
        codes = ["0" + code for code in codes] + ["1" + code for code in reversed(codes)]
    return codes


def bit_images(bits: int) -> NDArray[np.int64]:
    """``(bits, 2, n / 2)``: every codeword of that many bits once."""
    images = np.array([[int(bit) for bit in code] for code in reflected_codes(bits)]).T
    return images.reshape(bits, 2, -1)


def indexed(
    bits: NDArray[np.integer],
    threshold: object,
    *,
    doubt: float = 0.0,
    start: Ints | None = None,
) -> tuple[Ints, NDArray[np.uint8]]:
    """Index and count of doubtful bits; one doubt for all pixels."""
    shape = bits.shape[1:]
    index = np.zeros(shape, np.int32) if start is None else start.copy()
    doubtful = np.zeros(shape, np.uint8)
    level = np.asarray(threshold)
    if level.ndim == 0:
        level = np.full((1, *shape), level, np.float32)
    gray_index(bits.astype(np.uint16), level, np.full(shape, doubt, np.float32), index, doubtful)
    return index, doubtful


@pytest.mark.parametrize("bits", range(1, 13))
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_codeword(bits: int, dtype: type[np.unsignedinteger]) -> None:
    index, doubtful = indexed((30 + 170 * bit_images(bits)).astype(dtype), 115.0, doubt=84.0)
    np.testing.assert_array_equal(index.ravel(), np.arange(2**bits))
    assert not doubtful.any()


@pytest.mark.parametrize("bits", [2, 5])
def test_a_threshold_for_each_bit(bits: int) -> None:
    lit = bit_images(bits)
    level = np.random.default_rng(1).integers(1, 200, lit.shape)
    frames, inverse = (level + lit).astype(np.uint8), (level + 1 - lit).astype(np.uint8)
    index, _ = indexed(frames, inverse)
    np.testing.assert_array_equal(index.ravel(), np.arange(2**bits))


@pytest.mark.parametrize("first", [1, 3, 6])
def test_bits_are_appended(first: int) -> None:
    frames = bit_images(7).astype(np.uint8)
    index, _ = indexed(frames[:first], 0.5)
    np.testing.assert_array_equal(index.ravel(), np.arange(128) >> (7 - first))
    index, _ = indexed(frames[first:], 0.5, start=index)
    np.testing.assert_array_equal(index.ravel(), np.arange(128))


def test_the_threshold_itself_is_dark() -> None:
    index, _ = indexed(np.array([[[100, 101]]], np.uint8), 100)
    assert index.tolist() == [[0, 1]]


def test_doubtful_bits_are_counted() -> None:
    # Threshold 100, doubt 5: 95 and 105 are doubtful, 94 and 106 are not. Counts are added to.
    pixels = np.array([[94, 106], [95, 106], [95, 105], [100, 103]], np.uint8)
    bits = pixels.T.reshape(2, 1, 4)
    _, doubtful = indexed(bits, 100, doubt=5.0)
    assert doubtful.tolist() == [[0, 1, 2, 2]]
    more = doubtful.copy()
    doubt, level = np.full((1, 4), 5, np.float32), np.full((1, 1, 4), 100, np.float32)
    gray_index(bits, level, doubt, np.zeros((1, 4), np.int32), more)
    assert more.tolist() == [[0, 2, 4, 4]]


def unwrapped(
    phase: object, reference: object, period: float, zero: float
) -> tuple[NDArray[np.float32], Ints, NDArray[np.float32]]:
    phi = np.atleast_2d(np.asarray(phase, np.float32))
    at = np.atleast_2d(np.asarray(reference, np.float32))
    coordinate, margin = np.empty(phi.shape, np.float32), np.empty(phi.shape, np.float32)
    order = np.empty(phi.shape, np.int32)
    unwrap(phi, at, period, zero, coordinate, order, margin)
    return coordinate, order, margin


class TestUnwrap:
    @given(
        u=st.floats(-0.5, 2000),
        period=st.floats(2, 2500),
        zero=st.sampled_from([-0.5, 0.0, 100.0]),
        off=st.floats(-0.999, 0.999),
    )
    def test_any_reference_within_half_a_period(
        self, u: float, period: float, zero: float, off: float
    ) -> None:
        truth = TURN * (u - zero) / period
        order = math.ceil((truth - math.pi) / TURN)  # of fringe (2 pi k - pi, 2 pi k + pi]
        reference = u + off * period / 2
        # Inputs in single precision: an ulp of the largest coordinate, and one of pi as length.
        rounding = 3 * (2.4e-4 + period * 2.4e-7 / TURN)
        if (1 - abs(off)) * period / 2 < rounding:
            return
        coordinate, orders, margin = unwrapped(truth - TURN * order, reference, period, zero)
        assert orders[0, 0] == order
        assert coordinate[0, 0] == pytest.approx(u, abs=rounding)
        assert margin[0, 0] == pytest.approx(1 - abs(off), abs=2 * rounding / period + 1e-6)

    def test_one_reference_for_all(self) -> None:
        phase = np.linspace(-3, 3, 12).reshape(3, 4)
        same = unwrapped(phase, np.full((3, 4), 33.0), 20.0, -0.5)
        one = unwrapped(phase, 33.0, 20.0, -0.5)
        for a, b in zip(same, one, strict=True):
            np.testing.assert_array_equal(a, b)

    def test_nan_in_nan_out(self) -> None:
        phase = [[0.5, np.nan, 0.5, np.nan]]
        reference = [[10.0, 10.0, np.nan, np.nan]]
        coordinate, order, margin = unwrapped(phase, reference, 20.0, -0.5)
        assert np.isnan(coordinate).tolist() == [[False, True, True, True]]
        assert np.isnan(margin).tolist() == [[False, True, True, True]]
        assert order[0, 1:].tolist() == [-1, -1, -1]

    def test_margin_by_hand(self) -> None:
        # Period 20 from 0, phi = 0: coordinates 0, 20, 40. The reference is 0, 4, 9 px off of 10.
        _, order, margin = unwrapped([[0.0, 0.0, 0.0]], [[20.0, 24.0, 29.0]], 20.0, 0.0)
        assert order.tolist() == [[1, 1, 1]]
        np.testing.assert_allclose(margin, [[1.0, 0.6, 0.1]], atol=1e-6)


class TestCombine:
    def test_beat_by_hand(self) -> None:
        # 2.5 - (-2.0) = 4.5, less a turn; 1.0 - 0.25; NaN.
        phases = np.array([[[2.5, 1.0, np.nan]], [[-2.0, 0.25, 1.0]]], np.float32)
        beat = np.empty((1, 3), np.float32)
        combine_phases(phases, np.array([1.0, -1.0]), beat)
        np.testing.assert_allclose(beat, [[4.5 - TURN, 0.75, np.nan]], atol=1e-6)

    @given(
        st.lists(st.floats(-3.14159, 3.14159), min_size=3, max_size=3),
        st.lists(st.integers(-3, 3), min_size=3, max_size=3),
    )
    def test_congruent_to_the_sum(self, phases: list[float], weights: list[int]) -> None:
        stack = np.array(phases, np.float32).reshape(3, 1, 1)
        beat = np.empty((1, 1), np.float32)
        combine_phases(stack, np.array(weights, np.float64), beat)
        total = float(np.dot(weights, stack[:, 0, 0].astype(float)))
        turns = (total - float(beat[0, 0])) / TURN
        assert abs(turns - round(turns)) < 1e-6  # single precision of pi: 2.4e-7 / 2 pi
        assert abs(beat[0, 0]) <= np.float32(np.pi)
