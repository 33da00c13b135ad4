"""Several exposures as one: weights by closed form, codes at any exposure, refusals, the twin."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fringeworks.errors import DecodeError
from fringeworks.model import (
    Camera,
    Capture,
    CodedAxis,
    Colour,
    FloatMap,
    Frames,
    Fringe,
    GrayCode,
    ImageExponent,
    Lens,
    Noise,
    Pattern,
    PatternSet,
    Response,
    Rig,
    Sensor,
    Void,
    WrappedPhase,
)
from fringeworks.model.phase import NO_EXPOSURE
from fringeworks.patterns import expose_repeatedly, make_sequence
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.exposures import fuse, notice_exposures
from fringeworks.phase.methods import OrdersName
from fringeworks.phase.window import volume_of
from fringeworks.twin.scenes import contrast_scene, paper_rig
from fringeworks.twin.simulate import Simulation, simulate
from tests.phase.encoding import BLACK, WHITE, Scene, capture_of, equal_shifts, sweep

EXTENT = 256
FRINGE = Fringe("x", 16.0, equal_shifts(4))
CODE = GrayCode("x", 4, 16.0, complementary=True)
BLACK_LEVEL, READ, GAIN = 10.0, 0.8, 0.02
SENSOR = Sensor(255.0, BLACK_LEVEL, GAIN, READ)
LADDER = (1.0, 4.0, 16.0)
ALBEDO = np.geomspace(0.02, 1.0, 40)[:, np.newaxis]
U = np.repeat(sweep(EXTENT, samples_per_px=4), len(ALBEDO), axis=0)
LIGHT, AMBIENT = 180.0, 8.0
"""Grey levels that white and the room add at albedo 1 and an exposure of 1 ms."""


def scene_at(exposure_ms: float) -> Scene:
    half = ALBEDO * LIGHT * exposure_ms / 2
    offset = BLACK_LEVEL + ALBEDO * AMBIENT * exposure_ms + half
    return Scene(U, EXTENT, offset=offset, modulation=half, sensor=SENSOR, read=READ, gain=GAIN)


def exposed(
    pattern: Pattern, exposure_ms: float, rng: np.random.Generator | None, repeats: int = 1
) -> tuple[PatternSet, Frames]:
    scene = scene_at(exposure_ms)
    frames = scene.expose(np.repeat(scene.light(pattern), repeats, axis=0), rng)
    return PatternSet(pattern, exposure_ms=exposure_ms, repeats=repeats), frames


def ladder_of(
    *patterns: Pattern, codes_ms: tuple[float, ...] = LADDER, rng: np.random.Generator | None = None
) -> Capture:
    """Fringes at every exposure, all else at those of `codes_ms`."""
    sets = [
        exposed(pattern, exposure_ms, rng)
        for pattern in patterns
        for exposure_ms in (LADDER if isinstance(pattern, Fringe) else codes_ms)
    ]
    return capture_of(*sets, extent=EXTENT, sensor=SENSOR)


def alone(capture: Capture, exposure_ms: float) -> Capture:
    places = [
        place for place, item in enumerate(capture.sequence.sets) if item.exposure_ms == exposure_ms
    ]
    sets = tuple(capture.sequence.sets[place] for place in places)
    sequence = replace(capture.sequence, sets=sets)
    return replace(capture, sequence=sequence, frames=tuple(capture.frames[i] for i in places))


def column_of(capture: Capture, orders: OrdersName = "auto") -> CodedAxis:
    (axis,) = decode_phases(capture, orders=orders).coded
    return axis


def seen(phase: list[float], sigma: list[float], void: list[int], level: float) -> WrappedPhase:
    """A row of pixels; grey levels are `level` above black."""
    shape = (1, len(phase))

    def row(values: list[float]) -> FloatMap:
        return np.array(values, np.float32).reshape(shape)

    dark = np.array(void).reshape(shape) != Void.VALID
    grey = np.full(shape, BLACK_LEVEL + level, np.float32)
    return WrappedPhase(
        FRINGE,
        np.where(dark, np.float32(np.nan), row(phase)),
        grey,
        np.full(shape, level, np.float32),
        np.full(shape, level / 10, np.float32),
        np.where(dark, np.float32(np.nan), row(sigma)),
        Noise(READ, GAIN, BLACK_LEVEL, "camera"),
        np.array(void, np.uint8).reshape(shape),
    )


class TestWeights:
    """Worked out by hand; float32 knows phases to 2e-7."""

    SHORT = seen([3.0, 1.0, 0.0, 0.0], [0.2, 0.1, 0.0, 0.0], [0, 0, 2, 2], 10.0)
    LONG = seen([-3.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.0, 0.0], [0, 1, 1, 3], 44.0)
    FUSED = fuse([(8.0, LONG), (2.0, SHORT)], reference_ms=8.0)

    def test_phase_over_the_jump(self) -> None:
        """Weights 25 and 100: the phasor's angle, within 1e-3 of the mean on the short way."""
        phasor = 25 * np.exp(3j) + 100 * np.exp(-3j)
        assert self.FUSED.phase[0, 0] == pytest.approx(np.angle(phasor), abs=1e-6)
        short_way = -3 - (2 * np.pi - 6) / 5
        assert self.FUSED.phase[0, 0] == pytest.approx(short_way, abs=1e-3)
        assert self.FUSED.sigma[0, 0] == pytest.approx(125**-0.5, rel=1e-6)

    def test_a_void_exposure_does_not_take_part(self) -> None:
        assert self.FUSED.phase[0, 1] == pytest.approx(1.0, abs=1e-6)
        assert self.FUSED.sigma[0, 1] == pytest.approx(0.1, rel=1e-6)

    def test_levels_of_the_longest(self) -> None:
        """10 above black at 2 ms is 40 at 8 ms; with 44 there, weighted 1 : 4, 43.2."""
        assert self.FUSED.modulation[0, :2] == pytest.approx([43.2, 40.0])
        assert self.FUSED.offset[0, :2] == pytest.approx([BLACK_LEVEL + 43.2, BLACK_LEVEL + 40.0])
        assert self.FUSED.residual[0, :2] == pytest.approx([4.4, 4.0])

    def test_void_only_where_all_are_for_the_reason_of_the_longest_unsaturated(self) -> None:
        assert self.FUSED.void.tolist() == [[0, 0, Void.MODULATION, Void.RESIDUAL]]
        assert np.isnan(self.FUSED.phase[0, 2:]).all()
        assert np.isnan(self.FUSED.sigma[0, 2:]).all()
        assert self.FUSED.modulation[0, 2:] == pytest.approx([40.0, 44.0])

    def test_who_rules(self) -> None:
        fusion = self.FUSED.fusion
        assert fusion is not None
        assert fusion.exposures_ms == (2.0, 8.0)
        assert fusion.ruling.tolist() == [[1, 0, NO_EXPOSURE, NO_EXPOSURE]]
        assert fusion.shares == (0.5, 0.5)


@cache
def noisy() -> Capture:
    return ladder_of(FRINGE, CODE, rng=np.random.default_rng(5))


@cache
def fused() -> CodedAxis:
    return column_of(noisy())


class TestLadder:
    def test_each_alone_sees_a_part_all_see_all(self) -> None:
        for exposure_ms in LADDER:
            assert column_of(alone(noisy(), exposure_ms)).valid_share < 0.8
        assert fused().valid_share == 1.0

    def test_sigma(self) -> None:
        """40 960 pixels: their rms is known to 0.35 %, five times that and 2 % for clipping."""
        score = (fused().coordinate - U) / fused().sigma
        assert float(np.sqrt(np.mean(score**2))) == pytest.approx(1.0, abs=0.04)

    def test_better_than_the_brightest_unsaturated(self) -> None:
        brightest = np.full(U.shape, np.nan)
        for exposure_ms in LADDER:
            sigma = column_of(alone(noisy(), exposure_ms)).sigma
            brightest = np.where(np.isfinite(sigma), sigma, brightest)
        known = np.isfinite(brightest)
        assert (fused().sigma[known] <= brightest[known] * 1.0001).all()
        # Of exposures in steps of four, limited by shot noise, the others add 1/4 and 1/16.
        gain = np.median((brightest / fused().sigma)[known])
        assert 1.02 < gain <= (1 + 1 / 4 + 1 / 16) ** 0.5

    def test_repeats_may_differ(self) -> None:
        """Five images of each shift at the shortest: sigma there falls with the root."""
        shortest = exposed(FRINGE, 1.0, np.random.default_rng(6), repeats=5)
        sets = [(item, stack) for item, stack in noisy() if item.pattern != FRINGE] + [
            shortest,
            exposed(FRINGE, 4.0, np.random.default_rng(7)),
        ]
        more = column_of(capture_of(*sets, extent=EXTENT, sensor=SENSOR))
        bright = np.s_[-2:]
        assert np.median(more.sigma[bright] / fused().sigma[bright]) < 0.6
        assert np.abs(more.coordinate - U)[bright].max() < 1.0

    def test_what_is_told(self) -> None:
        (finding,) = notice_exposures(decode_phases(noisy()).finest)
        assert finding.message.startswith("axis x: exposures were fused; the decoded pixels rest")
        assert all(f"{exposure_ms:g} ms (" in finding.message for exposure_ms in LADDER)
        assert not list(notice_exposures(decode_phases(alone(noisy(), 4.0)).finest))


@pytest.mark.parametrize("codes_ms", [(4.0,), (16.0,), (4.0, 16.0), LADDER])
@pytest.mark.parametrize("uniform", [False, True])
def test_a_code_serves_all_exposures(codes_ms: tuple[float, ...], *, uniform: bool) -> None:
    """Also where its light is far beyond saturation: what counts is that its dark is not."""
    others = (WHITE, BLACK) if uniform else ()
    column = column_of(ladder_of(FRINGE, CODE, *others, codes_ms=codes_ms))
    assert column.valid_share > 0.999
    assert np.nanmax(np.abs(column.coordinate - U)) < 1.0  # a wrong order is off by 16 px


def test_code_alone() -> None:
    fine = GrayCode("x", 8, 1.0, inverted=True)
    column = column_of(ladder_of(fine))
    assert column.valid_share > 0.97
    assert np.nanmax(np.abs(column.coordinate - U)) <= 0.5 + 1e-3


@pytest.mark.parametrize("first_ms", [1.0, 4.0])
def test_a_colour_frame_goes_with_the_first_white(first_ms: float) -> None:
    """Told before colours are read: white first at 1 ms, the colour frame first at either."""
    colour = Colour("x", 16.0, ("red", "green"))
    seen = np.zeros((1, *U.shape, 3), np.uint8)
    sets = [exposed(FRINGE, ms, None) for ms in (1.0, 4.0)]
    sets += [exposed(flat, ms, None) for ms in (1.0, 4.0) for flat in (WHITE, BLACK)]
    sets += [(PatternSet(colour, exposure_ms=ms), seen) for ms in (first_ms, 5.0 - first_ms)]
    capture = capture_of(*sets, extent=EXTENT, sensor=SENSOR)
    said = "no white frame in colour" if first_ms == 1.0 else "must have one exposure"
    with pytest.raises(DecodeError, match=said):
        decode_phases(capture, orders="colour")


def test_white_is_of_the_longest_exposure() -> None:
    capture = ladder_of(FRINGE, WHITE, BLACK)
    white, black = capture.white(), capture.black()
    assert white is not None
    assert black is not None
    expected = BLACK_LEVEL + ALBEDO * (LIGHT + AMBIENT) * 16
    # Half a level of rounding, at 1 ms times 16.
    assert np.abs(white - expected).max() <= 8.0
    dark = (expected < SENSOR.saturation).ravel()
    assert np.abs(white - expected)[dark].max() <= 0.5
    assert np.abs(black - (BLACK_LEVEL + ALBEDO * AMBIENT * 16)).max() <= 0.5
    assert capture.saturation_of(WHITE) == pytest.approx(BLACK_LEVEL + (249.9 - BLACK_LEVEL) * 16)


def test_a_response_is_taken_at_each_exposure() -> None:
    """Light to the power 0.8 below an exponent of 1.25; sixteen bits, so that rounding is small."""
    fringe = Fringe("x", 16.0, equal_shifts(3))
    deep = Sensor(65_535.0)
    sets = []
    for exposure_ms in (1.0, 4.0):
        light = 0.2 * exposure_ms * ALBEDO * (1 + scene_at(1.0).light(fringe)) / 2 + 0.001
        levels = np.rint(65_535 * np.minimum(light, 1.0) ** 0.8).astype(np.uint16)
        sets.append((PatternSet(fringe, exposure_ms=exposure_ms), levels))
    capture = capture_of(*sets, extent=EXTENT, sensor=deep)
    true = np.pi - np.mod(np.pi - 2 * np.pi * (U + 0.5) / 16.0, 2 * np.pi)
    exponent = Response("gray", "test", ImageExponent(1.25, 0.1, 0.0), EXTENT, EXTENT)

    def error(response: Response | None) -> float:
        ((wrapped, _),) = decode_phases(capture, response=response).relative
        assert wrapped.fusion is not None
        off = np.angle(np.exp(1j * (wrapped.phase - true)))
        return float(np.sqrt(np.nanmean(np.square(off))))

    assert error(None) > 0.03
    assert error(exponent) < 0.003


class TestRefusals:
    TWICE = (exposed(FRINGE, 1.0, None), exposed(FRINGE, 4.0, None))

    def refused(self, *sets: tuple[PatternSet, Frames]) -> str:
        with pytest.raises(DecodeError) as caught:
            decode_phases(capture_of(*sets, extent=EXTENT, sensor=SENSOR))
        return str(caught.value)

    def test_one_without_an_exposure(self) -> None:
        item, frames = self.TWICE[1]
        said = self.refused(self.TWICE[0], (replace(item, exposure_ms=None), frames))
        assert "16 px along x stand twice" in said
        assert "`exposure_ms`" in said

    def test_equal_exposures(self) -> None:
        assert "with exposure_ms = 4: write one set with `repeats`" in self.refused(
            *self.TWICE, self.TWICE[1]
        )

    def test_other_shifts(self) -> None:
        other = exposed(Fringe("x", 16.0, equal_shifts(3)), 4.0, None)
        assert "have 3 shifts at one exposure and other ones (4)" in self.refused(
            self.TWICE[0], other
        )

    def test_a_code_without_an_exposure(self) -> None:
        item, frames = exposed(CODE, 4.0, None)
        said = self.refused(*self.TWICE, (replace(item, exposure_ms=None), frames))
        assert said.startswith("set 3 (Gray codes of 16 px cells along x) has no exposure_ms")

    def test_another_period_is_another_fringe(self) -> None:
        """It need not be shown at all exposures."""
        coarse = exposed(Fringe("x", 300.0, equal_shifts(4)), 4.0, None)
        axis = column_of(capture_of(*self.TWICE, coarse, extent=EXTENT, sensor=SENSOR))
        assert axis.route[-1].endswith("16 px")
        assert axis.valid_share > 0.5


def small_rig() -> Rig:
    """The paper's rig with a quarter of the camera's pixels."""
    rig = paper_rig()
    lens = rig.camera.lens
    halved = Lens(
        lens.fx / 2, lens.fy / 2, lens.cx / 2 - 0.25, lens.cy / 2 - 0.25, *lens.vector[4:]
    )
    return replace(rig, camera=Camera(376, 240, halved))


def shown(preset: str, *, seed: int, **options: object) -> Simulation:
    rig = small_rig()
    sequence = make_sequence(preset, width=608, height=684, axes=("x",), **options)  # type: ignore[arg-type]
    ladder = expose_repeatedly(sequence, (4.0, 16.0, 64.0))
    return simulate(contrast_scene(), rig, ladder, rng=np.random.default_rng(seed))


@cache
def measured(seed: int) -> Simulation:
    return shown("measure", seed=seed)


class TestTwin:
    def test_coverage(self) -> None:
        lit = np.isfinite(measured(1).truth.column)
        known = [
            np.isfinite(column_of(part).coordinate)[lit].mean()
            for part in (
                *(alone(measured(1).capture, ms) for ms in (4.0, 16.0, 64.0)),
                measured(1).capture,
            )
        ]
        assert max(known[:3]) < 0.96
        assert known[3] > 0.98

    def test_sigma_by_repeating(self) -> None:
        """Half the squared difference of two captures; 5 per mille are edges between surfaces."""
        first, second = column_of(measured(1).capture), column_of(measured(2).capture)
        apart = np.square(first.coordinate - second.coordinate)
        score = np.sort((apart / (first.sigma**2 + second.sigma**2))[np.isfinite(apart)])
        assert np.sqrt(score[: int(0.995 * len(score))].mean()) == pytest.approx(1.0, abs=0.1)


@cache
def coded() -> Simulation:
    """Staircase and code frame on top of the paper's fringes."""
    return shown("paper", seed=3, code="staircase")


@pytest.mark.parametrize("orders", ["staircase", "code-frame", "paper-code"])
def test_other_codes(orders: OrdersName) -> None:
    made = coded()
    volume = volume_of(small_rig(), None)
    (axis,) = decode_phases(made.capture, orders=orders, volume=volume).coded
    off = np.abs(axis.coordinate - made.truth.column)
    known = np.isfinite(off)
    assert known.sum() > 0.8 * np.isfinite(made.truth.column).sum()
    assert np.mean(off[known] < 8) > 0.99
