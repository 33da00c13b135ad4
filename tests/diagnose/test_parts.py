"""The parts of the checks by closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.diagnose.frame_errors import fit_frame_errors
from fringeworks.diagnose.look import look_at
from fringeworks.diagnose.motion import image_shift
from fringeworks.diagnose.suspicion import lost_px, wrong_order_px
from fringeworks.model import Capture, Fringe, PatternSet, Sensor, Sequence

SHIFTS = tuple(2 * np.pi * n / 8 for n in range(8))


def capture_of(gains: np.ndarray, *, twofold: float = 0.0) -> Capture:
    """Fringes of 20 px on a plane, 16 bits, with the light of each frame times a gain."""
    phase = np.tile(np.linspace(0, 30, 200), (60, 1))
    psi = phase[None] - np.array(SHIFTS)[:, None, None]
    light = 20000 + 12000 * (np.cos(psi) + twofold * np.cos(2 * psi))
    frames = np.rint(light * gains[:, None, None]).astype(np.uint16)
    sequence = Sequence(100, 60, (PatternSet(Fringe("x", 20.0, SHIFTS)),))
    return Capture(sequence, (frames,), Sensor(65535.0))


def test_gains_follow_from_the_residual() -> None:
    gains = np.array([0.02, -0.01, 0.0, 0.015, -0.02, 0.01, 0.005, -0.02])
    found = fit_frame_errors(look_at(capture_of(1 + gains))[0])

    assert found is not None
    # First order: what is left out is of the order of the gains' square, 4e-4.
    assert found.gains == pytest.approx(gains - gains.mean(), abs=2e-3)
    assert found.by_light > 0.95


def test_the_second_harmonic_follows_from_the_residual() -> None:
    found = fit_frame_errors(look_at(capture_of(np.ones(8), twofold=0.1))[0])

    assert found is not None
    assert found.harmonic == pytest.approx(0.1, rel=1e-3)  # eight steps keep it whole
    assert found.by_harmonic > 0.99
    assert found.by_light < 0.01


def test_an_image_shift_is_measured() -> None:
    y, x = np.mgrid[:80, :90].astype(np.float64)
    first, second = (
        100 + 50 * np.exp(-((x - 40 - dx) ** 2 + (y - 35 - dy) ** 2) / 200)
        for dx, dy in ((0.0, 0.0), (0.3, -0.2))
    )
    found = image_shift(first.astype(np.float32), second.astype(np.float32))

    # Second order in the shift over the blob's width of 10 px: 0.3^2 / 10 = 0.01.
    assert found == pytest.approx([0.3, -0.2], abs=0.01)


def test_costs_of_lost_and_wrong_pixels() -> None:
    assert lost_px(1.0, 12.0) == pytest.approx(12 / np.sqrt(12))  # a uniform distribution's sd
    assert wrong_order_px(0.25, 16.0) == pytest.approx(8.0)
