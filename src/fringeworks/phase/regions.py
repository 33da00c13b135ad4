"""Regions inside which the fringe order is continuous: the paper's step 1 (its section 5).

The paper cuts the wrapped phase along its branch cuts. Cuts see a jump only where it ends: one of
a whole number of turns between two objects that touch leaves no residue, and a region that hides
it has a wrong order in one of its parts. So regions also end where the phase, or the brightness,
changes more from pixel to pixel than noise explains: a region too many costs evidence, one too
few the order. It is not for nothing: texture divides a surface too, and a jump that shows in
neither is not found.

Brightness is the offset A. The modulation B shows the same edges, but is the noisier, and under a
gamma it ripples with the phase: on `psp3-gray-mugs` that cut the wall into single fringes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels import cuts, edges, links
from fringeworks.kernels.spatial import settle, unwrap_runs
from fringeworks.model import FloatMap, UnwrappedPhase, WrappedPhase
from fringeworks.phase.spatial import Joining, Marks, find_deviations, join_by_cost


@dataclass(frozen=True, slots=True)
class EdgeRules:
    """What ends a region.

    Attributes
    ----------
    jump_rad, jump_sigmas
        A step of the phase may differ from the mean step round about by this much, and by this
        many sigma of the phase more.
    change, change_sigmas
        The offset may change over three pixels by this share of its mean, and by this many sigma
        of the phase, in radians, more: the offset's relative sigma is less than that.
    least_core_px
        Two pieces that have this many pixels away from edges are never joined through those near.
    """

    jump_rad: float = 0.3
    jump_sigmas: float = 7.5
    change: float = 0.12
    change_sigmas: float = 5.0
    least_core_px: int = 25


DEFAULT_RULES = EdgeRules()


def find_regions(wrapped: WrappedPhase, rules: EdgeRules = DEFAULT_RULES) -> UnwrappedPhase:
    """Cut the image into regions of continuous order, and unwrap each by itself.

    Every valid pixel belongs to a region, however small. Edges are found, then pixels away from
    them are joined to cores; where residues are left, or loops that do not close, branch cuts go
    between them. Pixels near edges join the cores they fit best, but never join two.

    Parameters
    ----------
    wrapped
        Fringes of one set, with sigma; NaN where void.
    rules
        What counts as an edge.

    Returns
    -------
    `residues`, `open_loops` and `torn_links` are of the cores, before the cuts.
    """
    phase = np.ascontiguousarray(wrapped.phase, np.float32)
    deviations = find_deviations(phase)
    jumps, rim = _find_edges(wrapped, deviations, rules)
    broken = jumps.copy()
    edges.break_rims(rim, broken)
    joining, torn = Joining.of(phase.shape), 0
    runs, residues, loops = unwrap_runs(phase, broken, *joining.maps)
    if residues or loops:
        _add_cuts(phase, jumps)
        broken |= jumps
        runs, _, left = unwrap_runs(phase, broken, *joining.maps)
        if left:
            runs, torn = join_by_cost(phase, broken, joining)
    order = edges.list_rim_links(deviations, broken, jumps)
    sizes = np.empty(runs, np.int32)
    edges.count_cores(joining.run, rim, joining.tree, sizes)
    edges.grow_rims(order, phase, *joining.maps, sizes, rules.least_core_px)
    count = settle(joining.run, joining.turns, joining.tree, runs)
    return UnwrappedPhase(wrapped, joining.turns, joining.run, count, residues, loops, torn)


def find_residues(wrapped: WrappedPhase) -> NDArray[np.int8]:
    """Turns gained round each loop of four pixels, ``(H - 1, W - 1)``: -1, 0 or 1; 0 where void.

    Clockwise as the image is seen, from the loop's upper left pixel (Goldstein, Zebker and Werner
    1988). Where all are zero, and loops round holes close too, any path unwraps alike.
    """
    charges, _ = _charges(np.ascontiguousarray(wrapped.phase, np.float32))
    inside = charges[1:-1, 1:-1]
    return np.where(inside == cuts.GROUND, np.int8(0), inside)


def branch_cuts(wrapped: WrappedPhase) -> Marks:
    """Links ``(H, W)`` that cuts between residues cross; bits of `kernels.spatial`.

    Nearest first, each residue is cut to one of opposite sign, to a void pixel or to the image's
    rim. The time is bounded by a fixed search per residue.
    """
    crossed = np.zeros(wrapped.phase.shape, np.uint8)
    _add_cuts(np.ascontiguousarray(wrapped.phase, np.float32), crossed)
    return crossed


def _find_edges(
    wrapped: WrappedPhase, deviations: links.Steps, rules: EdgeRules
) -> tuple[Marks, Marks]:
    """Links over which the phase jumps, and the pixels near an edge of either kind."""
    shape = wrapped.phase.shape
    jumps, marks, rim = (np.empty(shape, np.uint8) for _ in range(3))
    limits = (rules.jump_rad, rules.jump_sigmas, rules.change, rules.change_sigmas)
    edges.find_edges(deviations, wrapped.sigma, wrapped.offset, limits, jumps, marks)
    edges.widen_edges(marks, rim)
    return jumps, rim


def _charges(phase: FloatMap) -> tuple[NDArray[np.int8], int]:
    height, width = phase.shape
    charges = np.empty((height + 1, width + 1), np.int8)
    return charges, cuts.find_charges(phase, charges)


def _add_cuts(phase: FloatMap, broken: Marks) -> None:
    charges, count = _charges(phase)
    cuts.grow_boxes(charges, count, broken)
