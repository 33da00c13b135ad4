"""Grey levels: hand-computed images of tiny projectors, and what rounding may cost."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.model import (
    Axis,
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Picture,
    Sequence,
    Speckle,
    Staircase,
    Uniform,
)
from fringeworks.patterns import equal_shifts, make_sequence, render, render_sequence
from tests.patterns.decoder import phase_bound, wrapped_phase

WIDTH, HEIGHT = 8, 4


def rows(pattern: Pattern) -> NDArray[np.integer]:
    """Frames of a pattern along x on the tiny projector, one row each: all rows must agree."""
    frames = render(pattern, width=WIDTH, height=HEIGHT)
    np.testing.assert_array_equal(frames, np.broadcast_to(frames[:, :1], frames.shape))
    return frames[:, 0]


class TestByHand:
    def test_four_step_fringes(self) -> None:
        # Phi at the pixels is 45, 135, 225, 315 degrees; 127.5 + 127.5 cos 45 = 217.66.
        expected = [
            [218, 37, 37, 218, 218, 37, 37, 218],
            [218, 218, 37, 37, 218, 218, 37, 37],
            [37, 218, 218, 37, 37, 218, 218, 37],
            [37, 37, 218, 218, 37, 37, 218, 218],
        ]
        np.testing.assert_array_equal(rows(Fringe("x", 4.0, equal_shifts(4))), expected)

    def test_fringe_rounds_to_nearest(self) -> None:
        # 15, 45 ... 225 degrees: 250.66, 217.66, 160.50-, 94.50+, 37.34, 4.34, 4.34, 37.34.
        expected = [[251, 218, 160, 95, 37, 4, 4, 37]]
        np.testing.assert_array_equal(rows(Fringe("x", 12.0, equal_shifts(3)))[1:2], expected)

    def test_fringe_counts_from_its_zero(self) -> None:
        # zero_px = 0: Phi = 0, 90, 180, 270 degrees. A cosine's zero is half a level: up.
        expected = [[255, 128, 0, 128, 255, 128, 0, 128]]
        fringe = Fringe("x", 4.0, equal_shifts(4), zero_px=0.0)
        np.testing.assert_array_equal(rows(fringe)[:1], expected)

    def test_fringes_along_y(self) -> None:
        frames = render(Fringe("y", 4.0, equal_shifts(4)), width=WIDTH, height=HEIGHT)[:1]
        expected = np.repeat([[218], [37], [37], [218]], WIDTH, axis=1)[None]
        np.testing.assert_array_equal(frames, expected)

    def test_gray_code_with_complement_and_inverse(self) -> None:
        # cells 0 0 1 1 2 2 3 3 -> 00 01 11 10; half cells 0..7 end in 0 1 1 0 0 1 1 0.
        code = GrayCode("x", bits=2, cell_px=2.0, inverted=True, complementary=True)
        expected = [
            [0, 0, 0, 0, 1, 1, 1, 1],
            [0, 0, 1, 1, 1, 1, 0, 0],
            [0, 1, 1, 0, 0, 1, 1, 0],
            [1, 1, 1, 1, 0, 0, 0, 0],
            [1, 1, 0, 0, 0, 0, 1, 1],
        ]
        np.testing.assert_array_equal(rows(code), 255 * np.array(expected))

    def test_code_frame(self) -> None:
        # Fringe 0 shows its right half, pixels 4..7 of the codeword of 2 px; fringe 1 starts at
        # pixel 4 with a maximum of the codeword of 4 px.
        expected = [[255, 0, 255, 0, 255, 128, 0, 128]]
        np.testing.assert_array_equal(rows(Codeword("x", 8.0, (2.0, 4.0))), expected)
        swapped = Codeword("x", 8.0, (2.0, 4.0), sequence=(1, 0))
        expected = [[255, 128, 0, 128, 255, 0, 255, 0]]
        np.testing.assert_array_equal(rows(swapped), expected)

    def test_staircase(self) -> None:
        # Orders 0 0 1 1 1 1 2 2 of three levels: -120, 0, 120 degrees.
        expected = [
            [64, 64, 64, 64, 64, 64, 255, 255],
            [64, 64, 255, 255, 255, 255, 64, 64],
            [255, 255, 64, 64, 64, 64, 64, 64],
        ]
        np.testing.assert_array_equal(rows(Staircase("x", 4.0, 3, equal_shifts(3))), expected)

    def test_colour_is_red_green_blue(self) -> None:
        frames = render(Colour("x", 4.0, ("red", "#0080FF")), width=WIDTH, height=HEIGHT)
        assert frames.shape == (1, HEIGHT, WIDTH, 3)
        red, blue = [255, 0, 0], [0, 128, 255]
        expected = [red, red, blue, blue, blue, blue, red, red]
        np.testing.assert_array_equal(frames[0], np.broadcast_to(expected, (HEIGHT, WIDTH, 3)))

    def test_colour_along_y(self) -> None:
        frames = render(Colour("y", 4.0, ("black", "white")), width=WIDTH, height=HEIGHT)
        np.testing.assert_array_equal(frames[0, :, 3, 1], [0, 0, 255, 255])

    def test_checkerboard_starts_black(self) -> None:
        frames = render(Checkerboard(2.0), width=WIDTH, height=HEIGHT)
        even = [0, 0, 255, 255, 0, 0, 255, 255]
        odd = even[2:] + even[:2]
        np.testing.assert_array_equal(frames, [[even, even, odd, odd]])

    @pytest.mark.parametrize(("level", "grey"), [(0.0, 0), (0.5, 128), (0.25, 64), (1.0, 255)])
    def test_uniform(self, level: float, grey: int) -> None:
        np.testing.assert_array_equal(rows(Uniform(level)), [[grey] * WIDTH])


class TestSpeckle:
    def test_half_of_it_is_white_and_the_seed_decides(self) -> None:
        one = render(Speckle(1, 4.0), width=608, height=684)
        again = render(Speckle(1, 4.0), width=608, height=684)
        other = render(Speckle(2, 4.0), width=608, height=684)
        np.testing.assert_array_equal(one, again)
        assert np.mean(one != other) > 0.4
        assert set(np.unique(one)) == {0, 255}
        # Coverage varies by less than sqrt(dot area / image area), for half coverage.
        sigma = math.sqrt(math.pi * 2.0**2 / one.size)
        assert abs(np.mean(one) / 255 - 0.5) < 5 * sigma

    def test_edges_are_covered_as_the_middle_is(self) -> None:
        # Along a line coverage varies by less than sqrt(dot width / length).
        length, dot = 8000, 2.0
        edges = render(Speckle(4, dot), width=16, height=length)[0, :, [0, -1]]
        assert np.abs(edges.mean(axis=1) / 255 - 0.5).max() < 5 * math.sqrt(dot / length)

    def test_dots_have_their_size(self) -> None:
        # A lone pixel between blacks cannot be: a dot of 4 px covers at least 2 x 2 of them.
        white = render(Speckle(3, 4.0), width=200, height=200)[0] > 0
        alone = white[1:-1, 1:-1] & ~white[:-2, 1:-1] & ~white[2:, 1:-1]
        assert white.any()
        assert not (alone & ~white[1:-1, :-2] & ~white[1:-1, 2:]).any()


class TestRounding:
    @given(
        period=st.floats(2.0, 3000.0),
        zero=st.floats(-2.0, 2.0),
        steps=st.integers(3, 16),
        extent=st.integers(2, 2000),
        bits=st.sampled_from([8, 10, 12, 16]),
    )
    def test_phase_and_mean_of_the_shifts(
        self, *, period: float, zero: float, steps: int, extent: int, bits: int
    ) -> None:
        fringe = Fringe("x", period, equal_shifts(steps), zero_px=zero)
        frames = render(fringe, width=extent, height=2, bits=bits)
        full_scale = 2**bits - 1
        phase = 2 * np.pi * (np.arange(extent) - zero) / period
        error = np.angle(np.exp(1j * (wrapped_phase(frames, fringe.shifts_rad) - phase)))
        assert np.abs(error).max() <= phase_bound(full_scale)
        # Each rounding error is at most half a level, so their mean over the shifts is too.
        assert np.abs(frames.mean(axis=0) - full_scale / 2).max() <= 0.5

    @given(period=st.floats(2.0, 500.0), half=st.integers(2, 8), extent=st.integers(2, 2000))
    def test_opposite_frames_are_complements(self, period: float, half: int, extent: int) -> None:
        fringe = Fringe("x", period, equal_shifts(2 * half))
        frames = render(fringe, width=extent, height=2).astype(int)
        pair = frames[:half] + frames[half:]
        midway = np.isin(frames[:half], (127, 128))
        assert np.all((pair == 255) | (midway & (pair == 256)))

    def test_no_bias(self) -> None:
        # Errors of an incommensurate period spread evenly over one level: sd 1 / sqrt(12).
        extent, period = 1920, 37.3
        frames = render(Fringe("x", period, equal_shifts(3)), width=extent, height=2)[:, 0]
        phase = 2 * np.pi * (np.arange(extent) + 0.5) / period
        exact = 127.5 + 127.5 * np.cos(phase - np.array(equal_shifts(3))[:, None])
        assert abs(np.mean(frames - exact)) < 5 / math.sqrt(12 * frames.size)

    @pytest.mark.parametrize(("steps", "ripple"), [(3, 0.205), (4, 0.0075), (8, 0.00003)])
    def test_ripple_of_a_response_of_gamma(self, steps: int, ripple: float) -> None:
        """The rms that docs/patterns.md promises for gamma 2.2, at 16 bits."""
        fringe = Fringe("x", 2000.0, equal_shifts(steps))
        seen = (render(fringe, width=2000, height=2, bits=16)[:, 0] / 65535) ** 2.2
        truth = 2 * np.pi * (np.arange(2000) + 0.5) / 2000
        phase = np.angle(np.exp(1j * np.array(fringe.shifts_rad)) @ seen)
        error = np.angle(np.exp(1j * (phase - truth)))
        assert np.sqrt(np.mean(error**2)) == pytest.approx(ripple, rel=0.2)

    @pytest.mark.parametrize(("bits", "dtype"), [(8, np.uint8), (12, np.uint16), (16, np.uint16)])
    def test_full_range(self, bits: int, dtype: type[np.generic]) -> None:
        frames = render(GrayCode("x", 3, 1.0), width=WIDTH, height=HEIGHT, bits=bits)
        assert frames.dtype == dtype
        assert set(np.unique(frames)) == {0, 2**bits - 1}

    @pytest.mark.parametrize("bits", [7, 17])
    def test_depth_out_of_range(self, bits: int) -> None:
        with pytest.raises(UsageError, match=rf"^bits must be 8 to 16, got {bits}$"):
            render(Uniform(1.0), width=WIDTH, height=HEIGHT, bits=bits)


class TestSequence:
    @pytest.mark.parametrize("axis", ["x", "y"])
    def test_stacks_fit_their_sets(self, axis: Axis) -> None:
        sequence = make_sequence("paper", width=70, height=50, axes=(axis,))
        rendered = list(render_sequence(sequence))
        assert tuple(item for item, _ in rendered) == sequence.sets
        for item, stack in rendered:
            assert stack.shape == (item.image_count, 50, 70)

    def test_repeats_stand_frame_by_frame(self) -> None:
        sequence = Sequence(WIDTH, HEIGHT, (PatternSet(GrayCode("x", 3, 1.0), repeats=2),))
        ((_, stack),) = render_sequence(sequence)
        single = render(GrayCode("x", 3, 1.0), width=WIDTH, height=HEIGHT)
        np.testing.assert_array_equal(stack, single[[0, 0, 1, 1, 2, 2]])

    def test_refuses_before_the_first_set(self) -> None:
        sequence = Sequence(WIDTH, HEIGHT, (PatternSet(Uniform(1.0)), PatternSet(Picture())))
        with pytest.raises(UsageError, match="drawn from its description, got a picture"):
            render_sequence(sequence)
        with pytest.raises(UsageError, match="bits must be"):
            render_sequence(Sequence(WIDTH, HEIGHT, ()), bits=1)

    def test_frames_are_the_callers_own(self) -> None:
        frames = render(Uniform(1.0), width=WIDTH, height=HEIGHT)
        frames[0, 0, 0] = 7
        assert frames[0, 1, 0] == 255
