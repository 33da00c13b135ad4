"""Waves in a board's decoded coordinates, which on a smooth surface should have none.

A smooth surface is fitted to each map over the board's bright parts. What is left is looked
through for a wave of the projector coordinate. A response that is no straight line leaves one of
N waves per period under N equal steps; an image that was resampled on its way to the panel leaves
one where the two pixel grids come into step.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.local_fit import robust_scale
from fringeworks.model import Axis, CodedAxis, Fringe, ProjectorMap

Array = NDArray[np.float64]

DEGREE = 4
MOST_PIXELS = 20_000
LEAST_PIXELS = 1_000
BRIGHT_SHARE = 0.5
OUTLIER_SIGMAS = 4.0
ROUNDS = 4
LONGEST_PX, SHORTEST_PX = 64.0, 3.0
WAVES_PER_SPAN = 4.0
"""Longer waves than a fourth of what the board spans go into the surface."""

HARMONIC_MATCH = 0.02
CELLS_PER_PX = 8
"""In which coordinates are counted: 24 per shortest wave."""


@dataclass(frozen=True, slots=True)
class Ripple:
    """The strongest wave in one axis's coordinates over a board.

    Attributes
    ----------
    period_px, amplitude_px
        Projector px.
    fringe_px
        Period of the fringes.
    steps
        Their shifts.
    """

    axis: Axis
    period_px: float
    amplitude_px: float
    fringe_px: float
    steps: int

    @property
    def amplitude_rad(self) -> float:
        """Of the phase."""
        return 2 * np.pi * self.amplitude_px / self.fringe_px

    @property
    def harmonic(self) -> bool:
        """Whether it is the wave that a curved response leaves under so many steps."""
        return abs(self.fringe_px / self.period_px / self.steps - 1) < HARMONIC_MATCH


def find_ripples(projector_map: ProjectorMap, corners: Array) -> tuple[Ripple, ...]:
    """The strongest wave of each axis that has fringes, inside the hull of corners ``(n, 2)``.

    An axis of too few bright pixels has none.
    """
    found = (_strongest(axis, corners) for axis in projector_map.axes)
    return tuple(ripple for ripple in found if ripple is not None)


def _strongest(axis: CodedAxis, corners: Array) -> Ripple | None:
    y, x = _bright(axis, corners)
    if axis.phase is None or len(x) < LEAST_PIXELS:
        return None
    coordinate = axis.coordinate[y, x].astype(np.float64)
    places = np.column_stack([x, y]).astype(np.float64)
    surface, used = fit_surface(places, coordinate)
    rest = coordinate - surface.at(places)
    return strongest_wave(axis.phase.wrapped.fringe, coordinate[used], rest[used])


def strongest_wave(fringe: Fringe, coordinate: Array, rest: Array) -> Ripple:
    """The strongest wave in what surfaces leave of coordinates, ``(n,)`` projector px each."""
    from scipy.fft import next_fast_len, rfft, rfftfreq

    span = float(np.ptp(coordinate))
    longest = min(LONGEST_PX, span / WAVES_PER_SPAN)
    cells = np.rint((coordinate - coordinate.min()) * CELLS_PER_PX).astype(np.intp)
    sums = np.bincount(cells, rest)
    count = next_fast_len(4 * len(sums), real=True)  # waves in steps of a quarter per span
    waves = rfftfreq(count, 1 / CELLS_PER_PX)
    use = (waves >= 1 / longest) & (waves <= 1 / SHORTEST_PX)
    exact = fringe.frame_count / fringe.period_px
    at_exact = sums @ np.exp(-2j * np.pi * exact * np.arange(len(sums)) / CELLS_PER_PX)
    waves = np.append(waves[use], exact)
    amplitudes = 2 * np.abs(np.append(rfft(sums, count)[use], at_exact)) / len(rest)
    amplitudes[-1] *= 1 + HARMONIC_MATCH  # of equals the one that has a cause
    best = int(np.argmax(amplitudes))
    return Ripple(
        axis=fringe.axis,
        period_px=float(1 / waves[best]),
        amplitude_px=float(amplitudes[best]),
        fringe_px=fringe.period_px,
        steps=fringe.frame_count,
    )


def _bright(axis: CodedAxis, corners: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of decoded bright pixels on the board, at most `MOST_PIXELS`."""
    board = np.zeros(axis.coordinate.shape, np.uint8)
    hull = cv2.convexHull(np.rint(corners).astype(np.int32).reshape(-1, 1, 2))
    cv2.fillConvexPoly(board, hull, 1)
    good = (board > 0) & np.isfinite(axis.coordinate)
    if good.any():
        good &= axis.modulation > BRIGHT_SHARE * np.percentile(axis.modulation[good], 90)
    y, x = np.nonzero(good)
    step = 1 + len(y) // MOST_PIXELS
    return y[::step], x[::step]


@dataclass(frozen=True, slots=True, eq=False)
class SmoothMap:
    """A polynomial of degree `DEGREE` over a part of an image, both coordinates -1 to 1 there."""

    low: Array
    high: Array
    coefficients: Array

    def at(self, places: Array) -> Array:
        """``(n,)`` its values at places ``(n, 2)``, px."""
        return _terms(places, self.low, self.high) @ self.coefficients


def fit_surface(places: Array, values: Array) -> tuple[SmoothMap, NDArray[np.bool_]]:
    """The polynomial through most of the values at places ``(n, 2)``, and which ones ``(n,)``."""
    low, high = places.min(axis=0), places.max(axis=0)
    design, used = _terms(places, low, high), np.ones(len(values), dtype=np.bool_)
    coefficients: Array = np.zeros(design.shape[1])
    for _ in range(ROUNDS):
        solved, *_ = np.linalg.lstsq(design[used], values[used], rcond=None)
        coefficients = np.asarray(solved, np.float64)
        rest = values - design @ coefficients
        used = np.abs(rest) < OUTLIER_SIGMAS * robust_scale(rest)
    return SmoothMap(low, high, coefficients), used


def _terms(places: Array, low: Array, high: Array) -> Array:
    x, y = ((2 * places - low - high) / (high - low)).T
    return np.stack([x ** (n - j) * y**j for n in range(DEGREE + 1) for j in range(n + 1)], axis=1)
