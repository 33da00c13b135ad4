"""Masks, noise sources, repeats, groups and refusals; invariance under gain and offset."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.errors import DecodeError, ShapeError, UsageError
from fringeworks.model import (
    Frames,
    Fringe,
    GrayCode,
    PatternSet,
    Sensor,
    Uniform,
    Void,
    WrappedPhase,
    describe_voids,
)
from fringeworks.phase.decode import decode_capture, decode_phases
from fringeworks.phase.demodulate import MaskRules, demodulate, wrap_three_steps
from tests.phase.encoding import (
    BLACK,
    SENSOR_16,
    WHITE,
    Scene,
    capture_of,
    equal_shifts,
    repeated,
    sweep,
)

WIDTH = 256
QUIET = Sensor(255.0, gain=0.0, read_noise=1.0)
SIGMA = float(np.sqrt(1 + 1 / 12))
FOUR = Fringe("x", 16.0, equal_shifts(4))
THREE = Fringe("x", 16.0, equal_shifts(3))


def pixels(*columns: list[int]) -> Frames:
    """Frames ``(N, 1, n)`` from the N grey levels of each of n pixels."""
    frames: Frames = np.array(columns, np.uint8).T[:, np.newaxis]
    return frames


def voids(
    frames: Frames, fringe: Fringe, sensor: Sensor = QUIET, rules: MaskRules | None = None
) -> list[int]:
    wrapped = demodulate(frames, fringe, sensor, rules=rules)
    assert np.isnan(wrapped.phase).tolist() == (wrapped.void != Void.VALID).tolist()
    assert np.isnan(wrapped.sigma).tolist() == (wrapped.void != Void.VALID).tolist()
    assert np.isfinite(wrapped.offset).all()
    assert np.isfinite(wrapped.modulation).all()
    (row,) = wrapped.void.tolist()
    return list(row)


GOOD = [180, 100, 20, 100]


class TestVoid:
    def test_every_reason_of_a_set(self) -> None:
        frames = pixels(
            GOOD,
            [255, 255, 20, 100],  # two of four frames saturated: two are left
            [255, 100, 20, 100],  # one of four: three are left
            [105, 100, 95, 100],  # B = 5 grey levels, below 8
            [180, 110, 20, 110],  # A - B + C - D = -20: a residual of 10 at sigma 1.04
            [104, 110, 96, 110],  # both: modulation is asked first
        )
        expected = [Void.VALID, Void.SATURATED, Void.VALID, Void.MODULATION, Void.RESIDUAL]
        assert voids(frames, FOUR) == [*expected, Void.MODULATION]

    def test_they_are_counted(self) -> None:
        frames = pixels(GOOD, [255, 255, 20, 100], [105, 100, 95, 100], [180, 110, 20, 110])
        wrapped = demodulate(frames, FOUR, QUIET)
        assert describe_voids(wrapped.void) == (
            "25.0% saturated, 25.0% too little modulation, 25.0% too large a residual"
        )

    def test_three_frames_cannot_lose_one(self) -> None:
        assert voids(pixels([180, 60, 60], [255, 60, 60]), THREE) == [Void.VALID, Void.SATURATED]

    @pytest.mark.parametrize(("full_scale", "lost"), [(255.0, False), (229.0, True)])
    def test_saturation_follows_full_scale(self, full_scale: float, lost: bool) -> None:
        # 98 % of 229 is 224.4
        sensor = dataclasses.replace(QUIET, full_scale=full_scale)
        expected = Void.SATURATED if lost else Void.VALID
        assert voids(pixels([225, 60, 60]), THREE, sensor) == [expected]

    @pytest.mark.parametrize(
        ("rules", "kept"),
        [
            # Modulations of 4, 5, 7, 8, 9 grey levels; 8 / 255 of full scale, 5 sigma of 1.04.
            (MaskRules(), [8, 9]),
            (MaskRules(modulation_share=0.0), [7, 8, 9]),  # 5 < 5 sigma = 5.2 < 7
            (MaskRules(modulation_share=5 / 255), [7, 8, 9]),
            (MaskRules(modulation_share=5 / 255, modulation_sigmas=0.0), [5, 7, 8, 9]),
            (MaskRules(modulation_sigmas=8.5), [9]),  # 8.5 sigma = 8.85
        ],
    )
    def test_modulation_rules(self, rules: MaskRules, kept: list[int]) -> None:
        levels = [4, 5, 7, 8, 9]
        frames = pixels(*([100 + b, 100, 100 - b, 100] for b in levels))
        # Single precision leaves 8 a few ulps below itself: ask just under it.
        share = rules.modulation_share * (1 - 1e-6)
        found = voids(frames, FOUR, rules=dataclasses.replace(rules, modulation_share=share))
        assert [b for b, void in zip(levels, found, strict=True) if void == Void.VALID] == kept

    def test_the_defaults_are_those_of_the_formats_page(self) -> None:
        assert MaskRules() == MaskRules(
            modulation_sigmas=5.0, modulation_share=8 / 255, residual_sigmas=5.0
        )

    @pytest.mark.parametrize(("sigmas", "expected"), [(4.7, Void.RESIDUAL), (4.9, Void.VALID)])
    def test_residual_rule(self, sigmas: float, expected: Void) -> None:
        # A - B + C - D = -10, halved: 5 grey levels are 4.80 sigma.
        rules = MaskRules(residual_sigmas=sigmas)
        assert voids(pixels([180, 105, 20, 105]), FOUR, rules=rules) == [expected]

    def test_outside_the_projector(self) -> None:
        # One coarse fringe of 300 px on 256 px: coordinates from -22.5 to 277.5 can be measured.
        scene = Scene(np.array([[-5.0, 0.0, 128.0, 255.0, 262.0]]), WIDTH, sensor=QUIET)
        fringe = Fringe("x", 300.0, equal_shifts(4))
        column = decode_capture(scene.capture(fringe)).column
        assert column is not None
        # sigma is 300 / 2 pi * sqrt(2 / 4) * 1.04 / 100 = 0.35 px: both ends are > 10 sigma out.
        assert column.void.tolist() == [[Void.ORDER, 0, 0, 0, Void.ORDER]]
        assert column.phase is not None
        assert column.phase.order[0, 0] == column.phase.order[0, -1] == -1
        assert np.isnan(column.phase.margin).tolist() == [[True, False, False, False, True]]
        assert np.isnan(column.sigma).tolist() == [[True, False, False, False, True]]

    def test_dark_pixels_of_a_code_alone(self) -> None:
        # White and black are 100 +- 3.5, 8.5, 60 grey levels; 8 are asked.
        scene = Scene(np.full((1, 3), 3.0), WIDTH, offset=100.0,
                      modulation=np.array([[3.5, 8.5, 60.0]]), sensor=QUIET)  # fmt: skip
        column = decode_capture(scene.capture(GrayCode("x", 4, 16.0), WHITE, BLACK)).column
        assert column is not None
        assert column.void.tolist() == [[Void.MODULATION, 0, 0]]


class TestNoiseSource:
    SCENE = Scene(sweep(WIDTH, samples_per_px=1, rows=60), WIDTH, read=2.0)

    def wrapped(self, fringe: Fringe, sensor: Sensor) -> WrappedPhase:
        frames = self.SCENE.frames(fringe, np.random.default_rng(0))
        return demodulate(frames, fringe, sensor)

    def test_camera_where_it_is_known(self) -> None:
        for fringe in (THREE, FOUR):
            noise = self.wrapped(fringe, Sensor(255.0, 3.0, gain=0.01, read_noise=2.0)).noise
            assert (noise.source, noise.gain, noise.black_level) == ("camera", 0.01, 3.0)
            assert noise.read == pytest.approx(np.sqrt(4 + 1 / 12))

    @pytest.mark.parametrize("sensor", [Sensor(255.0), Sensor(255.0, read_noise=9.0)])
    def test_estimated_otherwise(self, sensor: Sensor) -> None:
        # 15360 pixels: a standard deviation to 1 / sqrt(2 n) = 0.6 %; the median of second
        # differences, correlated over 3 x 3 pixels, to about 3 times that; five sigma.
        truth = np.sqrt(4 + 1 / 12)
        residual = self.wrapped(FOUR, sensor).noise
        assert residual.source == "residual"
        assert residual.read == pytest.approx(truth, rel=0.03)
        high_pass = self.wrapped(THREE, sensor).noise
        assert high_pass.source == "high-pass"
        assert high_pass.read == pytest.approx(truth, rel=0.09)

    def test_too_few_lit_pixels(self) -> None:
        # 60 lit pixels are no sample: high-pass differences of the whole image stand in.
        dim = dataclasses.replace(self.SCENE, modulation=np.where(self.SCENE.u < 0.4, 80.0, 0.5))
        wrapped = demodulate(dim.frames(FOUR, np.random.default_rng(0)), FOUR, Sensor(255.0))
        assert 0 < np.count_nonzero(wrapped.void == Void.VALID) < 100
        assert wrapped.noise.source == "high-pass"
        assert wrapped.noise.read == pytest.approx(np.sqrt(4 + 1 / 12), rel=0.09)

    @pytest.mark.parametrize("shape", [(1, 1), (1, 5), (2, 2), (5, 1)])
    @pytest.mark.parametrize("fringe", [THREE, FOUR], ids=["three", "four"])
    def test_tiny_images(self, shape: tuple[int, int], fringe: Fringe) -> None:
        scene = Scene(np.zeros(shape), WIDTH)
        wrapped = demodulate(scene.frames(fringe), fringe, Sensor(255.0))
        assert wrapped.phase.shape == shape
        assert np.isfinite(wrapped.sigma).all()


class TestRepeats:
    SCENE = Scene(sweep(WIDTH, samples_per_px=2, rows=40), WIDTH, read=3.0, sensor=QUIET)

    def test_shift_by_shift(self) -> None:
        rng = np.random.default_rng(0)
        first, second = (self.SCENE.frames(THREE, rng) for _ in range(2))
        both = repeated(first, 2)
        both[1::2] = second
        wrapped = demodulate(both, THREE, QUIET, repeats=2)
        mean = (first.astype(float) + second) / 2
        truth = np.arctan2(
            *(np.einsum("n,nij->ij", f(np.array(THREE.shifts_rad)), mean) for f in (np.sin, np.cos))
        )
        turned = (wrapped.phase - truth + np.pi) % (2 * np.pi) - np.pi
        assert np.nanmax(np.abs(turned)) < 2e-6  # single precision: grey levels of 255 at B = 100

    def test_sigma_falls_and_a_residual_appears(self) -> None:
        frames = repeated(self.SCENE.frames(THREE), 2)
        once = demodulate(frames[::2], THREE, QUIET)
        twice = demodulate(frames, THREE, QUIET, repeats=2)
        np.testing.assert_allclose(twice.sigma, once.sigma / np.sqrt(2), rtol=1e-5)
        assert np.isnan(once.residual).all()
        assert np.nanmax(twice.residual) < 1e-3

    def test_in_a_capture(self) -> None:
        coarse = Fringe("x", 300.0, equal_shifts(3))
        frames = repeated(self.SCENE.frames(coarse), 3)
        capture = capture_of((PatternSet(coarse, repeats=3), frames), extent=WIDTH, sensor=QUIET)
        column = decode_capture(capture).column
        assert column is not None
        assert np.nanmax(np.abs(column.coordinate - self.SCENE.u)) < 0.5

    def test_wrong_number_of_frames(self) -> None:
        frames = self.SCENE.frames(THREE)
        with pytest.raises(ShapeError, match=r"must be \(6, H, W\), got \(3, 40, 512\)"):
            demodulate(frames, THREE, QUIET, repeats=2)
        with pytest.raises(ShapeError, match=r"must be \(4, H, W\), got \(3,"):
            demodulate(frames, FOUR, QUIET)
        with pytest.raises(ShapeError, match=r"must be \(3, H, W\), got \(512,\)"):
            demodulate(frames[0, 0], THREE, QUIET)
        with pytest.raises(ShapeError, match=r"must be \(3, H, W\), got \(4,"):
            wrap_three_steps(self.SCENE.frames(FOUR))


@pytest.mark.parametrize(
    "shifts", [(0.0,), (0.0, 1.0), (0.0, 2.0, 2 * np.pi), (1.0, 1.0, 1.0, 3.0), (0.0, 0.0, 0.0)]
)
def test_shifts_that_determine_nothing(shifts: tuple[float, ...]) -> None:
    frames = np.zeros((len(shifts), 2, 2), np.uint8)
    with pytest.raises(UsageError, match="shifts must contain three distinct angles, got"):
        demodulate(frames, Fringe("x", 16.0, shifts), QUIET)


class TestGroups:
    U = sweep(WIDTH, samples_per_px=1)
    COARSE = Fringe("x", 300.0, equal_shifts(4))

    def capture_sets(self) -> list[tuple[PatternSet, Frames]]:
        bright, dim = Scene(self.U, WIDTH), Scene(self.U, WIDTH, modulation=4.0)
        return [
            (PatternSet(self.COARSE, group="dim"), dim.frames(self.COARSE)),
            (PatternSet(self.COARSE, group="bright"), bright.frames(self.COARSE)),
        ]

    def test_the_chosen_one_is_decoded(self) -> None:
        capture = capture_of(*self.capture_sets(), extent=WIDTH)
        column = decode_capture(capture, group="bright").column
        assert column is not None
        assert np.isfinite(column.coordinate).all()

    def test_the_first_by_default(self) -> None:
        capture = capture_of(*self.capture_sets(), extent=WIDTH)
        with pytest.raises(DecodeError, match=r"along any axis \(x: 100\.0% too little mod"):
            decode_capture(capture)

    def test_unknown(self) -> None:
        with pytest.raises(UsageError, match="'dark'"):
            decode_capture(capture_of(*self.capture_sets(), extent=WIDTH), group="dark")

    def test_the_same_set_twice(self) -> None:
        sets = [(item.pattern, frames) for item, frames in self.capture_sets()]
        with pytest.raises(DecodeError, match="300 px along x stand twice in one group, and"):
            decode_phases(capture_of(*sets, extent=WIDTH))


class TestRefusals:
    def test_nothing_coded(self) -> None:
        scene = Scene(np.zeros((2, 2)), WIDTH)
        with pytest.raises(DecodeError, match="neither fringes nor a Gray code"):
            decode_capture(scene.capture(WHITE, BLACK, Uniform(0.5)))

    def test_one_axis_without_a_chain_leaves_the_other(self) -> None:
        scene = Scene(sweep(WIDTH, samples_per_px=1), WIDTH)
        coarse, fine = Fringe("x", 300.0, equal_shifts(4)), Fringe("y", 16.0, equal_shifts(4))
        decoding = decode_phases(scene.capture(coarse, fine))
        assert [axis.axis for axis in decoding.coded] == ["x"]
        assert [wrapped.fringe for wrapped, _ in decoding.relative] == [fine]
        coded = decoding.projector_map()
        assert coded.column is not None
        assert coded.row is None


class TestInvariance:
    SCENE = Scene(sweep(WIDTH, samples_per_px=1, rows=2), WIDTH, offset=20000.0,
                  modulation=15000.0, sensor=SENSOR_16)  # fmt: skip

    @given(count=st.integers(3, 8), gain=st.floats(0.2, 1.6), level=st.floats(-900, 2000))
    def test_gain_and_offset_leave_the_phase(self, count: int, gain: float, level: float) -> None:
        # Frames of 5000 to 35000: from 1000 - 900 to 56000 + 2000, below saturation at 64224.
        fringe = Fringe("x", 16.0, equal_shifts(count))
        frames = self.SCENE.frames(fringe)
        changed = gain * frames + level
        before = demodulate(frames, fringe, SENSOR_16)
        after = demodulate(np.rint(changed).astype(np.uint16), fringe, SENSOR_16)
        # Rounding by half a level in each frame: 2 / N * sum |sin| / 2 <= 1 / (gain B); and single
        # precision of sums of 65535, 4e-8 each.
        bound = 1 / (gain * 15000) + 1e-6
        turned = (after.phase - before.phase + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(turned).max() <= bound
        np.testing.assert_allclose(after.modulation, gain * before.modulation, atol=2)

    @given(turns=st.integers(-3, 3))
    def test_whole_turns_of_the_shifts_leave_the_phase(self, turns: int) -> None:
        frames = self.SCENE.frames(THREE)
        turned = dataclasses.replace(
            THREE, shifts_rad=tuple(s + 2 * np.pi * turns for s in THREE.shifts_rad)
        )
        before, after = (demodulate(frames, f, SENSOR_16) for f in (THREE, turned))
        difference = (after.phase - before.phase + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(difference).max() < 1e-6

    @given(shift=st.floats(-3, 3))
    def test_a_common_shift_moves_the_phase(self, shift: float) -> None:
        frames = self.SCENE.frames(FOUR)
        moved = dataclasses.replace(FOUR, shifts_rad=tuple(s + shift for s in FOUR.shifts_rad))
        before, after = (demodulate(frames, f, SENSOR_16) for f in (FOUR, moved))
        difference = (after.phase - before.phase - shift + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(difference).max() < 2e-6
