"""What is left of each codeword, against a projector's line drawn and blurred numerically."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.model import Codeword
from fringeworks.phase.transfer import draw_templates
from tests.phase.codes import show


@pytest.mark.parametrize("blur", [0.5, 0.8, 1.25])
@pytest.mark.parametrize("period", [2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 11.0, 5.25])
def test_against_a_drawn_line(period: float, blur: float) -> None:
    bins = 64
    (template,) = draw_templates(Codeword("x", 32.0, (period,)), (blur,), bins)[:, 0]
    pixels, u = np.arange(96), (np.arange(96 * 32) + 0.5) / 32
    code = show(np.cos(2 * np.pi * (pixels - 32) / period), u, blur)
    fringe = show(np.cos(2 * np.pi * pixels / 32), u, blur)
    modulation = np.ptp(fringe[32 * 32 : 64 * 32]) / 2
    # xi = u + 1/2 - 32: bin b holds the mean of xi from b / 2 to (b + 1) / 2.
    fine = (u + 0.5 - 32) * 2
    held = [code[(fine >= b) & (fine < b + 1)].mean() for b in range(bins)]
    # Copies that are left out have 3/2 cycles per px at least: exp(-2 pi^2 (1/2)^2 (3/2)^2) = 2e-5.
    # The drawing has 16 samples per px and is read between them: (2 pi / 32)^2 / 8 of the amplitude
    # at p = 2, 0.005.
    np.testing.assert_allclose(template, np.array(held) / modulation, atol=2e-3)
