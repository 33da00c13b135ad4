"""decode(render(x)) = x at every projector pixel, the cut fringes of both edges included."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.model import Axis, Codeword, Frames, Fringe, GrayCode, Pattern, gray_bits
from fringeworks.patterns import (
    Preset,
    equal_shifts,
    fringe_orders,
    make_sequence,
    render,
    render_sequence,
)
from tests.patterns.decoder import Floats, fringe_order, phase_bound, read_gray, wrapped_phase


def line(pattern: Pattern, axis: Axis, extent: int) -> Frames:
    """Frames ``(n, extent)`` along the coded axis of a projector two pixels across."""
    width, height = (extent, 2) if axis == "x" else (2, extent)
    frames = render(pattern, width=width, height=height)
    return frames[:, 0, :] if axis == "x" else frames[:, :, 0]


axes = st.sampled_from(["x", "y"])
extents = st.integers(2, 2000)


class TestGray:
    @given(axis=axes, extent=extents, cell=st.integers(1, 300), inverted=st.booleans())
    def test_plain(self, *, axis: Axis, extent: int, cell: int, inverted: bool) -> None:
        code = GrayCode(axis, gray_bits(extent, cell), float(cell), inverted=inverted)
        frames = line(code, axis, extent)
        np.testing.assert_array_equal(read_gray(frames[: code.bits]), np.arange(extent) // cell)
        if inverted:
            np.testing.assert_array_equal(frames[code.bits :], 255 - frames[: code.bits])

    @given(axis=axes, extent=extents, half=st.integers(1, 150))
    def test_complementary(self, *, axis: Axis, extent: int, half: int) -> None:
        code = GrayCode(axis, gray_bits(extent, 2 * half), 2.0 * half, complementary=True)
        frames = line(code, axis, extent)
        np.testing.assert_array_equal(read_gray(frames), np.arange(extent) // half)
        np.testing.assert_array_equal(read_gray(frames[:-1]), np.arange(extent) // (2 * half))

    @given(extent=extents)
    def test_fractional_cells(self, extent: int) -> None:
        # Thirds of a pixel, exactly: cell i holds the pixels with 200 i <= 3 (u + 1/2).
        code = GrayCode("x", gray_bits(extent, 200 / 3), 200 / 3)
        expected = (6 * np.arange(extent) + 3) // 400
        np.testing.assert_array_equal(read_gray(line(code, "x", extent)), expected)


class TestOrders:
    @given(
        axis=axes, extent=extents, half=st.integers(1, 32), complementary=st.booleans(),
        steps=st.integers(3, 8),
    )  # fmt: skip
    def test_gray_orders_unwrap_every_pixel(
        self, *, axis: Axis, extent: int, half: int, complementary: bool, steps: int
    ) -> None:
        period = 2 * half
        fringe = Fringe(axis, float(period), equal_shifts(steps))
        code = GrayCode(axis, gray_bits(extent, period), float(period), complementary=complementary)
        wrapped = wrapped_phase(line(fringe, axis, extent), fringe.shifts_rad)
        cell = half if complementary else period
        centre = (read_gray(line(code, axis, extent)) + 0.5) * cell - 0.5
        reference = 2 * np.pi * (centre + 0.5) / period
        order = fringe_order(reference, wrapped)
        truth = 2 * np.pi * (np.arange(extent) + 0.5) / period
        assert np.abs(wrapped + 2 * np.pi * order - truth).max() <= phase_bound(255)
        if complementary:  # the reference stays a quarter fringe away, half the way to an error
            assert np.abs(reference - truth).max() < np.pi / 2

    @given(extent=extents, half=st.integers(1, 400))
    def test_orders_of_the_projector(self, extent: int, half: int) -> None:
        # An even period: pixel u is in fringe k when 2 k P - P <= 2 u + 1 <= 2 k P + P.
        period = 2 * half
        shown = (2 * np.arange(extent) + 1 + period) // (2 * period)
        orders = fringe_orders(extent, float(period))
        assert orders[0] == 0
        assert orders[-1] == math.floor(extent / period + 0.5)
        assert set(shown) <= set(orders)
        # The last order may begin at the very edge, where no pixel is left to show it.
        assert orders[-1] - shown[-1] in (0, 1)

    def test_twenty_orders_on_the_papers_projector(self) -> None:
        assert fringe_orders(608, 32.0) == range(20)
        assert fringe_orders(608, 32.0, zero_px=14.5) == range(20)
        assert fringe_orders(608, 32.0, zero_px=16.5) == range(-1, 19)


class TestCodeFrame:
    def test_every_order_of_the_papers_projector(self) -> None:
        words = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
        frame = line(Codeword("x", 32.0, words), "x", 608)[0] / 127.5 - 1
        for order in range(20):
            start = 32 * order - 16
            here = slice(max(start, 0), min(start + 32, 608))
            place = np.arange(here.start, here.stop) - start
            scores = [np.dot(frame[here], np.cos(2 * np.pi * place / word)) for word in words]
            assert np.argmax(scores) == order % 6
            # Rounding to half a level moves a sample by at most 1 / 255.
            ideal = np.cos(2 * np.pi * place / words[order % 6])
            assert np.abs(frame[here] - ideal).max() <= 1 / 255 + 1e-9

    @given(extent=extents, half=st.integers(4, 60))
    def test_begins_each_fringe_with_a_maximum(self, extent: int, half: int) -> None:
        frame = line(Codeword("y", 2.0 * half, (2.0, 3.0, 5.0)), "y", extent)[0]
        assert np.all(frame[half :: 2 * half] == 255)


class TestPresets:
    @given(
        preset=st.sampled_from(["paper", "calibrate", "measure"]),
        width=st.integers(2, 700),
        height=st.integers(2, 700),
    )
    def test_coded_presets(self, preset: Preset, width: int, height: int) -> None:
        sequence = make_sequence(preset, width=width, height=height)
        stacks = {type(s.pattern).__name__ + getattr(s.pattern, "axis", ""): (s.pattern, f)
                  for s, f in render_sequence(sequence)}  # fmt: skip
        truths = {"x": np.arange(width), "y": np.arange(height)[:, None]}
        for axis, truth in truths.items():
            fringe, frames = stacks[f"Fringe{axis}"]
            assert isinstance(fringe, Fringe)
            wrapped = wrapped_phase(frames, fringe.shifts_rad)
            reference = np.full(wrapped.shape, np.pi)
            if f"GrayCode{axis}" in stacks:
                code, bits = stacks[f"GrayCode{axis}"]
                assert isinstance(code, GrayCode)
                halves = read_gray(bits[: code.bits + 1])
                reference = np.pi * (halves + 0.5)
            else:  # one fringe spans the axis: unwrapped about the image's middle
                extent = sequence.extent("x" if axis == "x" else "y")
                reference *= extent / fringe.period_px
            assert_coordinate(fringe, wrapped, reference, truth=truth)

    @given(width=st.integers(2, 2000), steps=st.integers(3, 6))
    def test_multi_frequency(self, width: int, steps: int) -> None:
        sequence = make_sequence("multi-frequency", width=width, height=2, axes=("x",), steps=steps)
        coordinate = np.full((2, width), (width - 1) / 2)  # the projector's centre
        for item, frames in render_sequence(sequence):
            fringe = item.pattern
            if isinstance(fringe, Fringe):
                wrapped = wrapped_phase(frames, fringe.shifts_rad)
                reference = 2 * np.pi * (coordinate + 0.5) / fringe.period_px
                assert_coordinate(fringe, wrapped, reference, truth=np.arange(width))
                phase = wrapped + 2 * np.pi * fringe_order(reference, wrapped)
                coordinate = phase * fringe.period_px / (2 * np.pi) - 0.5


def assert_coordinate(
    fringe: Fringe, wrapped: Floats, reference: Floats, *, truth: NDArray[np.integer]
) -> None:
    phase = wrapped + 2 * np.pi * fringe_order(reference, wrapped)
    coordinate = phase * fringe.period_px / (2 * np.pi) - 0.5
    bound = phase_bound(255) * fringe.period_px / (2 * np.pi)
    assert np.abs(coordinate - truth).max() <= bound


def test_the_papers_equation_ten() -> None:
    sequence = make_sequence("paper", width=608, height=684)
    frames = render(sequence.sets[0].pattern, width=608, height=684)[:, 0].astype(float)
    phi = np.arctan2(math.sqrt(3) * (frames[0] - frames[2]), 2 * frames[1] - frames[0] - frames[2])
    truth = 2 * np.pi * (np.arange(608) + 0.5) / 32
    error = np.angle(np.exp(1j * (phi - truth)))
    assert np.abs(error).max() <= phase_bound(255)


@pytest.mark.parametrize(("cell", "bits"), [(32.0, 5), (1.0, 10)])
def test_bits_are_enough_and_no_more(cell: float, bits: int) -> None:
    assert gray_bits(608, cell) == bits
