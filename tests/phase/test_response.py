"""Responses applied: closed forms of gamma, and what may be applied to what."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.errors import UsageError
from fringeworks.model import (
    Capture,
    Fringe,
    GreyCurve,
    ImageExponent,
    PatternSet,
    PhaseTerms,
    Response,
    Sensor,
    Sequence,
    Void,
)
from fringeworks.patterns import equal_shifts, render
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.demodulate import demodulate
from fringeworks.phase.response import (
    PREDISTORTED,
    choose_response,
    compensate,
    notice_response,
    straighten,
    terms_of_curve,
)
from fringeworks.phase.response_fit.levels import harmonics_of

LEVELS = np.linspace(0, 1, 129)


def power(gamma: float) -> GreyCurve:
    return GreyCurve(tuple(LEVELS.tolist()), tuple((LEVELS**gamma).tolist()))


def terms(fringe: Fringe, *sine: float) -> PhaseTerms:
    zero = (0.0,) * len(sine)
    return PhaseTerms(fringe.axis, fringe.period_px, fringe.shifts_rad, zero, sine)


def bent_frames(fringe: Fringe, gamma: float, width: int = 720) -> Capture:
    """Sixteen-bit frames of one fringe over the image, by a light that is a power of the level."""
    phase = 2 * np.pi * np.arange(width) / width - np.pi
    shifts = np.array(fringe.shifts_rad)[:, np.newaxis]
    light = ((1 + np.cos(phase - shifts)) / 2) ** gamma
    frames = np.rint(40_000 * light + 2_000).astype(np.uint16)
    stack = np.repeat(frames[:, np.newaxis], 8, axis=1)
    return Capture(Sequence(width, 8, (PatternSet(fringe),)), (stack,), Sensor(65_535.0))


def known(correction: GreyCurve | ImageExponent | tuple[PhaseTerms, ...]) -> Response:
    """A response of the projector of `bent_frames`."""
    return Response("gray", "a", correction, width=720, height=8)


FRINGE = Fringe("x", 720.0, equal_shifts(3), zero_px=360.0)


@pytest.mark.parametrize("gamma", [1.4, 1.8, 2.2])
def test_harmonics_of_gamma(gamma: float) -> None:
    """``cos^(2 gamma)(phi / 2)`` has a2/a1 = (g - 1)/(g + 2), a3/a1 = that (g - 2)/(g + 3).

    A cubic between 129 levels is off by less than 1e-4 near black, where a power's bends are.
    """
    second = (gamma - 1) / (gamma + 2)
    found = harmonics_of(power(gamma))
    assert found == pytest.approx((second, second * (gamma - 2) / (gamma + 3)), abs=1e-4)


def test_terms_of_a_curve_take_its_error() -> None:
    """Four terms leave 4 % of the peak error of gamma 2.2 under three steps: 0.286 rad."""
    capture = bent_frames(FRINGE, 2.2)
    seen = demodulate(capture.frames[0], FRINGE, capture.sensor)
    true = (np.arange(720) * 2 * np.pi / 720 - np.pi)[np.newaxis]
    raw = np.angle(np.exp(1j * (seen.phase - true)))
    assert np.abs(raw).max() == pytest.approx(0.29, abs=0.02)
    left = compensate(seen, terms_of_curve(power(2.2), FRINGE)).phase - true
    assert np.abs(np.angle(np.exp(1j * left))).max() < 0.04 * np.abs(raw).max() * 1.5


def test_many_steps_have_no_error_of_gamma() -> None:
    found = terms_of_curve(power(2.2), replace(FRINGE, shifts_rad=equal_shifts(12)))
    assert found.before < 1e-4  # harmonics 11 and 13 of gamma 2.2


@given(shift=st.floats(-3, 3), first=st.floats(-0.2, 0.2), second=st.floats(-0.05, 0.05))
def test_slope_is_the_derivative(shift: float, first: float, second: float) -> None:
    """Central differences of 1e-5 are right to 1e-8 for waves of at most six per turn."""
    found = terms(FRINGE, first, second)
    at, step = np.array([shift]), 1e-5
    _, slope = found.error_at(at)
    high, low = found.error_at(at + step)[0], found.error_at(at - step)[0]
    assert slope[0] == pytest.approx(((high - low) / (2 * step))[0], abs=1e-7)


def test_sigma_follows_the_slope() -> None:
    seen = demodulate(bent_frames(FRINGE, 1.0).frames[0], FRINGE, Sensor(65_535.0))
    found = terms(FRINGE, 0.1)
    middle = np.argmin(np.abs(seen.phase[0]))
    gain = compensate(seen, found).sigma[0, middle] / seen.sigma[0, middle]
    assert gain == pytest.approx(1 - 3 * 0.1, rel=1e-3)  # d/dphi of 0.1 sin 3 phi at zero


@pytest.mark.parametrize("bits", [8, 16])
def test_predistorted_levels_make_the_light(bits: int) -> None:
    """Half a level, through the slope of the curve, 2.2 at most, beside an ulp of the inverse."""
    fringe = Fringe("x", 32.0, equal_shifts(3))
    full = 2**bits - 1
    shown = render(fringe, width=64, height=2, bits=bits, curve=power(2.2)) / full
    plain = render(fringe, width=64, height=2, bits=16) / 65_535
    assert np.abs(shown**2.2 - plain).max() < 2.2 * 0.5 / full + 2e-4


def test_straightened_frames_keep_what_is_saturated() -> None:
    fringe = replace(FRINGE, period_px=16.0)
    levels = np.arange(240, 256, dtype=np.uint8)
    stack = np.broadcast_to(levels, (3, 1, 16)).copy()
    capture = Capture(Sequence(16, 1, (PatternSet(fringe),)), (stack,), Sensor(255.0))
    done = straighten(capture, 0.145)
    before = stack[0, 0] >= capture.sensor.saturation
    assert ((done.frames[0][0, 0] >= done.sensor.saturation) == before).all()
    assert 0 < np.count_nonzero(before) < 16


def test_an_exponent_takes_gamma_away() -> None:
    """Exact but for rounding: the frames' black is subtracted first."""
    capture = bent_frames(FRINGE, 2.2)
    sensor = Sensor(65_535.0, black_level=2_000.0)
    capture = replace(capture, sensor=sensor)
    response = known(ImageExponent(1 / 2.2, 0.2, 0.0))
    decoding = decode_phases(capture, response=response)
    seen = decoding.coded[0].phase if decoding.coded else None
    wrapped = seen.wrapped if seen is not None else decoding.relative[0][0]
    true = (np.arange(720) * 2 * np.pi / 720 - np.pi)[np.newaxis]
    left = np.angle(np.exp(1j * (wrapped.phase - true)))
    rounded = (0.5 / 63_535) ** (1 / 2.2)  # half a level at black, straightened
    modulation = (40_000 / 63_535) ** (1 / 2.2) / 2
    assert np.nanmax(np.abs(left)) < 2 / 3 * rounded / modulation


def test_raw_voids_stay() -> None:
    """Black frames with one level of noise get a modulation by the power, and no phase."""
    fringe = replace(FRINGE, period_px=16.0)
    rng = np.random.default_rng(0)
    stack = rng.integers(0, 2, (3, 32, 32)).astype(np.uint8)
    capture = Capture(Sequence(720, 8, (PatternSet(fringe),)), (stack,), Sensor(255.0))
    response = known(ImageExponent(0.145, 0.2, 0.0))
    decoding = decode_phases(capture, response=response)
    wrapped = decoding.relative[0][0] if decoding.relative else None
    void = wrapped.void if wrapped is not None else decoding.coded[0].void
    assert (void != Void.VALID).all()


class TestChoice:
    """Which response serves: the one asked for or an error, the rig's where it fits."""

    capture = bent_frames(FRINGE, 1.0)
    fits = known((terms(FRINGE, 0.1),))
    other = known((terms(replace(FRINGE, period_px=31.0), 0.1),))
    curve = known(power(2.2))

    def test_asked_before_kept(self) -> None:
        assert choose_response(self.capture, self.fits, self.curve) is self.fits
        assert choose_response(self.capture, None, self.curve) is self.curve
        assert choose_response(self.capture, None, self.other) is None
        assert choose_response(self.capture, None, None) is None

    def test_terms_for_other_fringes(self) -> None:
        with pytest.raises(UsageError, match="no terms for fringes of 720 px along x of 3 steps"):
            choose_response(self.capture, self.other, None)

    @pytest.mark.parametrize("response", [curve, fits, known(ImageExponent(0.5, 0.2, 0.0))])
    def test_bent_patterns_are_not_corrected_twice(self, response: Response) -> None:
        bent = replace(self.capture, provenance={PREDISTORTED: "the response of c"})
        with pytest.raises(UsageError, match="shown with patterns pre-distorted by the response"):
            choose_response(bent, response, None)
        assert choose_response(bent, None, response) is None
        (note,) = notice_response(bent, None, response)
        assert "the rig's response was not used: " in str(note)

    def test_what_bent_patterns_leave_is_theirs(self) -> None:
        bent = replace(self.capture, provenance={PREDISTORTED: "the response of c"})
        left = replace(self.fits, predistorted_by="the response of c")
        assert choose_response(bent, left, None) is left
        with pytest.raises(UsageError, match="was shown with plain patterns"):
            choose_response(self.capture, left, None)

    def test_another_projector(self) -> None:
        wide = replace(self.fits, width=1920)
        with pytest.raises(UsageError, match="1920x8 px, this one has 720x8"):
            choose_response(self.capture, wide, None)
        assert choose_response(self.capture, None, wide) is None

    def test_shifts_count_by_whole_turns(self) -> None:
        turned = replace(FRINGE, shifts_rad=tuple(s + 2 * math.pi for s in FRINGE.shifts_rad))
        assert choose_response(self.capture, known((terms(turned, 0.1),)), None)
        backwards = replace(FRINGE, shifts_rad=FRINGE.shifts_rad[::-1])
        with pytest.raises(UsageError):
            choose_response(self.capture, known((terms(backwards, 0.1),)), None)

    def test_says_what_was_used(self) -> None:
        (note,) = notice_response(self.capture, self.fits)
        assert "response by phase terms, found by gray in a, was used" in str(note)
        assert not list(notice_response(self.capture, None))
