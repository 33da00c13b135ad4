"""Orders on which several periods agree: against every tuple of orders, and by hand."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from fringeworks.errors import DecodeError
from fringeworks.model import Fringe, Sensor
from fringeworks.phase.chained import order_by_frequencies
from fringeworks.phase.demodulate import demodulate
from fringeworks.phase.number_theory import least_safe_step, order_by_number_theory
from fringeworks.phase.orders import AxisFrames
from fringeworks.phase.temporal import PLANNED_SIGMA_RAD
from fringeworks.phase.window import CoordinateWindow
from tests.phase.encoding import Array, capture_of, equal_shifts, fringe_waves, sweep

EXTENT = 608
TRIO = (45.0, 32.0, 36.0)
# Half the way to the next tuple is 2.95 sigma at 0.1 rad (`least_safe_step`).


def fringes_of(*periods: float) -> list[Fringe]:
    return [Fringe("x", period, equal_shifts(4)) for period in periods]


def seen(u: Array, periods: tuple[float, ...] = TRIO, *, sigma: float = 0.0) -> AxisFrames:
    rng = np.random.default_rng(1)
    sensor = Sensor(65535.0, gain=0.0, read_noise=sigma)
    sets = [
        (fringe, np.rint(32000 + 20000 * waves + sigma * rng.standard_normal(waves.shape)))
        for fringe in fringes_of(*periods)
        for waves in [fringe_waves(fringe, u)]
    ]
    images = [(fringe, grey.astype(np.uint16)) for fringe, grey in sets]
    phases = tuple(demodulate(grey, fringe, sensor) for fringe, grey in images)
    return AxisFrames(capture_of(*images, extent=EXTENT, sensor=sensor), "x", phases)


U = sweep(EXTENT, samples_per_px=4, rows=2)


def true_order(u: Array, frames: AxisFrames) -> Array:
    wrapped = frames.finest
    return np.asarray(np.rint((u + 0.5) / wrapped.fringe.period_px - wrapped.phase / (2 * np.pi)))


@pytest.mark.parametrize("periods", [TRIO, (58.0, 63.0), (638.4, 128.0, 32.0)])
def test_every_order(periods: tuple[float, ...]) -> None:
    frames = seen(U, periods)
    ordered = order_by_number_theory(frames)
    np.testing.assert_array_equal(ordered.phase.order, true_order(U, frames))
    assert (ordered.phase.margin > 0.9).all()


def test_periods_that_no_chain_of_beats_can_order() -> None:
    """Their longest beat is 480 px, and yet all three together repeat after 1440 px only."""
    with pytest.raises(DecodeError, match=r"the longest carrier .* beat of 480 px"):
        order_by_frequencies(seen(U))
    assert order_by_number_theory(seen(U)).route == ("fringes of 45, 36, 32 px together",)


def test_against_all_tuples() -> None:
    """Noise of 0.12 rad, where many pixels are wrong or near it: the same least spread."""
    u = np.random.default_rng(0).uniform(-0.5, EXTENT - 0.5, (4, 40))
    frames = seen(u, sigma=20000 * 0.12 * np.sqrt(2))
    ordered = order_by_number_theory(frames)
    known = np.isfinite(sum(item.phase for item in frames.phases))
    assert known.any()
    phases = sorted(frames.phases, key=lambda item: item.fringe.period_px)
    periods = np.array([item.fringe.period_px for item in phases])
    sure = np.isfinite(ordered.phase.margin)
    assert 0 < sure.sum() < sure.size
    for at in zip(*np.nonzero(known), strict=True):
        phi = np.array([item.phase[at] for item in phases], float)
        weights = (2 * np.pi / (periods * [float(item.sigma[at]) for item in phases])) ** 2
        spreads: dict[int, float] = {}
        for orders in itertools.product(*(range(-1, int(EXTENT / p) + 3) for p in periods)):
            x = -0.5 + periods * (phi / (2 * np.pi) + orders)
            spread = float(weights @ (x - weights @ x / weights.sum()) ** 2)
            if -8.5 <= x[0] <= EXTENT + 7.5:  # a quarter of a fringe beyond the image
                spreads[orders[0]] = min(spread, spreads.get(orders[0], np.inf))
        first, second = sorted(spreads, key=lambda order: spreads[order])[:2]
        lead = (spreads[second] - spreads[first]) / 2
        assert sure[at] == (lead >= np.log(1000) and spreads[first] <= 50)
        if sure[at]:
            assert ordered.phase.order[at] == first
            roots = np.sqrt([spreads[first], spreads[second]])
            margin = (roots[1] - roots[0]) / roots.sum()
            assert ordered.phase.margin[at] == pytest.approx(margin, rel=1e-2)


def test_sure_pixels_are_right() -> None:
    """B = 17 sigma: half the way to the next tuple is 12 sigma."""
    u = sweep(EXTENT, samples_per_px=4, rows=8)
    frames = seen(u, sigma=20000 / 17)
    ordered = order_by_number_theory(frames)
    sure = np.isfinite(ordered.phase.margin)
    assert sure.mean() > 0.99
    assert (ordered.phase.order == true_order(u, frames))[sure].all()


def test_the_window_leaves_out_what_lies_elsewhere() -> None:
    """18 and 21 px repeat after 126 px: a window of 100 px about the truth decides."""
    frames = seen(U, (18.0, 21.0))
    low = (U - 50).astype(np.float32)
    near = dataclasses.replace(frames, window=CoordinateWindow(low, low + 100))
    with pytest.raises(DecodeError, match="18 and 21 px along x look alike again after 126 px"):
        order_by_number_theory(near)
    frames = seen(U)
    near = dataclasses.replace(frames, window=CoordinateWindow(low, low + 25))
    ordered = order_by_number_theory(near)
    assert (ordered.phase.order == -1)[:, 400:].all()  # the truth is outside


def test_safety_by_hand() -> None:
    """One fringe of 30 px is 3 px short of one of 33: sigma 30 and 33 px / 2 pi / 10 rad."""
    step, safety = least_safe_step(fringes_of(30.0, 33.0), 40)
    assert step == 30.0
    sigma = PLANNED_SIGMA_RAD / (2 * np.pi) * np.hypot(30, 33)
    assert safety == pytest.approx(3 / sigma / 2, rel=1e-12)


def test_one_period_is_none() -> None:
    with pytest.raises(DecodeError, match="need fringes of two periods or more along x, got 32 px"):
        order_by_number_theory(seen(U, (32.0,)))
