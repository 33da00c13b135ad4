"""Phase coding: levels, the edges of the fringes, noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import Capture, Frames, Fringe, Sensor, Staircase
from fringeworks.model.sequence import fringe_orders
from fringeworks.phase.demodulate import demodulate
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.phase.staircase import order_by_staircase
from tests.phase.encoding import Array, capture_of, equal_shifts, fringe_waves, sweep

EXTENT = 608
FINE = Fringe("x", 32.0, equal_shifts(3))
COARSE_STAIR = Staircase("x", 32.0, 20, equal_shifts(3))
TAPS = np.linspace(-3, 3, 61)


def stair_waves(stair: Staircase, u: Array) -> Array:
    """cos(stair - shift); the order is counted from half a fringe left of the image's edge."""
    order = np.floor((u + 0.5) / stair.period_px + 0.5)
    phase = -np.pi + 2 * np.pi * (order + 0.5) / stair.levels
    return np.stack([np.cos(phase - shift) for shift in stair.shifts_rad])


def blurred(stair: Staircase, u: Array, sigma_px: float) -> Array:
    weights = np.exp(-0.5 * TAPS**2)
    weights /= weights.sum()
    seen = [stair_waves(stair, u + tap * sigma_px) for tap in TAPS]
    return np.asarray(np.tensordot(weights, seen, axes=1))


def grey(waves: Array, sigma: float = 0.0, seed: int = 0) -> Frames:
    noise = np.random.default_rng(seed).standard_normal(waves.shape)
    return np.rint(32000 + 20000 * waves + sigma * noise).astype(np.uint16)


def seen(
    u: Array,
    *,
    stair: Staircase = COARSE_STAIR,
    sigma: float = 0.0,
    blur_px: float = 0.0,
    fringes: tuple[Fringe, ...] = (FINE,),
) -> AxisFrames:
    sensor = Sensor(65535.0, gain=0.0, read_noise=sigma)
    waves = blurred(stair, u, blur_px) if blur_px else stair_waves(stair, u)
    sets = [(item, grey(fringe_waves(item, u), sigma, n)) for n, item in enumerate(fringes)]
    capture = capture_of(*sets, (stair, grey(waves, sigma, 9)), extent=EXTENT, sensor=sensor)
    return of_capture(capture, fringes)


def of_capture(capture: Capture, fringes: tuple[Fringe, ...]) -> AxisFrames:
    stacks = {item: frames for item, frames, _ in capture.find(Fringe)}
    phases = tuple(demodulate(stacks[item], item, capture.sensor) for item in fringes)
    return AxisFrames(capture, "x", phases)


def true_order(u: Array, ordered: Ordered) -> NDArray[np.float64]:
    """Of the wrapped phase that was measured: at a wrap noise decides on which side it is."""
    wrapped = ordered.phase.wrapped
    turns = (u - wrapped.fringe.zero_px) / wrapped.fringe.period_px
    return np.asarray(np.rint(turns - wrapped.phase / (2 * np.pi)))


U = sweep(EXTENT, samples_per_px=4, rows=2)


def test_every_order_at_all_sub_pixel_offsets() -> None:
    ordered = order_by_staircase(seen(U))
    np.testing.assert_array_equal(ordered.phase.order, true_order(U, ordered))
    assert set(np.unique(ordered.phase.order)) == set(fringe_orders(EXTENT, 32.0))
    assert ordered.route == ("staircase of 20 levels",)


def test_the_margin_is_one_where_a_level_is_seen_exactly() -> None:
    """In the middle of a fringe, but for 16 bit rounding: 1e-5 rad, 6e-5 of a half level."""
    ordered = order_by_staircase(seen(U))
    middle = np.abs(ordered.phase.wrapped.phase) < 1
    np.testing.assert_allclose(ordered.phase.margin[middle], 1, atol=2e-4)


@pytest.mark.parametrize("blur_px", [0.5, 1.0, 2.0])
def test_blurred_steps_are_repaired_by_the_wrapped_phase(blur_px: float) -> None:
    """A noise of a hundredth of B moves wraps by 0.05 px; without repair it moves steps too."""
    frames = seen(U, blur_px=blur_px, sigma=200.0)
    ordered = order_by_staircase(frames)
    np.testing.assert_array_equal(ordered.phase.order, true_order(U, ordered))
    stair = demodulate(
        frames.capture.frames[1], Fringe("x", 32.0, equal_shifts(3)), frames.capture.sensor
    )
    plain = np.rint(20 * (stair.phase + np.pi) / (2 * np.pi) - 0.5)
    assert (plain != true_order(U, ordered)).any()


def test_as_many_levels_as_the_module_says_are_safe() -> None:
    """13 levels at B = 17 sigma: inside fringes 6e-6 of the pixels (4.5 sigma) are not certain,
    at their edges, where the wrapped phase's noise comes on top, some more. Of those that are,
    one in a hundred of the doubtful ones at most is wrong."""
    extent, sigma = 32 * 12, 20000 / 17
    stair = Staircase("x", 32.0, 13, equal_shifts(3))
    assert math.sqrt(2 / 3) / 17 == pytest.approx(math.pi / 5 / 13, rel=0.01)
    u = sweep(extent, samples_per_px=4, rows=64)
    ordered = order_by_staircase(seen(u, stair=stair, sigma=sigma, blur_px=1.0))
    certain = np.isfinite(ordered.phase.margin)
    assert certain.mean() > 0.999
    wrong = certain & (ordered.phase.order != true_order(u, ordered))
    assert wrong.mean() < 0.01 * 0.005


def test_near_an_edge_the_wrapped_phase_is_doubted_too() -> None:
    """8 levels at B = 10 sigma: noise moves a pixel by 0.4 px, where blurred steps are 2 px long.

    Of the pixels within 2 px of an edge, one in five thousand is certain and wrong at most.
    """
    u = sweep(32 * 7, samples_per_px=4, rows=256)
    stair = Staircase("x", 32.0, 8, equal_shifts(3))
    ordered = order_by_staircase(seen(u, stair=stair, sigma=20000 / 10, blur_px=1.0))
    edge = np.abs(np.mod(u + 0.5, 32.0) - 16) < 2
    wrong = np.isfinite(ordered.phase.margin) & (ordered.phase.order != true_order(u, ordered))
    assert np.mean(wrong[edge]) < 2e-4
    assert np.isfinite(ordered.phase.margin[edge]).mean() > 0.9


def test_too_many_levels_for_the_noise_are_void_and_hardly_wrong() -> None:
    """20 levels at B = 6 sigma, 0.43 of a level: of certain pixels one in a hundred at most."""
    u = sweep(EXTENT, samples_per_px=4, rows=8)
    ordered = order_by_staircase(seen(u, sigma=20000 / 6))
    certain = np.isfinite(ordered.phase.margin)
    wrong = certain & (ordered.phase.order != true_order(u, ordered))
    assert certain.mean() < 0.05
    assert wrong.sum() <= 0.02 * certain.size * 0.05
    assert (ordered.phase.order[~certain] == -1).all()


def test_finer_fringes_go_on_from_the_stair() -> None:
    finer = Fringe("x", 8.0, equal_shifts(4))
    ordered = order_by_staircase(seen(U, fringes=(FINE, finer), sigma=200.0, blur_px=1.0))
    assert ordered.phase.fringe == finer
    np.testing.assert_array_equal(ordered.phase.order, true_order(U, ordered))
    coarse = order_by_staircase(seen(U, sigma=200.0, blur_px=1.0))
    assert (ordered.phase.margin <= coarse.phase.margin).all()
    assert (ordered.route[0], ordered.route[-1]) == ("staircase of 20 levels", "fringes of 8 px")


def test_a_capture_without_a_staircase_of_the_axis() -> None:
    other = Staircase("y", 32.0, 20, equal_shifts(3))
    with pytest.raises(DecodeError, match="no staircase along x: add one"):
        order_by_staircase(seen(U, stair=other))


def test_a_staircase_of_other_fringes() -> None:
    with pytest.raises(DecodeError, match="changes every 32 px, and no fringes have that period"):
        order_by_staircase(seen(U, fringes=(Fringe("x", 16.0, equal_shifts(3)),)))
