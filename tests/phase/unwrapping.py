"""Phase that is hard to unwrap, with its true orders, and the peer that orders are held against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from fringeworks.model import Fringe, Noise, Void, WrappedPhase

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Orders = NDArray[np.int64]

TURN = 2 * np.pi
FRINGE = Fringe("x", 32.0, (TURN / 3, 0.0, -TURN / 3))
SHAPE = (90, 130)
ROW, COLUMN = np.mgrid[: SHAPE[0], : SHAPE[1]]


def wrap(phase: Array) -> Array:
    return np.asarray(phase - TURN * np.rint(phase / TURN))


def as_wrapped(
    phase: Array, *, sigma: float = 0.02, brightness: Array | None = None
) -> WrappedPhase:
    """A wrapped phase, NaN where void, with the maps that come with it."""
    shown = phase.astype(np.float32)
    level = np.ones(phase.shape) if brightness is None else brightness
    void = np.where(np.isnan(shown), Void.MODULATION, Void.VALID).astype(np.uint8)
    return WrappedPhase(
        fringe=FRINGE,
        phase=shown,
        offset=(100 * level).astype(np.float32),
        modulation=(50 * level).astype(np.float32),
        residual=np.full(phase.shape, np.nan, np.float32),
        sigma=np.where(np.isnan(shown), np.nan, sigma).astype(np.float32),
        noise=Noise(1.0, 0.0, 0.0, "camera"),
        void=void,
    )


@dataclass(frozen=True)
class Case:
    """A phase, the pixels that are valid, and those of them that have a true order."""

    phase: Array
    valid: Mask
    judged: Mask

    @property
    def wrapped(self) -> Array:
        return np.where(self.valid, wrap(self.phase), np.nan)

    @property
    def orders(self) -> Orders:
        return np.rint((self.phase - wrap(self.phase)) / TURN).astype(np.int64)

    def wrong(self, turns: NDArray[np.integer]) -> int:
        """Pixels off the commonest offset of their connected region."""
        regions, count = label(self.valid)
        off = turns - self.orders
        parts = [off[(regions == n) & self.judged] for n in range(1, count + 1)]
        return sum(
            part.size - int(np.unique(part, return_counts=True)[1].max(initial=0)) for part in parts
        )


def hill() -> Array:
    """Fringes over a hill, steps from -0.2 to 0.7 rad."""
    return np.asarray(
        0.25 * COLUMN + 0.03 * ROW + 8 * np.exp(-((COLUMN - 50) ** 2 + (ROW - 45) ** 2) / 500)
    )


def noisy(sigma: float) -> Callable[[np.random.Generator], Case]:
    def make(rng: np.random.Generator) -> Case:
        everywhere = np.ones(SHAPE, bool)
        return Case(hill() + rng.normal(0, sigma, SHAPE), everywhere, everywhere)

    return make


def torn(rng: np.random.Generator) -> Case:
    """A patch of nothing but noise."""
    case = noisy(0.2)(rng)
    patch = (abs(COLUMN - 70) < 16) & (abs(ROW - 40) < 14)
    anything = np.where(patch, rng.uniform(-np.pi, np.pi, SHAPE), case.phase)
    return replace(case, phase=anything, judged=~patch)


def masked(mask: Mask, sigma: float) -> Callable[[np.random.Generator], Case]:
    return lambda rng: replace(noisy(sigma)(rng), valid=mask, judged=mask)


RADIUS = np.hypot(COLUMN - 65, ROW - 45)
RING = (RADIUS < 42) & (RADIUS > 27)
ISLANDS = (COLUMN % 26 > 3) & (ROW % 30 > 3)
BRIDGES = ((COLUMN % 26 > 3) | (ROW % 30 == 15)) & ((ROW % 30 > 3) | (COLUMN % 52 == 30))

CASES: dict[str, Callable[[np.random.Generator], Case]] = {
    "noise 0.3": noisy(0.3),
    "noise 0.7": noisy(0.7),
    "noise 0.9": noisy(0.9),
    "torn patch": torn,
    "ring": masked(RING, 0.5),
    "noisy ring": masked(RING, 0.8),
    "islands": masked(ISLANDS, 0.5),
    "bridges of one pixel": masked(BRIDGES, 0.5),
}


def by_reliability(wrapped: Array) -> Orders:
    """Turns by sorting the edges by reliability (Herráez et al. 2002), plainly and slowly."""
    height, width = wrapped.shape
    index = np.arange(wrapped.size).reshape(height, width)
    rough = _second_differences(wrapped)
    first = np.concatenate([index[:, :-1].ravel(), index[:-1].ravel()])
    second = np.concatenate([index[:, 1:].ravel(), index[1:].ravel()])
    phase = wrapped.ravel()
    there = np.isfinite(phase[first] + phase[second])
    first, second = first[there], second[there]
    rise = -np.rint((phase[second] - phase[first]) / TURN).astype(int)
    turns, group = np.zeros(wrapped.size, np.int64), np.arange(wrapped.size)
    members = [[n] for n in range(wrapped.size)]
    for edge in np.argsort(rough.ravel()[first] + rough.ravel()[second], kind="stable"):
        a, b = first[edge], second[edge]
        if group[a] != group[b]:
            shift = turns[a] + rise[edge] - turns[b]
            if len(members[group[a]]) < len(members[group[b]]):
                a, b, shift = b, a, -shift
            moved, home = members[group[b]], group[a]
            members[home] = members[home] + moved
            turns[moved], group[moved] = turns[moved] + shift, home
    return turns.reshape(height, width)


def _second_differences(phase: Array) -> Array:
    """Root of the summed squares along both axes and both diagonals; large where one is missing."""
    ringed = np.pad(phase, 1, constant_values=np.nan)
    centre = ringed[1:-1, 1:-1]
    total = np.zeros_like(phase)
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        after = np.roll(ringed, (-down, -right), (0, 1))[1:-1, 1:-1]
        before = np.roll(ringed, (down, right), (0, 1))[1:-1, 1:-1]
        total += np.square(wrap(after - centre) - wrap(centre - before))
    return np.asarray(np.where(np.isnan(total), 100.0, np.sqrt(total)))
