"""Photon transfer on the twin's camera, whose figures are known, and against `emva1288`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fringeworks.errors import DecodeError, UsageError
from fringeworks.model import Capture, Fringe, PatternSet, Uniform
from fringeworks.patterns import equal_shifts
from fringeworks.phase.photon_transfer.levels import find_saturation, step_of
from fringeworks.phase.photon_transfer.measure import measure_noise
from fringeworks.phase.photon_transfer.samples import with_rounding, without_rounding
from fringeworks.twin.effects import CameraEffects
from fringeworks.twin.expose import make_chip, sensor_of
from tests.phase.flats import HEIGHT, WIDTH, as_capture, see_dark, see_flats

TWELVE = CameraEffects(bits=12, black_level=60.0)
SEEDS = 8
MOST_Z = math.sqrt(20.1 / SEEDS)
"""Root mean square of eight errors over their sigma: chi-squared of 8 exceeds 20.1 in 1 %."""


def map_frames(capture: Capture, change: Callable[[Any], Any]) -> Capture:
    return replace(capture, frames=tuple(change(stack) for stack in capture.frames))


@pytest.mark.parametrize(
    ("effects", "repeats"),
    [
        (CameraEffects(black_level=6.0), 4),
        (CameraEffects(black_level=6.0), 2),
        (TWELVE, 4),
        (CameraEffects(bits=16, black_level=800.0), 4),
    ],
    ids=["8 bit", "pairs", "12 bit", "16 bit"],
)
def test_the_camera_is_recovered_within_its_sigma(effects: CameraEffects, repeats: int) -> None:
    """Flicker of 0.3 %, vignetting of 30 %, fixed pattern; sigma must be the scatter."""
    truth = sensor_of(effects)
    assert truth.gain is not None
    assert truth.read_noise is not None
    off = []
    for seed in range(SEEDS):
        flats = see_flats(effects, seed, repeats=repeats)
        found = measure_noise([flats], dark=[see_dark(effects, 1000 + seed)])
        assert found.black_way == "dark"
        assert found.moved_share < 0.001
        assert found.gain.value == pytest.approx(truth.gain, rel=0.02)
        assert found.read_noise.value == pytest.approx(truth.read_noise, rel=0.03)
        off.append(
            [
                (found.gain.value - truth.gain) / found.gain.sigma,
                (found.read_noise.value - truth.read_noise) / found.read_noise.sigma,
            ]
        )
        # The pixels' own offsets are the same with every seed: one draw in all.
        assert abs(found.black_level.value - truth.black_level) < 4 * found.black_level.sigma
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    assert (rms < MOST_Z).all(), rms
    assert (rms > 0.3).all(), rms  # chi-squared of 8 is below 0.7 in 4e-4


def test_dark_frames_with_light_are_refused() -> None:
    flats = see_flats(TWELVE, 1)
    with pytest.raises(DecodeError, match="are not dark"):
        measure_noise([flats], dark=[flats])


def test_flicker_is_no_noise() -> None:
    """A lamp of 10 % would be a variance of (0.1 x 3400)^2 at white, a hundred times the noise."""
    found = measure_noise([see_flats(TWELVE, 1, flicker=0.1)])
    assert abs(found.gain.value / 0.34125 - 1) < 4 * found.gain.sigma / 0.34125 < 0.02
    assert found.misfit < 0.02


def test_offsets_of_pixels_do_not_bend_the_curve() -> None:
    """Of 1 % of full scale, a bin's width: the darkest pixels of the darkest level are not it."""
    found = measure_noise([see_flats(replace(TWELVE, dsnu=0.01), 0)])
    # By their own means the darkest bin would lie 58 % above the line, and the misfit be 0.03.
    assert found.misfit < 0.01


def test_black_level_by_exposures_and_linearity() -> None:
    times = (0.1, 0.2, 0.35, 0.5, 0.7, 0.9)
    off = []
    for seed in range(4):
        capture = see_flats(TWELVE, seed, levels=(0.5, 1.0), exposures=times)
        found = measure_noise([capture])
        assert found.black_way == "exposures"
        off.append((found.black_level.value - 60.0) / found.black_level.sigma)
        assert found.linearity is not None
        # Flicker of 0.3 %, mean of four: 0.15 % of each point; 4 sigma.
        assert max(-found.linearity.least, found.linearity.most) < 0.006
    assert np.sqrt(np.mean(np.square(off))) < math.sqrt(13.3 / 4)  # chi-squared of 4, 1 %


def test_a_bent_camera_is_not_linear() -> None:
    times = (0.2, 0.35, 0.5, 0.7, 0.9)
    capture = see_flats(TWELVE, 0, levels=(1.0,), exposures=times, flicker=0.0)
    bent = map_frames(capture, lambda stack: np.rint(stack - stack**2.0 / 40_000).astype("u2"))
    found = measure_noise([bent]).linearity
    assert found is not None
    assert found.most - found.least > 0.01


def test_an_unknown_black_level_is_said_to_be() -> None:
    found = measure_noise([see_flats(TWELVE, 0)])
    assert found.black_way == "assumed"
    assert math.isnan(found.black_level.sigma)
    (note,) = [item for item in found.findings if item.name == "black level"]
    assert "anything from 0.00 to" in note.message
    # Read noise is that of black level 0, where the true line of variance runs 60 levels on.
    assert found.read_noise.value**2 == pytest.approx(6.825**2 - 60 * 0.34125, abs=1.5)
    dark = see_dark(CameraEffects(), 1)
    found = measure_noise([see_flats(CameraEffects(), 0)], dark=[dark])
    assert found.black_way == "assumed"
    assert "dark clipped" in [item.name for item in found.findings]


def test_repeated_fringes_serve_as_well() -> None:
    """Levels of all kinds within every frame; the light is that of a lamp of 1 %."""
    rng = np.random.default_rng(3)
    chip = make_chip(TWELVE, width=WIDTH, height=HEIGHT)
    fringe = Fringe("x", 32.0, equal_shifts(4))
    turns = 2 * np.pi * np.arange(WIDTH) / 24
    frames: list[Any] = [
        chip.read(np.tile(light.astype(np.float32), (HEIGHT, 1)), rng)
        for shift in fringe.shifts_rad
        for lamp in 1 + 0.01 * rng.standard_normal(4)
        for light in [lamp * (0.45 + 0.4 * np.cos(turns - shift))]
    ]
    stack: Any = np.stack(frames)
    found = measure_noise([as_capture([PatternSet(fringe, repeats=4)], [stack], 4095.0)])
    assert abs(found.gain.value - 0.34125) < 4 * found.gain.sigma < 0.02
    assert found.moved_share < 0.001


def test_full_scale_is_where_frames_saturate() -> None:
    effects = replace(TWELVE, bits=8)
    found = measure_noise([see_flats(effects, 0, light=1.5, levels=(0.0, 0.3, 0.5, 1.0))])
    assert found.saturates
    assert found.full_scale == 255.0
    assert found.gain.value == pytest.approx(0.02125, rel=0.02)
    cut = map_frames(see_flats(TWELVE, 0), lambda stack: np.minimum(stack, 3000))
    found = measure_noise([cut])
    assert found.full_scale == 3000.0
    assert "frames saturate at 3000, not at 4095" in str(found.findings)
    assert found.gain.value == pytest.approx(0.34125, rel=0.02)
    assert not found.points.used[-1]


@pytest.mark.parametrize(("factor", "step"), [(257.0, 257), (65535 / 4095, 16)])
def test_stretched_levels(factor: float, step: int) -> None:
    """Fewer bits in a file of 16: all figures grow by the factor, the step is told."""
    effects = CameraEffects(black_level=6.0) if step == 257 else TWELVE
    truth = sensor_of(effects)
    plain, dark = see_flats(effects, 0), see_dark(effects, 1)
    flats, capped = (
        map_frames(item, lambda stack: np.rint(stack * factor).astype(np.uint16))
        for item in (plain, dark)
    )
    wide = replace(flats.sensor, full_scale=65535.0)
    found = measure_noise([replace(flats, sensor=wide)], dark=[replace(capped, sensor=wide)])
    assert truth.gain is not None
    assert truth.read_noise is not None
    assert found.step == step
    assert f"grey levels come in steps of {step}" in str(found.findings)
    assert found.gain.value == pytest.approx(truth.gain * factor, rel=0.02)
    assert found.read_noise.value == pytest.approx(truth.read_noise * factor, rel=0.03)
    further = (step**2 - 1) / 12
    assert found.sensor.read_noise == pytest.approx(
        math.hypot(found.read_noise.value, further**0.5)
    )


def test_rounding_of_evenly_spread_levels() -> None:
    """A million rounded pairs; their variance scatters by about 2 / 1000 of itself."""
    rng = np.random.default_rng(0)
    for sigma in (0.1, 0.2, 0.3, 0.5, 1.0):
        pair = np.rint(rng.random(1_000_000) + sigma * rng.standard_normal((2, 1_000_000)))
        seen = np.var(pair, axis=0, ddof=1).mean()
        expected = with_rounding(np.array([sigma]))[0]
        assert seen == pytest.approx(expected, rel=0.01)
    several = np.array([0.05, 0.1, 0.3, 0.9, 3.0])
    assert without_rounding(with_rounding(several)) == pytest.approx(several**2, rel=2e-3)


def test_levels_that_occur() -> None:
    counts = np.zeros(1 << 16, np.int64)
    counts[[16, 48, 64]] = 5
    assert step_of(counts) == 16
    assert find_saturation(counts, 16) is None
    counts[80] = 500
    assert find_saturation(counts, 16) == 80
    counts[64] = 60
    assert find_saturation(counts, 16) is None  # a tail, no pile


def moved(capture: Capture) -> Capture:
    """Every repeat shifted by 3 px under a grating."""
    wave = 1 + 0.5 * np.sin(np.arange(WIDTH) / 5)

    def shift(stack: Any) -> Any:
        waves = [np.roll(wave, 3 * place) for place in range(len(stack))]
        return np.rint(stack * np.stack(waves)[:, np.newaxis] / 1.6).astype(stack.dtype)

    return map_frames(capture, shift)


@pytest.mark.parametrize(
    ("captures", "words"),
    [
        (lambda: [see_flats(TWELVE, 0, repeats=1)], "no set of flats is repeated"),
        (lambda: [see_flats(TWELVE, 0, levels=(0.8, 1.0), light=4.0)], "is saturated"),
        (lambda: [see_flats(TWELVE, 0, levels=(0.7,), vignetting=0.05)], "too much alike"),
        (lambda: [moved(see_flats(TWELVE, 0))], "% of the image changes between repeats"),
        (
            lambda: [map_frames(see_flats(TWELVE, 0), lambda s: np.repeat(s[:1], len(s), axis=0))],
            "let no repeat be a copy",
        ),
        (
            lambda: [
                map_frames(
                    see_flats(TWELVE, 0),
                    lambda s: np.rint(4095 * (s / 4095) ** 0.45).astype(np.uint16),
                )
            ],
            "the noise falls where light grows",
        ),
    ],
    ids=["no repeats", "saturated", "one level", "moving", "copies", "gamma"],
)
def test_what_gives_no_figures(captures: Callable[[], list[Capture]], words: str) -> None:
    with pytest.raises(DecodeError, match=words):
        measure_noise(captures())


def test_one_camera_at_a_time() -> None:
    flats = see_flats(TWELVE, 0, levels=(0.0, 1.0))
    smaller = map_frames(flats, lambda stack: stack[:, :-2])
    with pytest.raises(UsageError, match="must be of one camera: flats has 160x112 px of 16 bits"):
        measure_noise([flats, smaller])


def test_several_captures_of_one_level_each() -> None:
    each = [see_flats(TWELVE, place, levels=(level,)) for place, level in enumerate((0, 0.4, 1.0))]
    found = measure_noise(each)
    assert abs(found.gain.value - 0.34125) < 4 * found.gain.sigma < 0.02


def test_no_shot_noise_is_told() -> None:
    found = measure_noise([see_flats(replace(TWELVE, shot_noise=False), 0)])
    assert "no shot noise" in [item.name for item in found.findings]
    assert found.sensor.gain is not None
    assert found.sensor.gain < 0.001


class TestAgainstEmva1288:
    """The reference implementation on the same frames; pairs, even light, a lamp that is steady."""

    @pytest.fixture
    def results(self, monkeypatch: pytest.MonkeyPatch) -> Any:
        # emva1288 1.0.2 was written for NumPy 1: asfarray is all it lacks.
        monkeypatch.setattr(np, "asfarray", np.asarray, raising=False)
        from emva1288.process import routines
        from emva1288.process.data import Data1288
        from emva1288.process.results import Results1288

        def of(pairs: dict[tuple[float, float], Any]) -> Any:
            temporal: dict[float, dict[float, dict[str, float]]] = {}
            for (time, photons), pair in pairs.items():
                sums = routines.get_int_imgs(list(pair))
                values = {key: np.sum(sums[key]) for key in ("sum", "pvar", "dmean")}
                temporal.setdefault(time, {})[photons] = values
            size = {"width": WIDTH, "height": HEIGHT}
            empty = {1.0: {key: _spatial(pairs) for key in (0.0, 1.0)}}
            data = Data1288({**size, "temporal": temporal, "spatial": empty}).data
            return Results1288(data)

        return of

    @pytest.fixture
    def pairs(self) -> dict[tuple[float, float], Any]:
        """Frames by exposure and photons: 26 exposures up to saturation, each with its dark."""
        found = {}
        for time in np.linspace(0.05, 1.3, 26).tolist():
            shown: Any = {"repeats": 2, "flicker": 0.0, "vignetting": 0.0, "exposures": (time,)}
            bright = see_flats(TWELVE, round(1000 * time), levels=(1.0,), **shown)
            dark = see_flats(TWELVE, round(1000 * time) + 1, levels=(0.0,), light=0.0, **shown)
            found[time, 0.0] = dark.frames[0]
            found[time, 1000 * time] = bright.frames[0]
        return found

    def test_gain_read_noise_and_linearity(self, results: Any, pairs: Any) -> None:
        theirs = results(pairs)
        lit = [(time, stack) for (time, photons), stack in pairs.items() if photons]
        sets = [PatternSet(Uniform(1.0), exposure_ms=time, repeats=2) for time, _ in lit]
        flats = as_capture(sets, [stack for _, stack in lit], 4095.0)
        capped = [stack for (_, photons), stack in pairs.items() if not photons]
        unlit = [PatternSet(Uniform(0.0), repeats=2) for _ in capped]
        found = measure_noise([flats], dark=[as_capture(unlit, capped, 4095.0)])
        # Both see the same noise; theirs has the weights of equal variance and 70 % of the range.
        assert found.gain.value == pytest.approx(theirs.K, rel=0.01)
        # Theirs keeps the rounding in the figure that it calls sigma_y.dark.
        read = math.sqrt(theirs.sigma_y_dark**2 - 1 / 12)
        assert found.read_noise.value == pytest.approx(read, rel=0.01)
        assert found.full_scale == 4095.0
        assert found.linearity is not None
        # Their 5 to 95 % are of the signal where the variance is largest, ours of full scale.
        assert 100 * found.linearity.least == pytest.approx(theirs.LE_min, abs=0.1)
        assert 100 * found.linearity.most == pytest.approx(theirs.LE_max, abs=0.1)


def _spatial(pairs: dict[tuple[float, float], Any]) -> dict[str, Any]:
    """Their spatial part wants two frames; nothing of it is looked at."""
    image = next(iter(pairs.values()))[0].astype(np.int64)
    return {"L": 2, "sum": 2 * image, "pvar": np.zeros_like(image)}
