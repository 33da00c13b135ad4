"""The camera's electronics against the photon-transfer line and integrals by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from fringeworks.twin.effects import AmbientEffects, CameraEffects
from fringeworks.twin.expose import Chip, ambient_exposure, make_chip

PLAIN = CameraEffects(
    bits=12, full_well_e=10_000.0, read_noise_e=30.0, black_level=40.0, prnu=0.0, dsnu=0.0
)
QUIET = replace(PLAIN, read_noise_e=0.0, shot_noise=False)
WIDTH, HEIGHT = 800, 600


def chip(effects: CameraEffects) -> Chip:
    return make_chip(effects, width=WIDTH, height=HEIGHT)


def even(light: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    return np.full((HEIGHT, WIDTH), light, np.float32)


def test_noise_follows_the_line_of_photon_transfer() -> None:
    # 4095 / 10000 grey levels per electron: variance 0.4095 signal + (30 x 0.4095)^2 + 1 / 12.
    rng = np.random.default_rng(1)
    camera = chip(PLAIN)
    assert camera.sensor.gain == pytest.approx(0.4095)
    assert camera.sensor.read_noise == pytest.approx(12.285)
    assert (camera.sensor.full_scale, camera.sensor.black_level) == (4095, 40)
    for light in (0.02, 0.1, 0.5, 0.9):
        frame = camera.read(even(light), rng).astype(np.float64)
        # 480000 pixels: sd / 693 for the mean, sqrt(2) / 693 = 0.2 % for the variance, 5 sigma.
        variance = 0.4095 * 4095 * light + 12.285**2 + 1 / 12
        assert frame.mean() == pytest.approx(40 + 4095 * light, abs=5 * variance**0.5 / 693)
        assert frame.var() == pytest.approx(variance, rel=0.011)


def test_shot_noise_can_be_off() -> None:
    camera = chip(replace(PLAIN, shot_noise=False))
    assert camera.sensor.gain == 0
    frame = camera.read(even(0.5), np.random.default_rng(2)).astype(np.float64)
    assert frame.var() == pytest.approx(12.285**2 + 1 / 12, rel=0.011)


def test_without_noise_nothing_is_drawn() -> None:
    rng = np.random.default_rng(3)
    frame = chip(QUIET).read(even(0.25), rng)
    assert (frame == round(40 + 4095 * 0.25)).all()
    assert rng.random() == np.random.default_rng(3).random()


def test_rounding_and_clipping() -> None:
    camera = make_chip(replace(QUIET, bits=8, black_level=2.0), width=4, height=1)
    light = np.array([[-0.1, 100.4 / 255, 100.6 / 255, 3.0]], np.float32)
    frame = camera.read(light, np.random.default_rng(0))
    assert frame.tolist() == [[0, 102, 103, 255]]
    assert frame.dtype == np.uint8


def test_twelve_bits_need_two_bytes() -> None:
    assert chip(QUIET).read(even(0.5), np.random.default_rng(0)).dtype == np.uint16


def test_pixels_differ_and_stay_the_same() -> None:
    uneven = replace(QUIET, bits=16, black_level=2000.0, prnu=0.01, dsnu=0.002, pixel_seed=4)
    camera = chip(uneven)
    dark, lit = (camera.read(even(v), np.random.default_rng(0)) for v in (0.0, 0.5))
    # 0.2 % of 65535 in the dark; its spread is known to 1 / sqrt(2 x 480000) = 0.1 %.
    assert dark.std() == pytest.approx(0.002 * 65535, rel=0.006)
    gain = (lit.astype(np.float64) - dark) / (0.5 * 65535)
    assert gain.std() == pytest.approx(0.01, rel=0.006)
    again = chip(uneven).read(even(0.5), np.random.default_rng(9))
    np.testing.assert_array_equal(again, lit)
    other = chip(replace(uneven, pixel_seed=5)).read(even(0.5), np.random.default_rng(0))
    assert (other != lit).any()


@pytest.mark.parametrize("exposure_ms", [0.5, 3.0, 8.0, 25.0])
@pytest.mark.parametrize("time_s", [0.0, 0.0123])
def test_ripple_is_averaged_over_the_exposure(exposure_ms: float, time_s: float) -> None:
    effects = AmbientEffects(light_per_ms=0.01, ripple=0.2, mains_hz=60.0)
    end = time_s + exposure_ms / 1000
    total, _ = quad(lambda t: 1 + 0.2 * np.cos(2 * np.pi * 120 * t), time_s, end)
    found = ambient_exposure(effects, time_s=time_s, exposure_ms=exposure_ms)
    assert found == pytest.approx(0.01 * 1000 * total, rel=1e-9)


def test_whole_periods_do_not_ripple() -> None:
    effects = AmbientEffects(light_per_ms=0.01, ripple=0.5, mains_hz=50.0)
    found = [ambient_exposure(effects, time_s=t, exposure_ms=20.0) for t in (0.0, 0.001, 0.004)]
    np.testing.assert_allclose(found, 0.2, rtol=1e-12)


def test_no_mains() -> None:
    effects = AmbientEffects(light_per_ms=0.01, ripple=0.5, mains_hz=0.0)
    assert ambient_exposure(effects, time_s=0.003, exposure_ms=5.0) == pytest.approx(0.05)
