"""Which exposures see a scene: each pixel has a shortest and a longest one.

At f times the exposure of the test a pixel's brightest frame has f times its grey levels above
black, and its fringes f times their modulation. The longest f keeps the brightest frame below
saturation, the shortest makes the modulation reach what decoding asks for (8 of 255 grey levels and
five sigma). A ladder covers the pixels for which one of its rungs lies between the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.look import LIT_SHARE, Look
from fringeworks.model import Capture, FloatMap, Sensor

Array = NDArray[np.float64]

WANTED_COVERAGE = 0.98
MOST_RUNGS = 4
MOST_EQUALS = 500
COVERAGE_STEPS = 500
"""Exposures whose coverage agrees to so many parts are equals."""

MOST_PIXELS = 4000

HEADROOM = 0.95
"""Share of the saturation that the brightest frame may reach: lamps and mains are unsteady."""

MODULATION_MARGIN = 1.1
MODULATION_SIGMAS = 5.0
LIT_SIGMAS = 3.0
LEAST_LIT_SHARE = 0.004
"""Modulation over full scale, median of nine pixels, below which no fringes fall on a pixel."""

USUAL_NOISE_SHARE = 0.005
"""Of full scale: a hundred electrons of ten thousand and the rest of the electronics."""

FACTORS = 2.0 ** (np.arange(-18, 19) / 3)
"""Of the test's exposure: 1/64 to 64 in thirds of a stop."""


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """What each pixel stands.

    Attributes
    ----------
    lit
        ``(H, W)``: fringes fall on it, be they too faint to be decoded.
    modulation
        ``(H, W)`` grey levels, of the coarsest fringes in the test.
    shortest, longest
        ``(H, W)`` factors of the test's exposure. Where fewer than three frames of the test are
        unsaturated nobody knows: `longest` is then below the shortest factor that is proposed.
    """

    lit: NDArray[np.bool_]
    modulation: FloatMap
    shortest: FloatMap
    longest: FloatMap

    def covered_by(self, factors: Sequence[float]) -> float:
        """Share of the lit pixels that one of these exposures sees."""
        if not self.lit.any():
            return 0.0
        seen = np.zeros(self.lit.shape, bool)
        for factor in factors:
            seen |= (self.shortest <= factor) & (factor <= self.longest)
        return float(np.mean(seen[self.lit]))


@dataclass(frozen=True, slots=True)
class Ladder:
    """Exposures, short to long.

    Attributes
    ----------
    factors
        Of the test's exposure.
    exposures_ms
        The same in ms, where the test's exposure is known; else empty.
    coverage
        Share of the lit pixels that it sees.
    covered_before
        The same of the test's own exposure.
    in_step
        Whether every exposure is a whole number of the mains' half periods.
    """

    factors: tuple[float, ...]
    exposures_ms: tuple[float, ...]
    coverage: float
    covered_before: float
    in_step: bool


def find_reach(capture: Capture, coarse: Look, *, transfer: float) -> Reach:
    """What each pixel stands, by the coarsest fringes.

    `transfer` is what fringes of the period that will be used keep of the modulation.
    """
    import cv2

    sensor = capture.sensor
    offset, modulation, known = _unclipped(coarse, sensor.saturation)
    steps, noise = coarse.fringe.frame_count, noise_of(coarse, sensor)
    least_lit = max(LIT_SIGMAS * noise * math.sqrt(2 / steps), LEAST_LIT_SHARE * sensor.full_scale)
    smooth = np.asarray(cv2.medianBlur(modulation.astype(np.float32), 3))
    lit = (smooth > least_lit) | ~known
    wanted = max(LIT_SHARE * sensor.full_scale, MODULATION_SIGMAS * noise) * MODULATION_MARGIN
    shortest = wanted / np.maximum(modulation * transfer, 1e-6)
    bright = np.maximum(offset + modulation - sensor.black_level, 1e-6)
    longest = HEADROOM * (sensor.saturation - sensor.black_level) / bright
    longest = np.where(known, longest, 0.0)
    return Reach(lit, modulation, shortest.astype(np.float32), longest.astype(np.float32))


def noise_of(look: Look, sensor: Sensor) -> float:
    """Noise of one frame, grey levels; a usual camera's where too few pixels are unclipped."""
    return look.noise if look.enough else USUAL_NOISE_SHARE * sensor.full_scale


def choose_ladder(
    reach: Reach, *, exposure_ms: float | None, half_period_ms: float | None = None
) -> Ladder:
    """The fewest exposures that see enough; of so many the ones that see most, with most light.

    With `half_period_ms`, the mains', all are whole numbers of it; where that is too bright, so
    that too few pixels are seen, shorter ones are taken besides.
    """
    factors, in_step = FACTORS, False
    if exposure_ms is not None and half_period_ms is not None:
        unit = half_period_ms / exposure_ms
        factors = unit * np.unique(np.rint(2.0 ** (np.arange(19) / 3)))
        in_step = True
    chosen = _fewest(reach, factors)
    if in_step and reach.covered_by(chosen) < WANTED_COVERAGE:
        shorter = factors[0] * 2.0 ** (np.arange(-12, 0) / 2)
        chosen = _fewest(reach, np.concatenate([shorter, factors]))
        in_step = bool(chosen) and bool(min(chosen) >= factors[0])
    if exposure_ms is not None and not in_step:
        chosen = tuple(_round(factor * exposure_ms) / exposure_ms for factor in chosen)
    return Ladder(
        chosen,
        () if exposure_ms is None else tuple(_round(f * exposure_ms) for f in chosen),
        reach.covered_by(chosen),
        reach.covered_by((1.0,)),
        in_step,
    )


def _fewest(reach: Reach, factors: Array) -> tuple[float, ...]:
    """Of one to four factors the first set that sees enough; else the set that sees most."""
    y, x = np.nonzero(reach.lit)
    step = 1 + len(y) // MOST_PIXELS
    y, x = y[::step], x[::step]
    seen = (reach.shortest[y, x] <= factors[:, None]) & (factors[:, None] <= reach.longest[y, x])
    useful = [row for row in range(len(factors)) if seen[row].any()]
    best: tuple[int, ...] = ()
    for count in range(1, MOST_RUNGS + 1):
        best = _best(seen, useful, count) or best
        if np.mean(seen[list(best)].any(axis=0)) >= WANTED_COVERAGE:
            break
    return tuple(float(factors[row]) for row in best)


def _best(seen: NDArray[np.bool_], useful: Sequence[int], count: int) -> tuple[int, ...]:
    """Of all sets of so many rows the one that sees most, of equals the one with most light."""
    if len(useful) < count:
        return ()
    packed = {row: np.packbits(seen[row]) for row in useful}
    rated: dict[int, list[tuple[int, ...]]] = {}
    for rows in combinations(useful, count):
        covered = np.bitwise_count(np.bitwise_or.reduce([packed[row] for row in rows])).sum()
        rated.setdefault(int(covered * COVERAGE_STEPS / seen.shape[1]), []).append(rows)
    equals = rated[max(rated)]
    return max(equals[:: 1 + len(equals) // MOST_EQUALS], key=lambda rows: _light(seen, rows))


def _light(seen: NDArray[np.bool_], rows: Sequence[int]) -> tuple[float, int]:
    """Mean over the pixels of the longest row that sees them; of equals the shorter rows."""
    brightest = np.zeros(seen.shape[1])
    for row in sorted(rows):
        brightest[seen[row]] = row
    return float(np.mean(brightest)), -sum(rows)


def _unclipped(look: Look, saturation: float) -> tuple[FloatMap, FloatMap, NDArray[np.bool_]]:
    """Offset, modulation, and where they are known: by the frames that are not saturated."""
    offset, modulation = look.offset.copy(), look.modulation.copy()
    clear = look.frames < saturation
    left = clear.sum(axis=0)
    y, x = np.nonzero((left < len(look.frames)) & (left >= 3))
    shifts = np.asarray(look.fringe.shifts_rad)
    basis = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    used = clear[:, y, x].T
    normal = np.einsum("pn,ni,nj->pij", used.astype(float), basis, basis)
    right = np.einsum("pn,ni->pi", used * look.frames[:, y, x].T, basis)
    solved = np.linalg.solve(normal, right[..., None])[..., 0] if len(y) else right
    offset[y, x] = solved[:, 0]
    modulation[y, x] = np.hypot(solved[:, 1], solved[:, 2])
    return offset, modulation, left >= 3


def _round(value: float) -> float:
    """Three digits: an exposure that a person can type."""
    return float(f"{value:.3g}")
