"""Bits of a Gray code that cannot be told from the noise, and what becomes of their pixels."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.model import GrayCode, Noise
from fringeworks.phase.gray import Contrast, decode_gray

# Three bits of 4 px cells on 32 px. Pixels lie in cell 2, whose Gray code is 011.
CODE = GrayCode("x", 3, 4.0)
CENTRE = 2.5 * 4 - 0.5
NOISE = Noise(2.0, 0.0, 0.0, "camera")  # a bit within 4 grey levels of its threshold is doubtful
LEVEL = 100


def read(*grey: int, inverted: bool = False) -> tuple[float, float]:
    """Coordinate and sigma of a pixel whose bits have these grey levels."""
    bits = np.array(grey, np.uint8).reshape(3, 1, 1)
    code = GrayCode("x", 3, 4.0, inverted=inverted)
    frames = np.concatenate([bits, 2 * LEVEL - bits]) if inverted else bits
    level = np.full((1, 1), LEVEL, np.float32)
    coordinate, sigma = decode_gray(
        code, frames, extent=32, contrast=Contrast(level, level), noise=NOISE
    )
    return float(coordinate[0, 0]), float(sigma[0, 0])


def test_a_code_without_doubt_lies_anywhere_in_its_cell() -> None:
    assert read(60, 140, 105) == (CENTRE, pytest.approx(4 / 12**0.5))


def test_one_doubtful_bit_sees_an_edge_and_is_half_a_cell_off() -> None:
    assert read(60, 140, 104) == (CENTRE, pytest.approx(2.0))


def test_two_doubtful_bits_are_void() -> None:
    assert np.isnan(read(60, 104, 104)).all()
    assert np.isnan(read(96, 140, 104)).all()


def test_a_bit_and_its_inverse_have_the_noise_of_two_frames() -> None:
    """Their difference is twice the distance from the level, its doubt sqrt(2) * 4 = 5.66."""
    assert read(60, 140, 103, inverted=True)[1] == pytest.approx(4 / 12**0.5)  # 6 apart
    assert read(60, 140, 102, inverted=True)[1] == pytest.approx(2.0)  # 4 apart
