"""Closed forms of light, noise and ripple, by hand and against the twin's images."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fringeworks.model import Fringe
from fringeworks.patterns import make_sequence
from fringeworks.patterns.presets import equal_shifts
from fringeworks.phase.decode import decode_phases
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Material, Object, Plane, Scene
from fringeworks.twin.scenes import paper_rig, place
from fringeworks.twin.simulate import simulate
from fringeworks.uncertainty.phase_noise import (
    ALBEDO,
    FULLEST,
    FringesSeen,
    pattern_errors,
    phase_variances,
    see_fringes,
    shorten_exposure,
)
from fringeworks.uncertainty.seen import wall_at

DEPTH_MM = 680.0


def fringes(steps: int, period: float = 16.0) -> Fringe:
    return Fringe("x", period, equal_shifts(steps))


def seen_by_hand(steps: int, *, blur: float = 0.0) -> FringesSeen:
    one = np.ones(4)
    return FringesSeen(fringes(steps), 100 * one, 60 * one, 10 * one, one, blur * one)


def test_light_and_fringes_are_those_of_the_twins_images() -> None:
    """Medians over a wall, noise-free: lattice, point spread and pixel integration to 1 %."""
    rig, effects = paper_rig(), Effects().without_noise()
    sequence = make_sequence("measure", width=608, height=684, axes=("x",))
    wall = Scene("wall", (Object("w", Plane(), place((0.0, 0.0, DEPTH_MM)), Material(ALBEDO)),))
    capture = simulate(wall, rig, sequence, effects=effects, rng=np.random.default_rng(0)).capture
    (axis,) = decode_phases(capture).coded
    points, _ = wall_at(rig, DEPTH_MM)
    found = see_fringes(rig, points, fringes(8), effects)
    places = tuple(np.rint(points.camera_px).astype(int).T[::-1])
    for image, closed in ((axis.offset, found.offset), (axis.modulation, found.modulation)):
        ratio = closed / image[places]
        assert np.median(ratio) == pytest.approx(1, abs=0.01)
        assert np.abs(ratio - 1).max() < 0.05


@pytest.mark.parametrize("steps", [3, 8])
def test_variances_by_hand(steps: int) -> None:
    """2 / (N B^2) of: 12000 electrons in 255 levels, 20 of read noise, a rounding of 1 / 12."""
    per_grey = 2 / (steps * 60.0**2)
    found = phase_variances(seen_by_hand(steps), Effects())
    per_electron = 255 / 12000
    flicker = 0.003**2 * (90.0**2 + 60.0**2 / 4)
    expected = [per_electron * 100, (20 * per_electron) ** 2, 1 / 12, flicker]
    for values, grey in zip(found.values(), expected, strict=True):
        np.testing.assert_allclose(values, grey * per_grey)


def test_variances_are_what_draws_scatter_by() -> None:
    """Grey levels with all four sources drawn, at phases all around; 5 sigma of 200 000 phases."""
    rng, count, steps = np.random.default_rng(5), 200_000, 5
    phase = rng.uniform(-np.pi, np.pi, count)
    shifts = np.array(equal_shifts(steps))[:, None]
    wave = 60 * np.cos(phase - shifts)
    lamp = 1 + 0.003 * rng.normal(size=wave.shape)
    grey = 10 + (90 + wave) * lamp
    variance = 255 / 12000 * (100 + wave) + (20 * 255 / 12000) ** 2 + 1 / 12
    grey = grey + np.sqrt(variance) * rng.normal(size=wave.shape)
    found = np.arctan2((grey * np.sin(shifts)).sum(axis=0), (grey * np.cos(shifts)).sum(axis=0))
    error = np.angle(np.exp(1j * (found - phase)))
    predicted = sum(float(v[0]) for v in phase_variances(seen_by_hand(steps), Effects()).values())
    assert np.var(error) / predicted == pytest.approx(1, abs=5 / math.sqrt(count / 2))


def test_white_never_clips() -> None:
    rig, effects = paper_rig(), Effects()
    near, _ = wall_at(rig, 364.0)
    shorter = shorten_exposure(rig, near, effects).camera.exposure_ms
    assert shorter < effects.camera.exposure_ms
    bright = see_fringes(rig, near, fringes(8), effects)
    white = 2 * (bright.offset - bright.ambient) / 1.002 + bright.ambient
    assert white.max() == pytest.approx(FULLEST * 255)
    far, _ = wall_at(rig, 900.0)
    assert shorten_exposure(rig, far, effects) == effects


@pytest.mark.parametrize("steps", [3, 4])
def test_gamma_ripples(steps: int) -> None:
    """Against the light of 20 000 phases; the size of a pixel takes up to 5 % of a harmonic."""
    video = replace(Effects(), projector=replace(Effects().projector, gamma=2.2))
    phase = np.arange(20_000) * 2 * np.pi / 20_000
    shifts = np.array(equal_shifts(steps))[:, None]
    light = ((1 + np.cos(phase - shifts)) / 2) ** 2.2
    found = np.arctan2((light * np.sin(shifts)).sum(axis=0), (light * np.cos(shifts)).sum(axis=0))
    error = np.angle(np.exp(1j * (found - phase)))
    name = "projector: response (gamma)"
    sharp = pattern_errors(seen_by_hand(steps), video)[name]
    assert sharp == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=0.1)
    assert pattern_errors(seen_by_hand(steps, blur=2.0), video)[name] < sharp / 2


def test_a_linear_projector_ripples_by_its_levels_alone() -> None:
    """Rounding to 1 / 255 like noise of 1 / sqrt(12): 2 sqrt(2 / N) of it; within a factor of 2."""
    found = pattern_errors(seen_by_hand(8), Effects())
    assert found["projector: response (gamma)"] < 1e-9
    levels = 2 * math.sqrt(2 / 8) / 255 / math.sqrt(12)
    assert 0 < found["projector: rounding to levels"] < 2 * levels
