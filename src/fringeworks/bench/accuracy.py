"""Deterministic accuracy: phase noise, its prediction, fringe orders, the arctangent.

All draws come from one seed. A number is a property of the code, not of the machine, up to the
last bits of single precision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.bench.loops import angles
from fringeworks.bench.metric import Metric
from fringeworks.model import Capture, Frames, Fringe, PatternSet, Sensor, Sequence
from fringeworks.patterns.presets import equal_shifts, frequency_ladder
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.demodulate import demodulate

STEPS = (3, 4, 5, 8, 12)
SEED = 2
FULL_SCALE = 65535.0
OFFSET, MODULATION, NOISE = 30000.0, 16000.0, 320.0
"""Grey levels of 16 bits, so that rounding to whole ones does not count: its share is 4e-7."""

ORDER_RATIO = 17.0
ORDER_STEPS = 4
WIDTH = 1024


@dataclass(frozen=True, slots=True)
class Scale:
    """How much is drawn: rows of 1024 pixels, and angles of the arctangent."""

    rows: int
    angles: int


FULL, QUICK = Scale(1024, 4_000_000), Scale(256, 400_000)


def measure_accuracy(*, quick: bool = False) -> list[Metric]:
    """All accuracy metrics; from fewer draws where `quick`."""
    scale = QUICK if quick else FULL
    noise = [metric for steps in STEPS for metric in phase_noise(steps, rows=scale.rows)]
    return [*noise, *order_errors(rows=scale.rows), arctangent_error(scale.angles)]


def phase_noise(steps: int, *, rows: int) -> list[Metric]:
    """Observed spread of the phase over its Cramer-Rao bound, and predicted over observed.

    The bound is ``sqrt(2 / N) sigma_I / B`` (Rathjen 1995).
    """
    fringe = Fringe("x", 32.0, equal_shifts(steps))
    rng = np.random.default_rng([SEED, steps])
    frames = _frames(fringe, rows, noise=NOISE, rng=rng)
    wrapped = demodulate(frames, fringe, Sensor(FULL_SCALE))
    error = np.angle(np.exp(1j * (wrapped.phase.astype(np.float64) - _phase(fringe))))
    observed = float(np.sqrt(np.nanmean(np.square(error))))
    bound = math.sqrt(2 / steps) * NOISE / MODULATION
    predicted = float(np.nanmean(wrapped.sigma))
    chance = f"chance +- {1 / math.sqrt(2 * error.size):.1g}"
    key = f"accuracy.sigma_phi.{steps}_steps"
    source = f"noise from {'the residual' if steps > 3 else 'second differences'}"
    return [
        Metric(f"{key}.of_bound", observed / bound, "x", "one", f"bar 0.97 to 1.03; {chance}"),
        Metric(f"{key}.predicted", predicted / observed, "x", "one", f"bar 0.97 to 1.03; {source}"),
    ]


def order_errors(*, rows: int) -> list[Metric]:
    """Share of wrong orders on about 1, 8 and 64 fringes at B / sigma_I = 17, and share void."""
    fringes = [Fringe("x", period, equal_shifts(ORDER_STEPS)) for period in frequency_ladder(WIDTH)]
    rng = np.random.default_rng([SEED, 0])
    noise = MODULATION / ORDER_RATIO
    frames = tuple(_frames(fringe, rows, noise=noise, rng=rng) for fringe in fringes)
    sequence = Sequence(WIDTH, rows, tuple(PatternSet(fringe) for fringe in fringes))
    (axis,) = decode_phases(Capture(sequence, frames, Sensor(FULL_SCALE))).coded
    valid = np.isfinite(axis.coordinate)
    period = fringes[-1].period_px
    wrong = np.abs(axis.coordinate - np.arange(WIDTH)) > period / 2
    ladder = ", ".join(f"{fringe.period_px:g}" for fringe in fringes)
    what = f"periods {ladder} px on {WIDTH}, N = {ORDER_STEPS}, B / sigma = {ORDER_RATIO:g}"
    return [
        Metric(
            "accuracy.orders.wrong",
            float(np.mean(wrong[valid])),
            "share",
            "lower",
            f"bar 0; {what}",
        ),
        Metric("accuracy.orders.void", float(np.mean(~valid)), "share", "lower", "same captures"),
    ]


def arctangent_error(count: int) -> Metric:
    """Largest error of the kernels' arctangent over one turn, against float64."""
    rng = np.random.default_rng([SEED, 1])
    turn = np.linspace(-np.pi, np.pi, count)
    radius = np.exp(rng.uniform(-5, 10, count))
    y, x = (radius * np.sin(turn)).astype(np.float32), (radius * np.cos(turn)).astype(np.float32)
    out = np.empty(count, np.float32)
    angles(y, x, out)
    error = out - np.arctan2(y.astype(np.float64), x.astype(np.float64))
    error -= 2 * np.pi * np.rint(error / (2 * np.pi))  # pi is also called -pi
    largest = float(np.max(np.abs(error)))
    return Metric("accuracy.arctangent.max_error", largest, "rad", "lower", "bar <= 5e-7")


def _phase(fringe: Fringe) -> NDArray[np.float64]:
    """Absolute phase, rad, ``(W,)``, where projector columns are camera columns."""
    return np.array([fringe.phase_at(column) for column in range(WIDTH)])


def _frames(fringe: Fringe, rows: int, *, noise: float, rng: np.random.Generator) -> Frames:
    grey = [OFFSET + MODULATION * np.cos(_phase(fringe) - shift) for shift in fringe.shifts_rad]
    noisy = np.stack(grey)[:, np.newaxis] + rng.normal(0, noise, (len(grey), rows, WIDTH))
    return np.rint(noisy).astype(np.uint16)
