"""Noise: observed against predicted and against the Cramer-Rao bound, and what it does to orders.

With noise of one variance in all frames the bound is ``sqrt(2 / N) sigma_I / B`` (the methods
page), and least squares reaches it. The bar is 3 %; the sampling error of a standard deviation
over n pixels is ``1 / sqrt(2 n)``, below 0.15 % everywhere here.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.model import Fringe, Sensor, WrappedPhase
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.demodulate import demodulate
from tests.phase.encoding import Scene, equal_shifts

Array = NDArray[np.float64]

BAR = 0.03
STEPS = [3, 4, 5, 8, 12]

READ, GAIN = 0.8, 0.02
KNOWN = Sensor(255.0, gain=GAIN, read_noise=READ)
UNKNOWN = Sensor(255.0)

# A plane askew to the camera: 0.6 and 0.2 projector px per camera px along rows and columns.
V, U = np.mgrid[:500, :900].astype(float)
PLANE = Scene(0.6 * U + 0.2 * V, 700, offset=120.0, modulation=80.0, read=READ, gain=GAIN)


def phase_error(scene: Scene, wrapped: WrappedPhase) -> Array:
    fringe = wrapped.fringe
    truth = 2 * np.pi * (scene.u - fringe.zero_px) / fringe.period_px
    return np.asarray((wrapped.phase - truth + np.pi) % (2 * np.pi) - np.pi)


def rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.nanmean(np.square(values, dtype=np.float64))))


def grey_sigma(scene: Scene) -> float:
    """Standard deviation of a frame's grey level at the fringes' mean, with its rounding."""
    return float(np.sqrt(scene.read**2 + scene.gain * np.mean(scene.offset) + 1 / 12))


def demodulated(scene: Scene, count: int, *, period: float = 21.0) -> WrappedPhase:
    fringe = Fringe("x", period, equal_shifts(count))
    return demodulate(scene.frames(fringe, np.random.default_rng(count)), fringe, scene.sensor)


@pytest.mark.parametrize("count", STEPS)
def test_noise_known(count: int) -> None:
    scene = dataclasses.replace(PLANE, sensor=KNOWN)
    wrapped = demodulated(scene, count)
    bound = np.sqrt(2 / count) * grey_sigma(scene) / 80.0
    observed, predicted = rms(phase_error(scene, wrapped)), rms(wrapped.sigma)
    assert wrapped.noise.source == "camera"
    assert observed == pytest.approx(bound, rel=BAR)
    assert predicted == pytest.approx(observed, rel=BAR)


@pytest.mark.parametrize("count", STEPS)
def test_noise_estimated(count: int) -> None:
    scene = dataclasses.replace(PLANE, sensor=UNKNOWN)
    wrapped = demodulated(scene, count)
    assert wrapped.noise.source == ("residual" if count > 3 else "high-pass")
    assert rms(wrapped.sigma) == pytest.approx(rms(phase_error(scene, wrapped)), rel=BAR)
    assert wrapped.noise.read == pytest.approx(grey_sigma(scene), rel=BAR)


@pytest.mark.parametrize("count", [4, 8])
def test_read_noise_alone_reaches_the_bound(count: int) -> None:
    # No shot noise, so that all frames have one variance and the bound holds without condition.
    scene = dataclasses.replace(
        PLANE, read=3.0, gain=0.0, sensor=Sensor(255.0, gain=0.0, read_noise=3.0)
    )
    wrapped = demodulated(scene, count)
    bound = np.sqrt(2 / count) * np.sqrt(9 + 1 / 12) / 80.0
    # 5 sigma of the sampling: 5 / sqrt(2 * 450000)
    assert rms(phase_error(scene, wrapped)) == pytest.approx(bound, rel=0.006)
    assert rms(wrapped.sigma) == pytest.approx(bound, rel=0.006)


@pytest.mark.parametrize("count", STEPS)
def test_shot_noise_and_the_exact_bound(count: int) -> None:
    """The exact bound weighs each frame by its own variance v_n: 1 / sum (dI_n / dPhi)^2 / v_n.

    Plain least squares stays above it by what shot noise differs between frames, which for these
    figures is at most 4 % (the mean over phase of the two closed forms), and never falls below.
    """
    scene = dataclasses.replace(PLANE, sensor=KNOWN)
    phases = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    x = phases[:, np.newaxis] - np.array(equal_shifts(count))
    design = np.stack([np.ones_like(x), 80 * np.sin(x), np.cos(x)], axis=-1)  # by A, Phi, B
    variance = READ**2 + 1 / 12 + GAIN * (120 + 80 * np.cos(x))
    information = np.einsum("pni,pnj,pn->pij", design, design, 1 / variance)
    exact = float(np.sqrt(np.mean(np.linalg.inv(information)[:, 1, 1])))
    observed = rms(phase_error(scene, demodulated(scene, count)))
    assert 0.994 < observed / exact < 1.04


TEXTURES = {
    "checks": 0.5 + 0.5 * ((U // 8 + V // 8) % 2),
    "gradient": 0.4 + 0.6 * U / 900,
    "grain": np.random.default_rng(5).uniform(0.7, 1.0, U.shape),
}


@pytest.mark.parametrize(
    ("texture", "least", "most"),
    [
        # Squares of 8 px: one in 16 masks of 3 x 3 px holds a corner, the median hardly moves;
        # shot noise differs between the squares by a third, one sigma for both by half that.
        ("checks", 0.85, 1.15),
        ("gradient", 0.9, 1.1),
        # Grain of pixel size is not told from noise: sigma comes out too large, never too small.
        ("grain", 1.0, np.inf),
    ],
)
def test_high_pass_noise_of_a_textured_scene(texture: str, least: float, most: float) -> None:
    albedo = TEXTURES[texture]
    scene = dataclasses.replace(PLANE, offset=120 * albedo, modulation=80 * albedo, sensor=UNKNOWN)
    wrapped = demodulated(scene, 3)
    assert wrapped.noise.source == "high-pass"
    ratio = rms(phase_error(scene, wrapped) / wrapped.sigma)
    assert least < 1 / ratio < most


def test_residual_noise_is_robust() -> None:
    # A twentieth of the scene moves between the frames. Its squares count as if they were at the
    # nine-tenths point of chi squared, 2.71 variances, so the variance becomes 0.95 a / (a - 0.05 *
    # 2.71) times itself with a = 0.83, the mean of the drawn-in squares: a sigma 6 % larger. The
    # plain root mean square would be 20 times too large.
    scene = dataclasses.replace(PLANE, sensor=UNKNOWN)
    fringe = Fringe("x", 21.0, equal_shifts(4))
    frames = scene.frames(fringe, np.random.default_rng(4))
    frames[2, :25] = scene.frames(fringe, np.random.default_rng(5))[0, :25]
    ratio = demodulate(frames, fringe, UNKNOWN).noise.read / grey_sigma(scene)
    assert 1.0 < ratio < 1.1


def test_noise_is_never_below_rounding() -> None:
    # Frames without noise, at whole grey levels: 1 / sqrt 12 is left.
    scene = Scene(np.zeros((40, 40)), 64, offset=100.0, modulation=50.0, sensor=UNKNOWN)
    for count in (3, 4):
        noise = demodulated(scene, count).noise
        assert noise.read >= 0.288675


def test_no_order_errors_at_seventeen() -> None:
    """B / sigma = 17 on 1, 8 and 64 fringes, N = 4: a million pixels on all projector columns.

    The finest step has P / 2 = 8 px against a sigma of 16 * 8 / 2 pi * sqrt(2 / 4) / 17 = 0.85 px
    of the step before, so that errors should be as rare as 9 sigma. A residual of N = 4 has one
    degree of freedom and is void beyond 5 sigma: 5.7e-7 of the pixels of each set.
    """
    width = 1024
    sensor = Sensor(255.0, gain=0.0, read_noise=5.0)
    columns = np.arange(width)[np.newaxis] + (np.arange(1100)[:, np.newaxis] + 0.5) / 1100 - 0.5
    sigma_grey = np.sqrt(25 + 1 / 12)
    scene = Scene(columns, width, offset=125.0, modulation=17 * sigma_grey, sensor=sensor, read=5.0)
    shifts = equal_shifts(4)
    periods = (1.05 * width, width / 8, width / 64)
    capture = scene.capture(
        *(Fringe("x", period, shifts) for period in periods), rng=np.random.default_rng(17)
    )
    column = decode_capture(capture).column
    assert column is not None
    assert column.phase is not None
    found = np.isfinite(column.coordinate)
    assert set(np.rint(columns[found]).astype(int)) == set(range(width))
    error = (column.coordinate - columns)[found]
    assert error.size > 1e6
    assert np.abs(error).max() < width / 64 / 2  # no order is wrong
    expected = 3 * 5.7e-7 * columns.size  # Poisson: its mean and five times its root
    # Columns at the very edge may fall outside by more than 5 sigma: 2.9e-7 of the outermost.
    assert np.count_nonzero(~found) <= expected + 5 * np.sqrt(expected)
    sigma = width / 64 / (2 * np.pi) * np.sqrt(2 / 4) / 17
    assert rms(error) == pytest.approx(sigma, rel=BAR)
    assert column.phase.order.max() == 64
    assert column.phase.order[found].min() == 0
