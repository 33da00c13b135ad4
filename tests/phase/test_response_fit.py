"""Responses found on the twin: gamma 2.2 under three steps, in focus and 60 mm out of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import DecodeError, UsageError
from fringeworks.model import Capture, GreyCurve, Response, Uniform
from fringeworks.phase.response import straighten
from fringeworks.phase.response_fit.find import choose_way, find_response
from fringeworks.phase.response_fit.levels import fit_curve
from tests.phase.responses import (
    GAMMA,
    PERIOD_PX,
    fringes,
    levels_sequence,
    ripple_mm,
    see,
    see_wall,
    three_steps,
)

IN_FOCUS, OUT_OF_FOCUS = 650.0, (590.0, 710.0)


@pytest.fixture(scope="module")
def levels() -> Capture:
    return see(levels_sequence())


@pytest.fixture(scope="module")
def curve(levels: Capture) -> GreyCurve:
    return fit_curve(levels)


@pytest.fixture(scope="module")
def by_steps() -> Response:
    return find_response(see(three_steps(fringes(PERIOD_PX, 8)), seed=5))


def test_the_curve_is_the_twins(curve: GreyCurve) -> None:
    """Flicker of 0.3 % moves each level's light; three of it are allowed, and white's own."""
    shown = np.array(curve.levels)
    assert np.abs(np.array(curve.light) - shown**GAMMA).max() < 3 * 0.003 * 2**0.5
    assert curve.harmonics[0] == pytest.approx((GAMMA - 1) / (GAMMA + 2), abs=0.004)
    assert len(curve.regions) == 9
    assert curve.uneven < 0.002  # the twin's gamma is the same all over
    assert max(map(abs, curve.left)) < 0.003


@pytest.mark.parametrize("z_mm", [IN_FOCUS, *OUT_OF_FOCUS])
def test_predistorted_patterns(curve: GreyCurve, z_mm: float) -> None:
    """Blur follows the projector: what has no harmonics keeps none at any depth."""
    seen = see_wall(three_steps(), z_mm, seed=7, curve=curve)
    assert ripple_mm(seen) <= 0.05


@pytest.mark.parametrize(
    ("z_mm", "bar_mm"), [(IN_FOCUS, 0.05), *((z_mm, 0.1) for z_mm in OUT_OF_FOCUS)]
)
def test_terms_found_in_focus(by_steps: Response, z_mm: float, bar_mm: float) -> None:
    assert by_steps.way == "steps"
    seen = see_wall(three_steps(), z_mm, seed=8)
    assert ripple_mm(seen) > 2.0
    assert ripple_mm(seen, by_steps) <= bar_mm


def test_terms_of_a_plane(by_steps: Response) -> None:
    """The smooth surface takes none of the waves: both ways find one error, to 1 %."""
    plane = find_response(see(three_steps(), seed=6), way="plane")
    assert isinstance(plane.correction, tuple)
    assert isinstance(by_steps.correction, tuple)
    assert plane.correction[0].sin == pytest.approx(by_steps.correction[0].sin, abs=0.003)


def test_terms_of_two_periods() -> None:
    """Blind: two periods of one scan, held against each other and nothing else."""
    sequence = three_steps(fringes(48.0, 3))
    found = find_response(see(sequence, seed=9), way="periods")
    assert isinstance(found.correction, tuple)
    assert all(item.after < 0.15 * item.before for item in found.correction)
    assert ripple_mm(see_wall(sequence, seed=10), found) <= 0.1


def test_waves_of_two_sets_that_coincide() -> None:
    """k waves of three steps per 32 px are as long as k of six per 64 px."""
    seen = see(three_steps(fringes(64.0, 6)))
    with pytest.raises(DecodeError, match="32 px and 64 px along x have waves of one length"):
        find_response(seen, way="periods")


def test_a_plane_that_is_none() -> None:
    seen = see(three_steps())
    rng = np.random.default_rng(1)
    shift = rng.integers(0, 12, seen.shape[0])  # every row sees the wall at another place
    frames = tuple(
        np.stack(
            [np.roll(row, places, axis=-1) for row, places in zip(rows, shift, strict=True)]
        ).swapaxes(0, 1)
        for rows in (stack.swapaxes(0, 1) for stack in seen.frames)
    )
    with pytest.raises(DecodeError, match="is the scene one plane"):
        find_response(replace(seen, frames=frames), way="plane")


@pytest.mark.parametrize(("z_mm", "bar_mm"), [(IN_FOCUS, 0.05), (min(OUT_OF_FOCUS), 0.1)])
def test_a_curved_camera(levels: Capture, z_mm: float, bar_mm: float) -> None:
    """The joint curve of both devices straightens what is seen, if not the light that is blurred.

    0.45 is what cameras do for a screen; against the projector's 2.2 it bends nearly all back.
    """
    joint = fit_curve(straighten(levels, 0.45))
    shown = see_wall(three_steps(), z_mm, seed=7, curve=joint)
    assert ripple_mm(replace(shown, capture=straighten(shown.capture, 0.45))) <= bar_mm


def test_what_auto_takes(levels: Capture) -> None:
    assert choose_way(levels) == "levels"
    with pytest.raises(DecodeError, match="does not tell the response by itself"):
        choose_way(see(three_steps()))


def test_levels_without_white(levels: Capture) -> None:
    places = [
        place
        for place, item in enumerate(levels.sequence.sets)
        if isinstance(item.pattern, Uniform) and item.pattern.level < 1
    ]
    sequence = replace(levels.sequence, sets=tuple(levels.sequence.sets[n] for n in places))
    dark = replace(levels, sequence=sequence, frames=tuple(levels.frames[n] for n in places))
    with pytest.raises(DecodeError, match=r"must show black \(level 0\) and white"):
        fit_curve(dark)


def test_levels_in_the_wrong_order(levels: Capture) -> None:
    frames = list(levels.frames)
    frames[20], frames[40] = frames[40], frames[20]
    with pytest.raises(DecodeError, match="light does not rise with the level"):
        fit_curve(replace(levels, frames=tuple(frames)))


def test_levels_of_several_exposures(levels: Capture) -> None:
    sets = levels.sequence.sets
    twice = tuple(replace(item, exposure_ms=time) for time in (5.0, 10.0) for item in sets)
    sequence = replace(levels.sequence, sets=twice)
    mixed = replace(levels, sequence=sequence, frames=(*levels.frames, *levels.frames))
    with pytest.raises(DecodeError, match="frames of several exposures"):
        find_response(mixed)


def test_an_unlit_scene_has_no_curve(levels: Capture) -> None:
    frames = tuple(np.minimum(stack, 20).astype(np.uint8) for stack in levels.frames)
    with pytest.raises(DecodeError, match="of the pixels are lit by the projector"):
        fit_curve(replace(levels, frames=frames))


def test_an_exponent_needs_true_phases(levels: Capture) -> None:
    with pytest.raises(UsageError, match="an exponent is found by gray or steps"):
        find_response(levels, exponent=True)


def test_nothing_to_use() -> None:
    with pytest.raises(DecodeError, match="nothing that the way 'periods' can use"):
        find_response(see(three_steps()), way="periods")
