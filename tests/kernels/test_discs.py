"""Area of a disc in rectangles, against counting."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.kernels.discs import disc_area, discs_area

RADIUS = 2.5
STEPS = 400


def test_a_disc_in_rectangles_of_every_kind() -> None:
    """Counted on 400 x 400 points, of which the disc's rim passes by up to 4 in 400 of each row."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        ends = np.sort(rng.uniform(-3.5, 3.5, (2, 2)), axis=1)
        low, high = ends[:, 0], ends[:, 1]
        share = (np.arange(STEPS) + 0.5) / STEPS
        x, y = (low[k] + share * (high[k] - low[k]) for k in (0, 1))
        inside = np.mean(x[:, None] ** 2 + y[None] ** 2 < RADIUS**2)
        size = float(np.prod(high - low))
        found = disc_area(tuple(low), tuple(high), RADIUS)
        assert found == pytest.approx(inside * size, abs=2 / STEPS * size)


def test_parts_by_hand() -> None:
    whole = np.pi * RADIUS**2
    assert disc_area((-9.0, -9.0), (9.0, 9.0), RADIUS) == pytest.approx(whole, rel=1e-12)
    assert disc_area((0.0, -9.0), (9.0, 0.0), RADIUS) == pytest.approx(whole / 4, rel=1e-12)
    segment = RADIUS**2 * (np.pi / 3 - np.sqrt(3) / 4)  # beyond half of the radius
    assert disc_area((1.25, -9.0), (9.0, 9.0), RADIUS) == pytest.approx(segment, rel=1e-12)
    assert disc_area((1.8, 1.8), (9.0, 9.0), RADIUS) == pytest.approx(0.0, abs=1e-12)


def test_a_grid_of_them() -> None:
    grid = (RADIUS, 6.0, 4, 3)
    everything = discs_area((-9.0, -9.0), (99.0, 99.0), grid)
    assert everything == pytest.approx(12 * np.pi * RADIUS**2, rel=1e-12)
    assert discs_area((-9.0, -9.0), (-3.0, 99.0), grid) == 0.0
    quarters = discs_area((6.0, 0.0), (12.0, 6.0), grid)  # one of each of four
    assert quarters == pytest.approx(np.pi * RADIUS**2, rel=1e-12)
