"""Responses of other people's projectors, against the figures in the captures' READMEs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.files import read_capture
from fringeworks.model import Capture, ImageExponent, Response
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.response import compensate, find_terms
from fringeworks.phase.response_fit.find import find_response
from fringeworks.phase.response_fit.seen import Seen, against, coordinate_of, see_by_gray, see_sets

Real = Callable[[str], Path]

GROUPS = {"exponent-0.75": (0.194, 0.035, 0.145), "exponent-1.25": (0.073, 0.025, 0.623)}
LIT_GREY = 60
"""White less black: the screen without its border, on which the README's figures are found."""


def rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture(scope="module", params=GROUPS)
def plane(real: Real, request: pytest.FixtureRequest) -> tuple[Capture, str]:
    return thin(read_capture(real("gamma-plane"), group=request.param)), request.param


def thin(capture: Capture) -> Capture:
    """Every third pixel along both sides: a ninth of the time, the same errors."""
    return replace(capture, frames=tuple(stack[:, ::3, ::3] for stack in capture.frames))


def errors_of(capture: Capture, response: Response) -> dict[str, tuple[float, float]]:
    """Per axis, rms error of the phase against the Gray code: as seen, and with the response."""
    white, black = capture.white(), capture.black()
    assert white is not None
    assert black is not None
    decoding = decode_phases(capture, response=response)
    phases = {axis.axis: axis.phase for axis in decoding.coded}
    found: dict[str, tuple[float, float]] = {}
    for seen in see_by_gray(capture):
        phase = phases[seen.fringe.axis]
        assert phase is not None
        now = Seen(phase.wrapped, seen.true).error()
        raw = seen.error()
        good = np.isfinite(now) & (white - black > LIT_GREY) & (np.abs(raw) < 0.5)
        assert np.mean(good) > 0.7
        found[seen.fringe.axis] = rms(raw[good]), rms(now[good])
    return found


@pytest.mark.parametrize("way", ["gray", "plane"])
def test_phase_terms(plane: tuple[Capture, str], way: str) -> None:
    capture, group = plane
    raw, bar, _ = GROUPS[group]
    response = find_response(capture, way="gray" if way == "gray" else "plane")
    for before, after in errors_of(capture, response).values():
        assert before == pytest.approx(raw, abs=0.003)  # the README's own: x and y differ by that
        assert after <= bar


def test_exponent(plane: tuple[Capture, str]) -> None:
    capture, group = plane
    raw, bar, exponent = GROUPS[group]
    response = find_response(capture, way="gray", exponent=True)
    assert isinstance(response.correction, ImageExponent)
    assert response.correction.exponent == pytest.approx(exponent, rel=0.03)
    for before, after in errors_of(capture, response).values():
        assert before == pytest.approx(raw, abs=0.003)
        assert after <= bar


def test_two_periods_of_the_mugs(real: Real) -> None:
    """Blind; the disagreement is worked out here anew from the corrected phases."""
    capture = thin(read_capture(real("psp3-gray-mugs")))
    response = find_response(capture)
    assert response.way == "periods"
    for axis in ("x", "y"):
        sets = see_sets(capture, axis)
        coordinate = coordinate_of(capture, axis)
        before = np.subtract(*(place(against(w, coordinate)) for w in sets))
        corrected = [
            compensate(w, terms) for w in sets if (terms := find_terms(response, w.fringe))
        ]
        after = np.subtract(*(place(against(w, coordinate)) for w in corrected))
        good = np.abs(before) < 30  # wrong orders
        assert np.count_nonzero(good) > 1.3e6 / 9
        assert np.median(np.abs(before[good])) == pytest.approx(4.2, abs=0.3)
        assert np.median(np.abs(after[good])) <= 1.0


def place(seen: Seen) -> NDArray[np.float64]:
    """A set's own coordinate, px, in the order of the finest."""
    return (seen.true + seen.error()) * seen.fringe.period_px / (2 * np.pi)
