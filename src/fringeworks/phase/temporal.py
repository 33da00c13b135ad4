"""Orders of fringes from coarser fringes, from beats, or from a coarse coordinate.

One formula unwraps every step, ``k = round((Phi_ref - phi) / 2 pi)``; methods differ in what
supplies Phi_ref. Here that is decided for a whole capture: the *carriers* are its fringe sets and
the beats between them (heterodyne), and a *chain* of carriers leads from what is known without
any phase (a Gray cell, or that the light came from inside the projector's image) to the finest
set. A single coarse set and its finer ones make the hierarchical method, a Gray code and one set
the classical one, and mixtures need no rule of their own.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fringeworks.errors import DecodeError
from fringeworks.kernels.orders import combine_phases, unwrap
from fringeworks.model import FloatMap, Fringe, WrappedPhase

PLANNED_SIGMA_RAD = 0.1
"""Error of each set's phase for which a chain is planned: ripple and noise together."""

LEAST_SAFETY = 0.5
"""Standard deviations of the planned error that a step must have: five where the phase is good to
0.01 rad. The margin of each pixel says how it went."""

MOST_SETS_FOR_SECOND_BEATS = 6
"""With more sets there are beats enough, and beats of beats by the thousand."""

WORTH_A_STEP = 0.8
"""One step more must make a chain safer by more than a quarter."""


@dataclass(frozen=True, slots=True)
class Carrier:
    """A wrapped phase with a period: ``sum weights[n] * phi_n`` over the fringe sets.

    A weight of one and zeros elsewhere is the set itself; (1, -1) is the beat of two.
    """

    weights: tuple[int, ...]
    period_px: float
    zero_px: float

    @property
    def is_beat(self) -> bool:
        return sum(map(abs, self.weights)) > 1

    @property
    def error_px(self) -> float:
        """Coordinate error at the planned phase error of its sets."""
        return self.period_px / (2 * math.pi) * PLANNED_SIGMA_RAD * math.hypot(*self.weights)

    def __str__(self) -> str:
        return f"{'beat' if self.is_beat else 'fringes'} of {self.period_px:.4g} px"


def make_carrier(fringes: Sequence[Fringe], weights: tuple[int, ...]) -> Carrier | None:
    """The carrier of these weights; None where the frequencies cancel or the sum is negative.

    The frequency is ``sum c_n / P_n``, and the phase is zero where ``sum c_n Phi_n`` is.
    """
    pairs = list(zip(weights, fringes, strict=True))
    frequency = sum(c / fringe.period_px for c, fringe in pairs)
    if frequency <= 1e-9:
        return None
    origin = sum(c * fringe.zero_px / fringe.period_px for c, fringe in pairs)
    return Carrier(weights, 1 / frequency, origin / frequency)


def find_carriers(fringes: Sequence[Fringe]) -> list[Carrier]:
    """The sets, their beats and the beats of two beats that share a set, longest period first.

    Beats of beats are made of at most six sets.
    """
    count = len(fringes)
    singles = [tuple(int(i == n) for i in range(count)) for n in range(count)]
    beats = _differences(singles)
    few = count <= MOST_SETS_FOR_SECOND_BEATS
    of_beats = [w for w in _differences(beats) if np.count_nonzero(w) <= 3] if few else []
    weights = dict.fromkeys([*singles, *beats, *of_beats])
    carriers = (make_carrier(fringes, item) for item in weights)
    return sorted((c for c in carriers if c), key=lambda c: (-c.period_px, c.is_beat))


def _differences(weights: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    return [
        tuple(a - b for a, b in zip(first, second, strict=True))
        for first, second in itertools.permutations(weights, 2)
    ]


def plan_chain(fringes: Sequence[Fringe], reach_px: float) -> tuple[Carrier, ...]:
    """The chain to the finest set whose weakest step is the safest.

    A step is safe by as many standard deviations as its target's half period exceeds the error
    of what it starts from. The first one starts from a coordinate that is wrong by at most
    `reach_px`; from then on errors are the carriers' noise. Of chains that are as safe because
    they begin alike, the one whose other steps are safer is taken, if it is worth its length.

    Raises
    ------
    DecodeError
        No chain reaches the finest set.
    """
    carriers = find_carriers(fringes)
    finest = min(range(len(fringes)), key=lambda n: fringes[n].period_px)
    goal = next(c for c in carriers if not c.is_beat and c.weights[finest])
    chains = _safest_chains(carriers, reach_px)
    if goal not in chains:
        raise DecodeError(_no_chain_message(carriers, goal, reach_px))
    return chains[goal]


@dataclass(frozen=True, slots=True)
class _Route:
    """A chain, how safe its first step is, and the weakest of the others."""

    first: float
    weakest: float
    chain: tuple[Carrier, ...]

    def safety(self) -> tuple[float, float]:
        """The weakest step; where the first one decides, the others, for which steps count."""
        return min(self.first, self.weakest), self.weakest * WORTH_A_STEP ** len(self.chain)


def _safest_chains(
    carriers: Sequence[Carrier], reach_px: float
) -> dict[Carrier, tuple[Carrier, ...]]:
    """The safest chain to each carrier that can be reached; `carriers` fall in period."""
    best: dict[Carrier, _Route] = {}
    for target in carriers:
        slack = target.period_px / 2 - reach_px
        routes: list[_Route] = []
        if slack > -1e-6:
            routes.append(_Route(slack / target.error_px, math.inf, (target,)))
        for source, route in best.items():
            step = _step_safety(source, target)
            if step > LEAST_SAFETY:
                weakest = min(route.weakest, step)
                routes.append(_Route(route.first, weakest, (*route.chain, target)))
        if routes:
            best[target] = max(routes, key=_Route.safety)
    return {target: route.chain for target, route in best.items()}


def _no_chain_message(carriers: Sequence[Carrier], goal: Carrier, reach_px: float) -> str:
    entry = _longest_way_in(carriers, goal)
    reached = _safest_chains(carriers, reach_px)
    if reached:
        last = min(reached, key=lambda carrier: carrier.error_px)
        known = f"the step from the {last} is too long"
        fringes = f"of a period between {entry.period_px:.4g} and {last.period_px:.4g} px"
    else:
        known = (
            f"what is known places a pixel within +-{reach_px:.4g} px, and the longest carrier "
            f"that leads to them is the {entry}"
        )
        fringes = f"(or two periods with a beat) longer than {2 * reach_px:.4g} px"
    return (
        f"the orders of the {goal} cannot be told: {known}. Add a Gray code with cells of "
        f"{entry.period_px:.4g} px or less, or fringes {fringes}"
    )


def _longest_way_in(carriers: Sequence[Carrier], goal: Carrier) -> Carrier:
    """The longest carrier from which steps lead to the goal; `carriers` fall in period."""
    leading = [goal]
    for source in reversed(carriers):
        if any(_step_safety(source, target) > LEAST_SAFETY for target in leading):
            leading.append(source)
    return max(leading, key=lambda carrier: carrier.period_px)


def _step_safety(source: Carrier, target: Carrier) -> float:
    """Standard deviations of the planned error that a step's target leaves."""
    return target.period_px / 2 / math.hypot(source.error_px, target.error_px)


def run_chain(
    wrapped: Sequence[WrappedPhase], chain: Sequence[Carrier], reference_px: FloatMap
) -> tuple[FloatMap, np.ndarray[tuple[int, ...], np.dtype[np.int32]], FloatMap]:
    """Coordinate (px), order and margin of the chain's last carrier.

    `reference_px` is what is known before any phase: ``(H, W)``, or ``(1, 1)`` for all pixels.
    The margin is the least of all steps. Void pixels are NaN, -1, NaN.
    """
    shape = wrapped[0].phase.shape
    least = np.ones(shape, np.float32)
    for carrier in chain:
        coordinate, margin = np.empty(shape, np.float32), np.empty(shape, np.float32)
        order = np.empty(shape, np.int32)
        phase = _phase_of(wrapped, carrier)
        unwrap(phase, reference_px, carrier.period_px, carrier.zero_px, coordinate, order, margin)
        np.minimum(least, margin, out=least)
        reference_px = coordinate
    return reference_px, order, least


def _phase_of(wrapped: Sequence[WrappedPhase], carrier: Carrier) -> FloatMap:
    used = [n for n, weight in enumerate(carrier.weights) if weight]
    if not carrier.is_beat:
        return wrapped[used[0]].phase
    combined = np.empty(wrapped[0].phase.shape, np.float32)
    stack = np.stack([wrapped[n].phase for n in used])
    combine_phases(stack, np.array([carrier.weights[n] for n in used], np.float64), combined)
    return combined
