"""Ripple of the response (gamma): a wave of N periods per fringe that N steps leave in the phase.

The code that finds it is that of a calibration's boards (`calibrate.judge.ripple`); here the
surface is fitted tile by tile, since a scene is no board. Four steps and more cancel nearly all of
the ripple and show the second harmonic in their residual instead, where it costs pixels.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.judge.noticed import LARGEST_RESPONSE_RAD
from fringeworks.calibrate.judge.ripple import WAVES_PER_SPAN, fit_surface, strongest_wave
from fringeworks.diagnose.frame_errors import FrameErrors
from fringeworks.diagnose.look import Look
from fringeworks.diagnose.suspicion import Suspicion, lost_px
from fringeworks.diagnose.tiles import Tile
from fringeworks.model import CodedAxis, FloatMap

Array = NDArray[np.float64]

LEAST_TILES = 3
LEAST_HARMONIC = 0.03
"""Second harmonic over the first that four steps or more show: gamma 1.1 has 0.05."""

LEAST_EXPLAINED = 0.4
REMEDY = (
    "Switch gamma off in projector and camera (linear mode), avoid overexposure, or capture more "
    "steps (preset 'measure')."
)


def find_ripple(axis: CodedAxis, tiles: Sequence[Tile]) -> Iterator[Suspicion]:
    """A wave of as many periods per fringe as there are steps, in the coordinates of an axis."""
    if axis.phase is None or len(tiles) < LEAST_TILES:
        return
    fringe = axis.phase.wrapped.fringe
    coordinate, rest, left = _rest(axis, tiles)
    ripple = strongest_wave(fringe, coordinate, rest)
    if not ripple.harmonic or ripple.amplitude_rad < LARGEST_RESPONSE_RAD:
        return
    yield Suspicion(
        "gamma",
        ripple.amplitude_px / np.sqrt(2),
        f"the phase along {fringe.axis} ripples by {ripple.amplitude_rad:.2f} rad, {ripple.steps} "
        "waves per period: light is no straight line of the grey level (gamma), and so few steps "
        "do not cancel that.",
        REMEDY,
        f"fringes of {fringe.period_px:.4g} px along {fringe.axis}",
        left,
        "coordinate less a smooth surface, projector px",
    )


def tile_span(axis: CodedAxis) -> float:
    """Projector px that a tile must span for the ripple's waves to be told from the surface."""
    if axis.phase is None:
        return 0.0
    fringe = axis.phase.wrapped.fringe
    return WAVES_PER_SPAN * max(fringe.period_px / fringe.frame_count, 8.0)


def _rest(axis: CodedAxis, tiles: Sequence[Tile]) -> tuple[Array, Array, FloatMap]:
    """Coordinates and what each tile's surface leaves of them, and the same as a map."""
    left = np.full(axis.coordinate.shape, np.nan, np.float32)
    parts = []
    for tile in tiles:
        values = axis.coordinate[tile.y, tile.x].astype(np.float64)
        surface, used = fit_surface(np.column_stack([tile.x, tile.y]).astype(float), values)
        whole = axis.coordinate[tile.rows, tile.columns]
        left[tile.rows, tile.columns] = whole - surface.at(tile.places()).reshape(whole.shape)
        parts.append((values[used], left[tile.y, tile.x][used].astype(np.float64)))
    coordinate, rest = (np.concatenate(some) for some in zip(*parts, strict=True))
    return coordinate, rest, left


def find_harmonic(looks: Sequence[Look], errors: Mapping[int, FrameErrors]) -> Iterator[Suspicion]:
    """A second harmonic in the residual of four steps or more."""
    for look in looks:
        found = errors.get(look.place)
        if found is None or found.harmonic < LEAST_HARMONIC or found.by_harmonic < LEAST_EXPLAINED:
            continue
        rest = np.sqrt(np.mean(look.residual() ** 2, axis=0))
        noise = look.noise
        lost = float(np.mean(rest[look.lit] > 5 * noise))
        period = look.fringe.period_px
        yield Suspicion(
            "gamma",
            found.harmonic**2 * period / (2 * np.pi) + lost_px(lost, period),
            f"the frames of {look.name} have a second harmonic of {found.harmonic:.1%}: light is "
            "no straight line of the grey level (gamma). As many steps cancel most of it in the "
            f"phase; {lost:.0%} of the pixels fit no sinusoid for it.",
            REMEDY,
            look.where,
            np.where(look.lit, rest, np.nan).astype(np.float32),
            "grey levels that no sinusoid fits",
        )
