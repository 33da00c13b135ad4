"""Reading a random-dot sensor: known shifts, and the twin's plane and cylinder."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import fourier_shift, gaussian_filter

from fringeworks.experiments.paper.correlate import find_disparity, read_speckle
from fringeworks.geometry.forms import fit_plane
from fringeworks.twin.speckle import SpeckleSensor, facing_plane, see_speckle

SENSOR = SpeckleSensor()


def dots(seed: int) -> NDArray[np.uint8]:
    """Smooth random dots, 120x200."""
    rng = np.random.default_rng(seed)
    image = gaussian_filter(rng.standard_normal((120, 200)), 1.2, mode="wrap")
    grey: NDArray[np.uint8] = np.clip(128 + 60 * image / image.std(), 0, 255).astype(np.uint8)
    return grey


@pytest.mark.parametrize("shift", [-7.0, 0.0, 4.25, 11.5])
def test_a_known_shift(shift: float) -> None:
    """A parabola through three coefficients of dots of 1.2 px errs by less than 0.05 px."""
    image = dots(1)
    moved = np.fft.ifft2(fourier_shift(np.fft.fft2(image.astype(float)), (0, shift))).real
    seen = np.clip(np.round(moved), 0, 255).astype(np.uint8)
    found = find_disparity(seen, image, range(-15, 16))
    inside = found[10:-10, 25:-25]
    assert np.isfinite(inside).mean() > 0.99
    assert np.nanmedian(inside) == pytest.approx(shift, abs=0.05)
    assert np.nanmax(np.abs(inside - shift)) < 0.3


def test_other_dots_are_void() -> None:
    assert np.isfinite(find_disparity(dots(1), dots(2), range(-15, 16))).mean() < 0.01


def test_a_plane_at_650_mm() -> None:
    """One eighth of a pixel is 1.21 mm there; rounding alone has a sigma of 0.35 mm.

    The bound is three eighths' steps for single points, and a rms below half a step.
    """
    rng = np.random.default_rng(0)
    seen, reference = (
        see_speckle(facing_plane(z), SENSOR, z, rng=rng)[0] for z in (650.0, SENSOR.reference_mm)
    )
    cloud = read_speckle(seen, reference, SENSOR)
    inner = cloud.xyz[20:-20, 60:-20]
    z = inner[..., 2]
    assert np.isfinite(z).mean() > 0.99
    step = 650.0**2 / (580.0 * 75.0) / 8
    assert np.nanmedian(cloud.sigma_mm) == pytest.approx(step / np.sqrt(12), rel=0.01)
    points = inner[np.isfinite(z)].astype(np.float64)
    assert step / np.sqrt(12) * 0.8 < fit_plane(points).form_rms_mm < step / 2
    assert np.nanmax(np.abs(z - 650.0)) < 4 * step
    levels = np.unique(np.round((1 / z[np.isfinite(z)] - 1e-3) * 580.0 * 75.0 * 8, 2))
    assert np.abs(levels - np.round(levels)).max() < 0.02  # float32 of the depth
