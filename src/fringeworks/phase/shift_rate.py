"""By how much phase runs on from frame to frame, from the frames alone.

Four frames and more fit a sinusoid best with the rate that they had. Three always fit one; with a
wrong rate their visibility B / A gains waves of one and two periods per fringe, which no even light
has, and the rate is the one without them. (The response's own wave of three steps has three.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import Axis, Fringe, PatternSet, Sensor
from fringeworks.model.capture import Frames
from fringeworks.phase.demodulate import MaskRules, solve_shifts

Array: TypeAlias = NDArray[np.float64]

MOST_PIXELS = 5_000
LEAST_PIXELS = 500

KEPT_PERCENT = 90.0
"""Pixels of larger residuals look across edges, and do not decide."""

MOST_TURN = 0.12
MOST_TURNS_A_SET = 0.6
"""Of a turn, by which the phase may run on in a frame, and over a whole set: a turn over the set
makes all its shifts one."""

LEAST_RATE_RAD = 0.004
LEAST_OF_THREE_RAD = 0.01
"""Of the finest fringes per frame, for four steps or more and for three. Light that is uneven makes
still scenes of the twin seem to run by two thirds of the latter."""

LEAST_GAIN = 25.0
"""Chi-squared by which the rate must fit better than none."""

TRIES = 49
DEGREE = 5
"""Of the polynomial in the image's place that the log of visibility may follow."""


@dataclass(frozen=True, slots=True, eq=False)
class SetLook:
    """Lit pixels of one set of fringes.

    Attributes
    ----------
    frames
        ``(N, n)`` grey levels, means of repeats, black level off.
    modulation
        Median over the pixels, by the shifts as they should be.
    places
        ``(n, 2)`` (x, y) over the image's size.
    ages
        ``(N,)`` frames from the reference.
    slope
        Median step of the coordinate per camera px along the axis, projector px.
    """

    fringe: Fringe
    frames: Array
    modulation: float
    places: Array
    ages: Array
    slope: float


def look_at_set(
    stack: Frames, item: PatternSet, ages: Array, sensor: Sensor, *, rules: MaskRules
) -> SetLook:
    """The pixels of a fringe set that tell its rate.

    Raises
    ------
    DecodeError
        Too few pixels see fringes.
    """
    fringe = item.pattern
    assert isinstance(fringe, Fringe)
    frames = stack.reshape(fringe.frame_count, item.repeats, *stack.shape[1:])
    means = frames.mean(axis=1, dtype=np.float32) - np.float32(sensor.black_level)
    solution = solve_shifts(np.asarray(fringe.shifts_rad))
    offset, cosine, sine = np.tensordot(solution.solve, means, axes=1)
    modulation = np.hypot(cosine, sine)
    lit = modulation >= rules.least_modulation(sensor)
    lit &= (stack.max(axis=0) < sensor.saturation) & (modulation < offset)
    if np.count_nonzero(lit) < LEAST_PIXELS:
        raise DecodeError(
            f"motion cannot be told by fringes of {fringe.period_px:.4g} px along {fringe.axis}: "
            f"{np.count_nonzero(lit)} pixels see them, {LEAST_PIXELS} are needed. Look at the "
            "frames' exposure"
        )
    y, x = np.nonzero(lit)
    step = 1 + len(y) // MOST_PIXELS
    y, x = y[::step], x[::step]
    rest = means[:, y, x] - solution.basis @ (solution.solve @ means[:, y, x])
    size = np.sqrt(np.mean(rest**2, axis=0)) / modulation[y, x]
    kept = size <= np.percentile(size, KEPT_PERCENT)
    y, x = y[kept], x[kept]
    slope = _slope(np.arctan2(sine, cosine), lit, fringe)
    height, width = lit.shape
    places = np.column_stack([x / width - 0.5, y / height - 0.5])
    moments = ages.reshape(fringe.frame_count, -1).mean(axis=1)
    strength = float(np.median(modulation[y, x]))
    return SetLook(fringe, means[:, y, x].astype(np.float64), strength, places, moments, slope)


def _slope(phase: NDArray[np.floating], lit: NDArray[np.bool_], fringe: Fringe) -> float:
    axis = 1 if fringe.axis == "x" else 0
    both = lit[:, 1:] & lit[:, :-1] if axis else lit[1:] & lit[:-1]
    turns = np.angle(np.exp(1j * np.diff(phase, axis=axis)[both]))
    return float(np.median(turns)) * fringe.period_px / (2 * np.pi) if turns.size else 0.0


def coordinate_slope(looks: Sequence[SetLook]) -> float:
    """Projector px per camera px along the axis: of the finest fringes."""
    return min(looks, key=lambda look: look.fringe.period_px).slope


def find_rate(looks: Sequence[SetLook]) -> float:
    """Projector px per frame along the axis of these sets; 0 where none is certain."""
    from scipy.optimize import minimize_scalar

    finest = min(look.fringe.period_px for look in looks)
    tries = np.linspace(-1, 1, TRIES) * min(_most(look) for look in looks)
    costs = [_cost(looks, rate) for rate in tries]
    best = int(np.clip(np.argmin(costs), 1, TRIES - 2))
    bounds = (tries[best - 1], tries[best + 1])
    solved = minimize_scalar(
        lambda rate: _cost(looks, rate), bounds=bounds, method="bounded", options={"xatol": 1e-5}
    )
    rate = float(solved.x)
    gain = _cost(looks, 0.0) - float(solved.fun)
    of_three = all(len(look.frames) == 3 for look in looks)
    least = LEAST_OF_THREE_RAD if of_three else LEAST_RATE_RAD
    small = abs(rate) * 2 * np.pi / finest < least
    return 0.0 if small or gain < LEAST_GAIN else rate


def _most(look: SetLook) -> float:
    """Largest rate, projector px per frame, that is looked for."""
    span = float(np.ptp(look.ages)) * len(look.ages) / (len(look.ages) - 1)
    return look.fringe.period_px * min(MOST_TURN, MOST_TURNS_A_SET / max(span, 1e-9))


def _cost(looks: Sequence[SetLook], rate: float) -> float:
    """Chi-squared but for a constant, each set's noise by its own fit."""
    parts = [(look.frames.shape[1], _misfits(look, rate, whole=True)) for look in looks]
    return float(sum(count * np.log(np.mean(part**2) + 1e-12) for count, part in parts))


def misfit(looks: Sequence[SetLook], rates: Mapping[Axis, float]) -> float:
    """Rms over sets and pixels, as a share of the modulation."""
    parts = [_misfits(look, rates.get(look.fringe.axis, 0.0)) for look in looks]
    return float(np.sqrt(np.mean([np.mean(part**2) for part in parts])))


def _misfits(look: SetLook, rate: float, *, whole: bool = False) -> Array:
    """``(n,)`` misfit per pixel over modulation; `whole`: of three steps noise is in it."""
    shifts = np.asarray(look.fringe.shifts_rad)
    shifts = shifts - 2 * np.pi * rate / look.fringe.period_px * look.ages
    basis = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    parts = np.linalg.pinv(basis) @ look.frames
    freedom = len(shifts) - 3
    if freedom > 0:
        rest = look.frames - basis @ parts
        return np.asarray(np.sqrt(np.sum(rest**2, axis=0) / freedom) / look.modulation)
    return _waves(parts, look.places, whole=whole)


def _waves(parts: Array, places: Array, *, whole: bool) -> Array:
    """The part of log visibility that goes with the phase; or all but what goes with place."""
    offset, cosine, sine = parts
    phase = np.arctan2(sine, cosine)
    seen = np.log(np.hypot(cosine, sine) / np.maximum(offset, 1e-6))
    x, y = places.T
    even = np.column_stack([x**m * y**n for m in range(DEGREE + 1) for n in range(DEGREE + 1 - m)])
    if whole:
        return np.asarray(seen - even @ np.linalg.lstsq(even, seen, rcond=None)[0])
    waves = np.column_stack([f(k * phase) for k in (1, 2) for f in (np.cos, np.sin)])
    solved, *_ = np.linalg.lstsq(np.column_stack([even, waves]), seen, rcond=None)
    return np.asarray(waves @ solved[even.shape[1] :])
