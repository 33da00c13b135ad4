"""Spatial unwrapping: from one set of fringes to a phase that is continuous inside regions.

Rows are cut into runs, and runs are joined into regions along the links between rows. Where every
loop closes, round four pixels and round holes alike, all paths give the same phase. One open loop
can spoil a tenth of an image, so where there is any, links are taken in the order of what it
costs to trust them, the cheapest first, as in the sorting by reliability of Herráez et al. (2002):
what contradicts cheaper links is where the surface, or the noise, is torn. A flood from the best
pixel with a queue of that order gives the same tree.

The cost is not theirs. They take second differences of the phase; we take the distance of a step
from the mean of the steps round about, plus the mean of such distances at both its pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels import links
from fringeworks.kernels.spatial import settle, unwrap_runs
from fringeworks.model import FloatMap, UnwrappedPhase, WrappedPhase
from fringeworks.model.phase import OrderMap

Marks = NDArray[np.uint8]
"""Bits of `kernels.spatial` per pixel: its link from the left, its link from above."""

SURE_SHARES = (0.95, 0.85, 0.7, 0.5, 0.3)
"""Shares of the links, the cheapest, that are tried without an order: where they agree among each
other it does not matter, and only the dearer ones need be sorted."""


@dataclass(frozen=True, slots=True)
class Joining:
    """What the kernels write: turns and run of each pixel ``(H, W)``, and the runs' tree."""

    turns: OrderMap
    run: OrderMap
    tree: OrderMap

    @classmethod
    def of(cls, shape: tuple[int, ...]) -> Joining:
        tree = np.empty((2, int(np.prod(shape))), np.int32)
        return cls(np.empty(shape, np.int32), np.empty(shape, np.int32), tree)

    @property
    def maps(self) -> tuple[OrderMap, OrderMap, OrderMap]:
        return self.turns, self.run, self.tree


def unwrap_spatial(wrapped: WrappedPhase) -> UnwrappedPhase:
    """Unwrap each connected region of valid pixels, four neighbours to a pixel.

    It never fails, but a wrapped phase does not show a jump of a whole number of turns: in a
    region that holds two surfaces the phase is continuous and the fringe order is not
    (`find_regions` is for that). And where noise exceeds 0.7 rad some steps are beyond telling.

    Parameters
    ----------
    wrapped
        NaN pixels are void and hold no region together.

    Returns
    -------
    Turns and regions; `residues`, `open_loops` and `torn_links` say how it went.
    """
    return unwrap_links(wrapped, np.zeros(wrapped.phase.shape, np.uint8))


def unwrap_links(wrapped: WrappedPhase, broken: Marks) -> UnwrappedPhase:
    """The same without the links that are `broken`.

    Pixels that no other link holds together belong to different regions.
    """
    phase = np.ascontiguousarray(wrapped.phase, np.float32)
    joining = Joining.of(phase.shape)
    runs, residues, loops = unwrap_runs(phase, broken, *joining.maps)
    torn = 0
    if residues or loops:
        runs, torn = join_by_cost(phase, broken, joining)
    count = settle(joining.run, joining.turns, joining.tree, runs)
    return UnwrappedPhase(wrapped, joining.turns, joining.run, count, residues, loops, torn)


def join_by_cost(phase: FloatMap, broken: Marks, joining: Joining) -> tuple[int, int]:
    """Join the cheapest links first; returns the runs, and the links that contradict others."""
    costs = _cost_links(phase, broken)
    numbers = np.empty(links.COST_LEVELS, np.int32)
    links.count_costs(costs, numbers)
    for limit in _limits(numbers):
        dear = np.zeros_like(broken)
        links.break_dear(costs, limit, dear)
        runs, residues, loops = unwrap_runs(phase, dear, *joining.maps)
        if not residues and not loops:
            break
    dearer = links.sort_links(costs, limit, numbers)
    return runs, links.join_in_order(dearer, phase, *joining.maps)


def find_deviations(phase: FloatMap) -> links.Steps:
    """Distance of each step from the mean of those about it, ``(2, H, W)``; see the kernels."""
    steps = np.empty((2, *phase.shape), np.int16)
    deviations = np.empty_like(steps)
    links.find_steps(phase, steps)
    links.find_deviations(steps, deviations)
    return deviations


def _cost_links(phase: FloatMap, broken: Marks) -> links.Costs:
    deviations = find_deviations(phase)
    costs = np.empty(deviations.shape, np.uint16)
    links.find_costs(deviations, costs)
    links.bar_links(broken, costs)
    return costs


def _limits(numbers: OrderMap) -> list[int]:
    """Costs up to which links are tried without an order, falling; below zero at last: none."""
    shares = np.cumsum(numbers) / max(int(numbers.sum()), 1)
    limits = [int(np.searchsorted(shares, share)) - 1 for share in SURE_SHARES]
    return [*dict.fromkeys(limit for limit in limits if limit >= 0), -1]
