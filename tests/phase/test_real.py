"""Real captures of other people, against their own decodes and the figures in their READMEs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.files.capture import read_capture
from fringeworks.model import Axis, Capture, CodedAxis, Fringe, Sequence, Void
from fringeworks.phase.decode import Decoding, decode_phases
from fringeworks.phase.demodulate import MaskRules, demodulate

Real = Callable[[str], Path]


def wrap(angle: NDArray[np.floating]) -> NDArray[np.floating]:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def without_fringes(capture: Capture) -> Capture:
    kept = [
        n for n, item in enumerate(capture.sequence.sets) if not isinstance(item.pattern, Fringe)
    ]
    old = capture.sequence
    sequence = Sequence(old.width, old.height, tuple(old.sets[n] for n in kept))
    return Capture(sequence, tuple(capture.frames[n] for n in kept), capture.sensor)


class TestMugs:
    """Two glossy mugs before a wall: three steps, periods of 66.67 and 100 px, Gray of 100 px."""

    @pytest.fixture(scope="class")
    @staticmethod
    def decoding(real: Real) -> Decoding:
        # As in the author's figures: modulation of five grey levels in every set.
        rules = MaskRules(modulation_share=5 / 255)
        return decode_phases(read_capture(real("psp3-gray-mugs")), rules=rules)

    @pytest.mark.parametrize(("n", "axis", "bar"), [(0, "x", 0.005), (1, "y", 0.001)])
    def test_against_the_authors_decode(
        self, decoding: Decoding, real: Real, n: int, axis: Axis, bar: float
    ) -> None:
        coded = decoding.coded[n]
        assert coded.axis == axis
        picture = cv2.imread(str(real("psp3-gray-mugs") / "vizualized.png"))
        assert picture is not None
        blue_green, red = picture[..., n].astype(float), picture[..., 2]
        # floor(coordinate) mod 256, where red is 128; 0.5 is the mean that flooring took away.
        overlap = (red == 128) & np.isfinite(coded.coordinate)
        assert np.count_nonzero(overlap) >= 1.3e6
        off = (coded.coordinate - blue_green - 0.5 + 128)[overlap] % 256 - 128
        assert np.mean(np.abs(off) > 2) <= bar
        assert abs(np.median(off)) < 0.05

    def test_chain(self, decoding: Decoding) -> None:
        chain = ("beat of 200 px", "fringes of 100 px", "fringes of 66.67 px")
        for coded in decoding.coded:
            assert coded.route == ("Gray code of 100 px cells", *chain)
            assert coded.phase is not None
            assert coded.phase.wrapped.noise.source == "high-pass"

    def test_range(self, decoding: Decoding) -> None:
        # Of all valid pixels; the README's 112..1688 and 68..1052 px are of a wider mask.
        for coded, (low, high) in zip(decoding.coded, ((112, 1688), (68, 1052)), strict=True):
            found = np.nanquantile(coded.coordinate, [0.01, 0.99])
            np.testing.assert_allclose(found, [low, high], atol=25)


class TestGamma:
    """A flat screen: phase error of three steps against Gray cells of 2 px."""

    @pytest.mark.parametrize(
        ("group", "rms"),
        [("exponent-0.75", {"x": 0.194, "y": 0.195}), ("exponent-1.25", {"x": 0.073, "y": 0.075})],
    )
    def test_raw_phase_error(self, real: Real, group: str, rms: dict[str, float]) -> None:
        capture = read_capture(real("gamma-plane"), group=group)
        codes: dict[Axis, CodedAxis] = {
            coded.axis: coded for coded in decode_phases(without_fringes(capture)).coded
        }
        assert set(codes) == {"x", "y"}
        for fringe, frames, _ in capture.find(Fringe):
            coded = codes[fringe.axis]
            assert coded.phase is None
            # The centre of a cell of 2 px: 2 * index + 0.5, as the README says.
            assert set(np.unique(coded.coordinate[np.isfinite(coded.coordinate)] % 2)) == {0.5}
            phase = demodulate(frames, fringe, capture.sensor).phase
            error = wrap(phase - 2 * np.pi * coded.coordinate / 240)
            assert np.mean(np.isfinite(error)) > 0.7
            found = float(np.sqrt(np.nanmean(np.square(error))))
            assert found == pytest.approx(rms[fringe.axis], rel=0.05)


class TestDome:
    """Four steps, JPEG, and nothing that tells orders."""

    @pytest.fixture(scope="class")
    @staticmethod
    def capture(real: Real) -> Capture:
        return read_capture(real("fourstep-dome"))

    def test_orders_are_refused_with_a_reason(self, capture: Capture) -> None:
        decoding = decode_phases(capture)
        assert not decoding.coded
        ((_, reason),) = decoding.relative
        assert "the orders of the fringes of 32 px cannot be told" in reason
        assert "Add a Gray code with cells of 32 px or less" in reason

    def test_phase_and_modulation(self, capture: Capture) -> None:
        ((wrapped, _),) = decode_phases(capture).relative
        assert np.median(wrapped.modulation) == pytest.approx(34.5, rel=0.01)
        i0, i90, i180, i270 = capture.frames[0].astype(float)
        good = wrapped.void == Void.VALID
        assert np.mean(good) > 0.9
        error = wrap(wrapped.phase - np.arctan2(i90 - i270, i0 - i180))
        assert np.abs(error[good]).max() <= 1e-6  # the arctangent's 5e-7, and sums of four frames
        assert np.isnan(wrapped.phase[~good]).all()
        # All that a sinusoid leaves of four steps is (I0 + I180 - I90 - I270) / 2.
        left = np.abs(i0 + i180 - i90 - i270) / 2
        np.testing.assert_allclose(wrapped.residual, left, atol=1e-3)
