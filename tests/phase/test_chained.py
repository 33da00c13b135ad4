"""Today's chain behind the common interface: the same orders as `decode` finds."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.errors import DecodeError
from fringeworks.model import Capture, Fringe, GrayCode, Pattern, gray_bits
from fringeworks.phase.chained import order_by_frequencies, order_by_gray
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.demodulate import demodulate
from fringeworks.phase.orders import AxisFrames
from tests.phase.encoding import BLACK, WHITE, Scene, equal_shifts, sweep

EXTENT = 608


def seen(*patterns: Pattern, blur_px: float = 2.0) -> Capture:
    u = sweep(EXTENT, samples_per_px=2, rows=6)
    scene = Scene(u, EXTENT, read=3.0, modulation=30.0, blur_px=blur_px)
    return scene.capture(*patterns, WHITE, BLACK, rng=np.random.default_rng(2))


def frames_of(capture: Capture) -> AxisFrames:
    phases = [
        demodulate(frames, fringe, capture.sensor) for fringe, frames, _ in capture.find(Fringe)
    ]
    return AxisFrames(capture, "x", tuple(phases))


def fringe(period_px: float) -> Fringe:
    return Fringe("x", period_px, equal_shifts(4))


def gray(cell_px: float, *, complementary: bool) -> GrayCode:
    return GrayCode("x", gray_bits(EXTENT, cell_px), cell_px, complementary=complementary)


@pytest.mark.parametrize("complementary", [False, True])
@pytest.mark.parametrize("blur_px", [0.0, 2.0])
def test_gray_is_what_decode_finds(complementary: bool, blur_px: float) -> None:
    code = gray(32.0, complementary=complementary)
    capture = seen(fringe(32.0), code, blur_px=blur_px)
    ordered, column = order_by_gray(frames_of(capture)), decode_capture(capture).column
    assert column is not None
    assert column.phase is not None
    known = np.isfinite(column.phase.margin)
    assert known.any()
    assert ordered.route == column.route
    np.testing.assert_array_equal(ordered.phase.order[known], column.phase.order[known])
    np.testing.assert_array_equal(ordered.phase.margin[known], column.phase.margin[known])
    more = np.isfinite(ordered.phase.margin) & ~known
    coordinate = -0.5 + 32 * ordered.phase.phase[more] / (2 * np.pi)
    assert ((coordinate < -0.5) | (coordinate > EXTENT - 0.5)).all()


def test_frequencies_are_what_decode_finds() -> None:
    capture = seen(fringe(638.4), fringe(76.0), fringe(16.0))
    ordered, column = order_by_frequencies(frames_of(capture)), decode_capture(capture).column
    assert column is not None
    assert column.phase is not None
    known = np.isfinite(column.phase.margin)
    assert known.mean() > 0.99
    assert ordered.route == column.route
    np.testing.assert_array_equal(ordered.phase.order[known], column.phase.order[known])


def test_void_pixels_of_any_set_have_no_order() -> None:
    capture = seen(fringe(638.4), fringe(76.0), fringe(16.0))
    capture.frames[1][:, 2] = 120  # no modulation in the middle set
    phase = order_by_frequencies(frames_of(capture)).phase
    assert (phase.order[2] == -1).all()
    assert np.isnan(phase.margin[2]).all()


def test_no_gray_code() -> None:
    with pytest.raises(DecodeError, match="the capture has no Gray code along x: add one"):
        order_by_gray(frames_of(seen(fringe(32.0))))
