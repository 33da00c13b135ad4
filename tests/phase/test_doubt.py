"""Bits of a Gray code that cannot be told from the noise, and what becomes of their pixels."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from fringeworks.model import (
    Capture,
    Fringe,
    GrayCode,
    Noise,
    Pattern,
    PatternSet,
    Sensor,
    Sequence,
    Uniform,
)
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.gray import Contrast, GrayReading, decode_gray

# Three bits of 4 px cells on 32 px. Pixels lie in cell 2, whose Gray code is 011.
CODE = GrayCode("x", 3, 4.0)
CENTRE = 2.5 * 4 - 0.5
NOISE = Noise(2.0, 0.0, 0.0, "camera")  # a bit within 4 grey levels of its threshold is doubtful
LEVEL = 100


def read(*grey: int, inverted: bool = False) -> list[float]:
    """Coordinate and sigma of a pixel whose bits have these grey levels."""
    bits = np.array(grey, np.uint8).reshape(3, 1, 1)
    code = GrayCode("x", 3, 4.0, inverted=inverted)
    frames = np.concatenate([bits, 2 * LEVEL - bits]) if inverted else bits
    level = np.full((1, 1), LEVEL, np.float32)
    contrast = Contrast(level, level)
    coordinate, at_edge = decode_gray(code, frames, extent=32, contrast=contrast, noise=NOISE)
    reading = GrayReading(code, coordinate, at_edge, contrast, NOISE)
    return [float(reading.coordinate[0, 0]), float(reading.sigma[0, 0])]


def test_a_code_without_doubt_lies_anywhere_in_its_cell() -> None:
    assert read(60, 140, 105) == pytest.approx([CENTRE, 4 / 12**0.5])


def test_one_doubtful_bit_sees_an_edge_and_is_half_a_cell_off() -> None:
    assert read(60, 140, 104) == pytest.approx([CENTRE, 2.0])


def test_two_doubtful_bits_are_void() -> None:
    assert np.isnan(read(60, 104, 104)).all()
    assert np.isnan(read(96, 140, 104)).all()


def test_a_bit_and_its_inverse_have_the_noise_of_two_frames() -> None:
    """Their difference is twice the distance from the level, its doubt sqrt(2) * 4 = 5.66."""
    assert read(60, 140, 103, inverted=True)[1] == pytest.approx(4 / 12**0.5)  # 6 apart
    assert read(60, 140, 102, inverted=True)[1] == pytest.approx(2.0)  # 4 apart


def test_no_order_is_decided_by_noise_at_the_edges_of_cells_as_wide_as_the_fringes() -> None:
    """A plain code of 32 px cells under 32 px fringes has no margin at its cells' edges."""
    rng = np.random.default_rng(5)
    u = np.tile(np.linspace(-0.4, 127.4, 4000), (50, 1))
    fringe = Fringe("x", 32.0, (2.0943951, 0.0, -2.0943951))
    phase = 2 * np.pi * (u + 0.5) / 32
    shifts = np.array(fringe.shifts_rad)[:, None, None]
    cell = np.floor((u + 0.5) / 32).astype(int)
    index = cell ^ (cell >> 1)
    lit = np.stack([(index >> 1) & 1, index & 1]).astype(float)
    lit = gaussian_filter1d(lit, 20, axis=-1, mode="nearest")  # blurred over 0.6 projector px
    signals = [120 + 60 * np.cos(phase - shifts), 60 + 120 * lit]
    frames = [np.rint(s + rng.normal(0, 1.5, s.shape)).astype(np.uint8) for s in signals]
    flat = [np.full((1, *u.shape), grey, np.uint8) for grey in (180, 60)]
    patterns: tuple[Pattern, ...] = (fringe, GrayCode("x", 2, 32.0), Uniform(1.0), Uniform(0.0))
    capture = Capture(
        Sequence(128, 8, tuple(map(PatternSet, patterns))), (*frames, *flat), Sensor(255.0)
    )
    (axis,) = decode_phases(capture).coded
    valid = np.isfinite(axis.coordinate)
    assert valid.mean() > 0.95
    assert np.abs(axis.coordinate - u)[valid].max() < 1.0
    assert not valid[:, np.abs(u[0] - 31.5) < 0.02].all()  # the edge itself is in doubt
