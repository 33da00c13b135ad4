"""The blind way: two periods of one scan see the same surface, and differ by the error alone.

``u_1 - u_2 = P_1 delta(phi_1) / 2 pi - P_2 delta(phi_2) / 2 pi`` at every pixel, whatever the
surface. Sets with the same shifts share one error: of two periods as 3 to 2 some waves of either
look alike, and apart could not be told whose they are.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import AXES, Axis, Capture, PhaseTerms
from fringeworks.phase.response import ORDERS, wave_terms
from fringeworks.phase.response_fit.seen import (
    Seen,
    against,
    check_phases,
    coordinate_of,
    make_terms,
    sample,
    see_sets,
    solve_robustly,
)

Array: TypeAlias = NDArray[np.float64]

WORST_CONDITION = 10.0
"""Of the waves told apart: 2 to 5 of most periods, 15 and more where waves of two sets coincide, as
of 32 px in three steps and of 64 px in six."""

LARGEST_RAD = 2.5
"""Disagreement, of the coarser fringes' phase, beyond which an order is wrong."""


def has_periods(capture: Capture, axis: Axis) -> bool:
    """Whether fringes of several periods stand along an axis."""
    return len({wrapped.fringe.period_px for wrapped in see_sets(capture, axis)}) > 1


def fit_periods(capture: Capture) -> tuple[PhaseTerms, ...]:
    """Terms of every set of the axes that have several periods.

    Raises
    ------
    DecodeError
        An axis has no absolute phase; too few pixels; waves of two sets that coincide; terms that
        fold the phase over.
    """
    found: list[PhaseTerms] = []
    for axis in AXES:
        if has_periods(capture, axis):
            coordinate = coordinate_of(capture, axis)
            sets = [against(wrapped, coordinate) for wrapped in see_sets(capture, axis)]
            found += _fit_axis(sorted(sets, key=lambda seen: seen.fringe.period_px))
    return tuple(found)


def _fit_axis(sets: list[Seen]) -> list[PhaseTerms]:
    """All sets against the finest, the first of them."""
    blocks = list(dict.fromkeys(seen.fringe.shifts_rad for seen in sets))
    pairs = [_pair(sets[0], other, blocks) for other in sets[1:]]
    rows = [
        np.column_stack([waves, np.outer(np.ones(len(waves)), np.arange(len(pairs)) == place)])
        for place, (waves, _) in enumerate(pairs)
    ]
    design = np.concatenate(rows)
    _check_apart(design, sets)
    found, _ = solve_robustly(design, np.concatenate([gap for _, gap in pairs]))
    left = [
        (
            float(np.median(np.abs(gap))),
            float(np.median(np.abs(gap - waves @ found[: waves.shape[1]]))),
        )
        for waves, gap in pairs
    ]
    terms = []
    for place, seen in enumerate(sets):
        first = 2 * ORDERS * blocks.index(seen.fringe.shifts_rad)
        before, after = left[max(place - 1, 0)]
        own = make_terms(seen, found[first : first + 2 * ORDERS])
        terms.append(replace(own, before=before, after=after, unit="px"))
    return terms


def _check_apart(design: Array, sets: list[Seen]) -> None:
    design = design / np.linalg.norm(design, axis=0)
    if math.sqrt(np.linalg.cond(design.T @ design)) > WORST_CONDITION:
        shown = " and ".join(f"{seen.fringe.period_px:.4g} px" for seen in sets)
        raise DecodeError(
            f"fringes of {shown} along {sets[0].fringe.axis} have waves of one length, and steps "
            "of their own: whose they are cannot be told; show all periods with the same steps"
        )


def _pair(finest: Seen, other: Seen, blocks: list[tuple[float, ...]]) -> tuple[Array, Array]:
    """Design ``(n, 2 ORDERS blocks)`` and disagreement ``(n,)``, px, of two sets."""
    errors = [seen.error() * _px_per_rad(seen) for seen in (finest, other)]
    gap = errors[0] - errors[1]
    places = sample(
        np.abs(gap) < LARGEST_RAD * _px_per_rad(other), what=f"axis {other.fringe.axis}"
    )
    design = np.zeros((len(places), 2 * ORDERS * len(blocks)))
    for sign, seen in ((1, finest), (-1, other)):
        phase = seen.wrapped.phase.ravel()[places].astype(np.float64)
        check_phases(phase, seen.fringe)
        first = 2 * ORDERS * blocks.index(seen.fringe.shifts_rad)
        waves = wave_terms(phase, seen.fringe.frame_count)
        design[:, first : first + 2 * ORDERS] += sign * _px_per_rad(seen) * waves
    return design, gap.ravel()[places]


def _px_per_rad(seen: Seen) -> float:
    return seen.fringe.period_px / (2 * np.pi)
