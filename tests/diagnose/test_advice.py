"""The capture assistant on the twin: what it proposes is best, what it complains of is there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fringeworks.diagnose.advice import Advice, advise
from fringeworks.diagnose.advice_blur import (
    best_even_period,
    measure_blurs,
    noise_over_least,
    transfer_of,
)
from fringeworks.diagnose.advice_steps import choose_steps, find_gamma, harmonic, ripple_px
from fringeworks.diagnose.look import look_at
from fringeworks.errors import DecodeError
from fringeworks.model import Capture, Fringe, PatternSet, Sequence, Uniform
from fringeworks.patterns import equal_shifts
from fringeworks.phase.demodulate import demodulate
from fringeworks.twin.effects import AmbientEffects, Effects
from fringeworks.twin.scene import Material, Object, Scene, Sphere
from fringeworks.twin.scenes import named_scene, place
from fringeworks.twin.stage import Stage
from tests.calibrate.faults import HEIGHT, WIDTH, half_rig
from tests.diagnose.probed import (
    CAMERA,
    PROJECTOR,
    STILL,
    keystoned,
    probe,
    scaled,
    sharpened,
    strips,
)


def with_projector(**changes: object) -> Effects:
    return replace(STILL, projector=replace(PROJECTOR, **changes))  # type: ignore[arg-type]


def fringes(periods: tuple[float, ...], *, exposure_ms: float | None = None) -> Sequence:
    sets = tuple(
        PatternSet(Fringe("x", period, equal_shifts(4)), exposure_ms=exposure_ms)
        for period in periods
    )
    return Sequence(WIDTH, HEIGHT, sets)


class TestPeriod:
    @pytest.mark.parametrize(("projector_px", "camera_px"), [(0.5, 0.4), (1.6, 0.8)])
    def test_is_two_pi_blurs_and_has_the_least_noise(
        self, projector_px: float, camera_px: float
    ) -> None:
        """Against the point spreads put in, and against every other period on the twin.

        The spreads add in quadrature: the projector's, its pixel's box of variance 1/12, and the
        camera's and its box by the columns that a camera pixel sees. The issue's bars: 5 % of the
        period, 2 % of the noise.
        """
        effects = replace(
            STILL,
            projector=replace(PROJECTOR, blur_px=projector_px, defocus_px_m=0.0),
            camera=replace(CAMERA, blur_px=camera_px),
            samples=4,
        )
        capture = probe(effects)
        found = measure_blurs(capture, look_at(capture))["x"]
        column = Stage(named_scene("wall"), half_rig(), effects).truth().column
        per_px = float(np.nanmedian(np.abs(np.gradient(column, axis=1))))
        true_px = math.sqrt(projector_px**2 + 1 / 12 + per_px**2 * (camera_px**2 + 1 / 12))
        assert found.best_period_px == pytest.approx(2 * math.pi * true_px, rel=0.05)

        tried = found.best_period_px * np.array([0.7, 0.8, 0.9, 0.95, 1, 1.05, 1.1, 1.25])
        looks = look_at(probe(effects, sequence=fringes((64.0, *tried))))
        seen = np.array([np.median(look.modulation[looks[0].lit]) for look in looks[1:]])
        noise = tried / seen
        assert noise[4] <= 1.02 * noise.min()

    def test_formulas(self) -> None:
        """The derivative of log(p / B(p)) is zero at 2 pi s, where B is exp(-1/2) of B0."""
        sigma = 0.8
        best = 2 * math.pi * sigma
        assert transfer_of(sigma, best) == pytest.approx(math.exp(-0.5))
        noise = [
            period / transfer_of(sigma, period) for period in (best * 0.999, best, best * 1.001)
        ]
        assert noise[1] < min(noise[0], noise[2])
        for period in (3.0, 8.0):
            direct = period / transfer_of(sigma, period) / noise[1]
            assert noise_over_least(period, sigma) == pytest.approx(direct)
        assert [best_even_period(s) for s in (0.3, 0.8, 1.0)] == [4.0, 6.0, 8.0]

    def test_one_set_against_white_and_black(self) -> None:
        """Fringes of 8 px and flat frames tell the blur of a straight response."""
        sets = (*fringes((8.0,)).sets, PatternSet(Uniform(1.0)), PatternSet(Uniform(0.0)))
        effects = with_projector(blur_px=1.0, defocus_px_m=0.0)
        capture = probe(effects, sequence=Sequence(WIDTH, HEIGHT, sets))
        both = probe(effects)
        alone = measure_blurs(capture, look_at(capture))["x"].sigma_px
        assert alone == pytest.approx(measure_blurs(both, look_at(both))["x"].sigma_px, rel=0.05)


class TestExposures:
    albedos = tuple(np.geomspace(0.03, 0.95, 8))

    def test_the_ladder_covers_a_scene_of_dark_and_bright_parts(self) -> None:
        """Fringes taken as proposed decode at one rung at least on 98 % of the lit pixels."""
        scene = strips(self.albedos)
        found = advise(probe(scene=scene), exposure_ms=10.0)
        assert 2 <= len(found.ladder.exposures_ms) <= 4
        assert found.ladder.covered_before < 0.8
        assert found.ladder.coverage >= 0.98

        truth = Stage(scene, half_rig(), STILL).truth()
        lit = np.isfinite(truth.column)
        seen = np.zeros_like(lit)
        for exposure_ms in found.ladder.exposures_ms:
            sequence = fringes((found.period_px,), exposure_ms=exposure_ms)
            capture = probe(scene=scene, sequence=sequence, seed=1)
            fringe, frames, _ = capture.find(Fringe)[0]
            whole = frames.max(axis=0) < capture.sensor.saturation
            seen |= np.isfinite(demodulate(frames, fringe, capture.sensor).phase) & whole
        assert np.mean(seen[lit]) >= 0.98

    def test_an_even_scene_takes_one(self) -> None:
        found = advise(probe(), exposure_ms=10.0)
        (exposure_ms,) = found.ladder.exposures_ms
        assert found.ladder.coverage > 0.99
        assert 10 < exposure_ms < 20

    def test_without_the_tests_exposure_factors_are_told(self) -> None:
        found = advise(probe())
        assert found.ladder.exposures_ms == ()
        assert found.ladder.factors[0] == pytest.approx(1.59, abs=0.01)  # 2^(2/3)

    @pytest.mark.parametrize(
        ("light", "hz", "multiple_ms"), [(0.05, 50, 10.0), (0.05, 60, 25 / 3), (0.6, 50, None)]
    )
    def test_flicker_takes_half_periods_of_the_mains_unless_too_bright(
        self, light: float, hz: float, multiple_ms: float | None
    ) -> None:
        effects = Effects(
            camera=replace(CAMERA, exposure_ms=3.0 if light < 0.5 else 1.0),
            projector=replace(PROJECTOR, light_per_ms=light),
            ambient=AmbientEffects(light_per_ms=0.2 * light, ripple=0.6, mains_hz=hz),
            frame_interval_ms=37.3,
        )
        found = advise(probe(effects), exposure_ms=effects.camera.exposure_ms, mains_hz=hz)
        assert "flicker" in names(found)
        assert found.ladder.coverage > 0.98
        assert found.ladder.in_step is (multiple_ms is not None)
        if multiple_ms is not None:
            turns = np.array(found.ladder.exposures_ms) / multiple_ms
            assert turns == pytest.approx(np.rint(turns), abs=0.005)  # three digits


class TestSteps:
    @pytest.mark.parametrize("gamma", [0.6, 1.0, 1.8, 2.2])
    def test_harmonics_are_those_of_the_curve(self, gamma: float) -> None:
        phase = 2 * np.pi * np.arange(1 << 14) / (1 << 14)
        series = np.fft.rfft((0.5 + 0.5 * np.cos(phase)) ** gamma).real
        for order in (2, 3, 4, 5):
            # the curve's root at black lets the sum's error fall as M^(-1-2 gamma): below 1e-8
            assert harmonic(order, gamma) == pytest.approx(series[order] / series[1], abs=1e-7)

    @pytest.mark.parametrize("steps", [3, 4])
    def test_ripple_is_that_of_the_fringes(self, steps: int) -> None:
        """Gamma 1.2, to first order; the sum of both harmonics bounds what their signs leave."""
        phase = np.linspace(-np.pi, np.pi, 4001)
        shifts = np.array(equal_shifts(steps))[:, None]
        light = (0.5 + 0.5 * np.cos(phase - shifts)) ** 1.2
        wrong = np.angle((light * np.exp(1j * shifts)).sum(axis=0) * np.exp(-1j * phase))
        told = ripple_px(steps, 1.2, 16.0, 0.0) * 2 * np.pi / 16
        assert 0.5 * told < np.std(wrong) < 1.05 * told

    @pytest.mark.parametrize("gamma", [1.0, 2.2])
    def test_gamma_is_seen(self, gamma: float) -> None:
        capture = probe(with_projector(gamma=gamma))
        assert find_gamma(look_at(capture)) == pytest.approx(gamma, rel=0.01)

    def test_the_wanted_sigma_and_gamma_decide(self) -> None:
        def steps(noise_px: float, gamma: float, wanted_px: float) -> int:
            return choose_steps(
                noise_px=noise_px, gamma=gamma, period_px=16.0, sigma_px=0.5, wanted_px=wanted_px
            ).steps

        assert steps(0.01, 1.0, 0.02) == 4
        assert steps(0.1, 1.0, 0.02) == 32  # (0.1 / 0.02)^2 = 25, and 24 is too few
        assert steps(0.01, 2.2, 0.02) == 4
        assert steps(0.004, 2.2, 0.003) == 5  # four let through 0.006 px of the third harmonic


def names(found: Advice) -> set[str]:
    return {item.name for item in found.complaints}


CLEAN = ("wall", "two", "cylinder")


class TestComplaints:
    @pytest.mark.parametrize("scene", CLEAN)
    def test_a_clean_capture_has_none(self, scene: str) -> None:
        assert names(advise(probe(scene=named_scene(scene)), exposure_ms=10.0)) == set()

    def test_paper_rig_with_usual_devices_has_none(self) -> None:
        assert names(advise(probe(Effects()))) == set()

    def test_dark_and_bright_parts_are_no_complaint(self) -> None:
        assert names(advise(probe(scene=strips(TestExposures.albedos)))) == set()

    @pytest.mark.parametrize(
        ("effects", "name"),
        [
            (
                replace(
                    STILL,
                    projector=replace(PROJECTOR, light_per_ms=0.055),
                    ambient=AmbientEffects(light_per_ms=0.045),
                ),
                "ambient light",
            ),
            (with_projector(light_per_ms=0.012), "too dark"),
            (with_projector(light_per_ms=0.32), "saturation"),
            (with_projector(flicker=0.04), "flicker"),
            (with_projector(blur_px=2.4), "blur"),
            (replace(STILL, camera=replace(CAMERA, blur_px=5.0)), "blur"),
        ],
    )
    def test_light_and_focus(self, effects: Effects, name: str) -> None:
        assert name in names(advise(probe(effects), exposure_ms=10.0))

    def test_gloss(self) -> None:
        ball = Object(
            "ball",
            Sphere(60.0),
            place((0, 0, 700), (0, 0, 0)),
            Material(0.2, gloss=0.5, gloss_exponent=200.0),
        )
        assert "gloss" in names(advise(probe(scene=Scene("ball", (ball,))), exposure_ms=10.0))

    @pytest.mark.parametrize("scene", ["wall", "cylinder"])
    def test_sharpening(self, scene: str) -> None:
        capture = probe(scene=named_scene(scene), warp=sharpened(0.6))
        assert names(advise(capture)) == {"sharpening"}

    @pytest.mark.parametrize("warp", [keystoned(0.1), scaled(0.98)])
    def test_scaling(self, warp: object) -> None:
        assert names(advise(probe(warp=warp))) == {"keystone"}  # type: ignore[arg-type]


def test_of_several_exposures_the_best_is_read() -> None:
    sets = tuple(
        replace(item, exposure_ms=exposure_ms)
        for exposure_ms in (1.0, 10.0, 60.0)
        for item in fringes((64.0, 16.0, 4.0)).sets
    )
    found = advise(probe(sequence=Sequence(WIDTH, HEIGHT, sets)))
    assert found.ladder.covered_before > 0.98
    assert 10 < found.ladder.exposures_ms[0] < 20


def test_what_has_no_fringes_is_refused() -> None:
    sequence = Sequence(8, 8, (PatternSet(Uniform(1.0)),))
    frames = np.zeros((1, 20, 20), np.uint8)
    sensor = probe(sequence=fringes((16.0,))).sensor
    with pytest.raises(DecodeError, match=r"no fringes to advise from.*patterns test"):
        advise(Capture(sequence, (frames,), sensor))
