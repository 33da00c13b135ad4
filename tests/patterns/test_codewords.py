"""Named code frames: the criterion behind the robust set, and uniqueness of the de Bruijn one."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from fringeworks.model.sequence import fringe_orders
from fringeworks.patterns import make_sequence
from fringeworks.patterns.codewords import (
    PAPER_CODEWORDS_PX,
    ROBUST_CODEWORDS_PX,
    make_code_frame,
)


def least_difference(periods: tuple[float, ...]) -> float:
    """Of the two most alike cosines over a fringe of 32 px, mean square, after 1.2 px of blur."""
    u = np.linspace(-14.5, 14.5, 2000)
    waves = {}
    for p in periods:
        tones = [(f, np.sinc(f) * np.exp(-2 * (np.pi * 1.2 * f) ** 2)) for f in (1 / p, 1 - 1 / p)]
        wave = sum(a * np.cos(2 * np.pi * f * (u + 15.5)) for f, a in tones)
        waves[p] = wave - np.mean(wave)
    return min(float(np.mean((waves[p] - waves[q]) ** 2)) for p, q in combinations(periods, 2))


def test_robust_is_the_best_of_all_sets() -> None:
    best = max(combinations([float(p) for p in range(2, 12)], 6), key=least_difference)
    assert best == ROBUST_CODEWORDS_PX
    assert least_difference(best) == pytest.approx(0.28, rel=0.1)
    assert least_difference(PAPER_CODEWORDS_PX) < 0.001


@pytest.mark.parametrize(("extent", "window"), [(608, 2), (1100, 2), (1280, 3), (1920, 3)])
def test_neighbours_are_unique(extent: int, window: int) -> None:
    code = make_code_frame("de-bruijn", "x", 32.0, extent)
    words = [code.codeword_of(order) for order in fringe_orders(extent, 32.0)]
    runs = [tuple(words[n : n + window]) for n in range(len(words) - window + 1)]
    assert len(set(runs)) == len(runs)


def test_they_follow_the_fringes() -> None:
    for name in ("robust", "de-bruijn"):
        code = make_code_frame(name, "x", 64.0, 608)
        assert code.codewords_px == tuple(2 * word for word in ROBUST_CODEWORDS_PX)


def test_in_a_sequence() -> None:
    shown = make_sequence("paper", width=608, height=684, codewords_px="de-bruijn")
    assert make_code_frame("de-bruijn", "x", 32.0, 608) in [item.pattern for item in shown.sets]
