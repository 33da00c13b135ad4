"""The noise of large images is read in bands, and without the maps it is the same."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.model import Fringe, Sensor
from fringeworks.patterns.presets import equal_shifts
from fringeworks.phase.demodulate import MaskRules, demodulate, estimate_noise, solve_shifts
from fringeworks.phase.noise import BAND_ROWS, ENOUGH_PIXELS, noise_rows


def test_small_images_are_read_whole() -> None:
    assert noise_rows((480, 752)) == slice(None)
    assert noise_rows((ENOUGH_PIXELS // 700, 700)) == slice(None)


@pytest.mark.parametrize("shape", [(1024, 1280), (2048, 2448), (33, 100_000), (20, 1_000_000)])
def test_bands_reach_from_top_to_bottom(shape: tuple[int, int]) -> None:
    """Each row once; half a megapixel, or one band where that is more."""
    rows = noise_rows(shape)
    if isinstance(rows, slice):
        assert shape[0] < BAND_ROWS
        return
    assert (np.diff(rows) > 0).all()
    assert rows[0] == 0
    assert rows[-1] < shape[0]
    assert rows[-1] == shape[0] - 1 or len(rows) == BAND_ROWS
    assert len(rows) * shape[1] <= max(ENOUGH_PIXELS, BAND_ROWS * shape[1])


@pytest.mark.parametrize("steps", [3, 6])
@pytest.mark.parametrize("height", [300, 900])
def test_noise_of_bands(steps: int, height: int) -> None:
    """Noise of 2 and rounding, 1 / 12, to 2 %: the median of 5e5 differences errs by 0.3 %."""
    rng = np.random.default_rng(7)
    phase = np.broadcast_to(np.linspace(0, 200, 1000), (height, 1000))
    grey = [120 + 60 * np.cos(phase - shift) for shift in equal_shifts(steps)]
    frames = np.rint(rng.normal(grey, 2)).astype(np.uint8)
    fringe, sensor = Fringe("x", 20.0, equal_shifts(steps)), Sensor(255.0)
    noise = demodulate(frames, fringe, sensor).noise
    assert noise.read == pytest.approx(np.sqrt(4 + 1 / 12), rel=0.02)
    solution = solve_shifts(np.array(fringe.shifts_rad))
    assert estimate_noise(frames, solution, sensor, MaskRules()) == noise
