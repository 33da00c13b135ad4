"""Light by way of other surfaces: fringes with a known share of it, and the twin's corner."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.diagnose.interreflection import find_other_light
from fringeworks.model import Capture, Fringe, PatternSet, Sensor, Sequence, Void
from fringeworks.patterns import equal_shifts
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.demodulate import MaskRules

WIDTH, HEIGHT = 400, 200
BAND = (150, 250)
FINE, COARSE = (Fringe("x", period, equal_shifts(4)) for period in (24.0, 240.0))


def shows(*, share: float, psi_rad: float, blur_px: float = 1.0) -> Capture:
    """A slope under two periods; in a band of it coarse fringes have so much other light."""
    x = np.arange(WIDTH, dtype=float)
    coordinate = 20 + 0.4 * x
    rng = np.random.default_rng(2)
    stacks = []
    for fringe in (COARSE, FINE):
        phase = 2 * np.pi * (coordinate - fringe.zero_px) / fringe.period_px
        wave = np.exp(1j * phase - 2 * (np.pi * blur_px / fringe.period_px) ** 2)
        if fringe is COARSE:
            wave *= 1 + np.where((x >= BAND[0]) & (x < BAND[1]), share * np.exp(1j * psi_rad), 0)
        rows = [30_000 + 15_000 * (wave * np.exp(-1j * shift)).real for shift in fringe.shifts_rad]
        frames = np.array(rows)[:, None, :] + 200 * rng.standard_normal((4, HEIGHT, WIDTH))
        stacks.append(np.rint(frames).astype(np.uint16))
    sets = (PatternSet(COARSE), PatternSet(FINE))
    return Capture(Sequence(220, 100, sets), tuple(stacks), Sensor(65_535.0))


def lifted(capture: Capture) -> NDArray[np.bool_]:
    column = decode_capture(capture, rules=MaskRules(other_light=True)).column
    assert column is not None
    marked = column.void == Void.OTHER_LIGHT
    assert np.isnan(column.coordinate[marked]).all()
    return np.asarray(marked)


@pytest.mark.parametrize("psi_rad", [0.0, np.pi, np.pi / 2])
def test_other_light_is_found_whatever_its_phase(psi_rad: float) -> None:
    """In phase it changes the ratio, a quarter off the phase alone."""
    marked = lifted(shows(share=0.15, psi_rad=psi_rad))

    inner = slice(8, -8)  # the window, at the image's edge and at the step
    assert marked[inner, BAND[0] + 8 : BAND[1] - 8].mean() > 0.999
    assert marked[inner, : BAND[0] - 8].mean() < 0.001
    assert marked[inner, BAND[1] + 8 :].mean() < 0.001


@pytest.mark.parametrize("blur_px", [0.5, 4.0])
def test_blur_alone_is_not_other_light(blur_px: float) -> None:
    """Blur of 4 px leaves 24 px fringes 58 % of their modulation; all pixels alike."""
    assert not lifted(shows(share=0.0, psi_rad=0.0, blur_px=blur_px)).any()


def test_it_is_off_unless_asked_for() -> None:
    column = decode_capture(shows(share=0.15, psi_rad=0.0)).column
    assert column is not None
    assert not (column.void == Void.OTHER_LIGHT).any()


def test_check_names_it_with_its_share() -> None:
    capture = shows(share=0.15, psi_rad=0.0)
    (found,) = find_other_light(capture, decode_capture(capture))

    assert found.name == "other light"
    assert "along x" in found.message
    clean = shows(share=0.0, psi_rad=0.0)
    assert not list(find_other_light(clean, decode_capture(clean)))


def test_one_period_tells_nothing() -> None:
    both = shows(share=0.15, psi_rad=0.0)
    alone = replace(
        both,
        sequence=replace(both.sequence, sets=both.sequence.sets[:1]),
        frames=both.frames[:1],
    )
    assert not lifted(alone).any()


def test_numbers_of_reasons_stay() -> None:
    """They stand in files."""
    assert [int(rule) for rule in Void] == [0, 1, 2, 3, 4, 5]
