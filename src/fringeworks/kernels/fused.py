"""Frames to cloud in one pass: every frame is read once, every point written once.

A row is worked tile by tile, see `tile`. What is done to a pixel are the scalar functions of
`tile`, `orders` and `table`, which the kernels for whole maps use too; only their order is that of
this module and of `fused_coordinates`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import Real, kernel
from fringeworks.kernels.fused_coordinates import (
    demodulate_all,
    find_levels,
    follow_chain,
    read_code,
    start_at,
    void_coordinates,
)
from fringeworks.kernels.fused_nouns import (
    BEND,
    C1,
    C2,
    C3,
    DEPTH,
    LOCAL,
    MARK_SLOTS,
    ORIGIN,
    POWERS,
    RAY_X,
    RAY_Y,
    REFERENCE,
    SLOPE,
    SLOTS,
    VOID,
    Carrier,
    Code,
    Points,
    Rules,
    Table,
    Work,
)
from fringeworks.kernels.lattice import STENCIL, fill_powers, first_row, middle_of
from fringeworks.kernels.table import NUMBERS, bent_line, bent_slope, straighten
from fringeworks.kernels.tile import (
    BOUND_SLOTS,
    FIT_SLOTS,
    NAN,
    SPREAD,
    TILE,
    Floats,
    Place,
)

TWO, THREE = np.float32(2), np.float32(3)


@kernel
def fuse(
    rows: tuple[int, int],
    carriers: tuple[Carrier, ...],
    chain: NDArray[np.int64],
    code: Code,
    rules: Rules,
    table: Table,
    points: Points,
) -> None:
    """Points of the image rows from `rows[0]` to before `rows[1]`.

    `chain` are the places of the carriers, coarse to fine; the last is the finest.
    """
    width, lattice_rows = points.xyz.shape[2], table.nodes.shape[1]
    work = Work(
        np.empty(len(carriers) * FIT_SLOTS * TILE, np.float32),
        np.empty(SLOTS * TILE, np.float32),
        np.empty(BOUND_SLOTS * TILE, code.bits.dtype),
        np.zeros(MARK_SLOTS * TILE, np.uint8),
    )
    finest = chain[chain.size - 1]
    per_rad = np.float32(carriers[finest].fringe[0] / (2 * math.pi))
    sigma = (work.fits[finest * FIT_SLOTS * TILE + SPREAD :], per_rad)
    for begin in range(0, width, TILE):
        n = min(TILE, width - begin)
        first, middle = -1.0, -1.0
        for i in range(rows[0], rows[1]):
            place = (i, begin, n)
            if first != first_row(i, table.step[0], lattice_rows):
                first = first_row(i, table.step[0], lattice_rows)
                fill_strip(table, first, place, work.s)
                middle = -1.0
            if middle != middle_of(i):
                middle = middle_of(i)
                shift_powers(np.float32(middle - first), n, work.s)
            demodulate_all(carriers, place, rules, work)
            find_levels(code, place, work, points.intensity, finest)
            if code.bits.shape[0] > 0:
                read_code(code, place, carriers[0].noise, work)
            else:
                start_at(np.float32(code.start_px), n, work.s)
            follow_chain(carriers, chain, n, work)
            void_coordinates(code, rules, n, sigma, work)
            place_points(place, np.float32(i - middle), table.depths, work.s, points.xyz)
            write_sigma(place, rules, sigma, work, points)


@kernel
def fill_strip(table: Table, first: float, place: Place, s: Floats) -> None:
    """The table's numbers of a tile's columns, by powers of the row counted from `first`."""
    powers = np.empty((NUMBERS, STENCIL, place[2]), np.float32)
    fill_powers(table.nodes, table.step, (first, place[1]), powers)
    for k in range(powers.shape[0]):
        for power in range(STENCIL):
            line = powers[k, power]
            slot = s[POWERS + (STENCIL * k + power) * TILE :]
            for j in range(line.size):
                slot[j] = line[j]


@kernel
def shift_powers(t: np.float32, n: int, s: Floats) -> None:
    """The table's numbers by powers of the row counted from `t` px behind the cell's first."""
    for k in range(NUMBERS):
        old = s[POWERS + k * STENCIL * TILE : LOCAL]
        new = s[LOCAL + k * STENCIL * TILE :]
        for j in range(min(n, TILE)):
            p1, p2, p3 = old[TILE + j], old[2 * TILE + j], old[3 * TILE + j]
            new[j] = old[j] + t * (p1 + t * (p2 + t * p3))
            new[TILE + j] = p1 + t * (TWO * p2 + t * (THREE * p3))
            new[2 * TILE + j] = p2 + t * (THREE * p3)


@kernel
def curved(s: Floats, at: int, t: Real) -> Real:
    """A number `t` px from the middle of its block; what is left out is its third power."""
    return s[at] + t * (s[at + TILE] + t * s[at + 2 * TILE])


@kernel
def straight(s: Floats, at: int, t: Real) -> Real:
    """The same of a number that hardly counts: without its second power."""
    return s[at] + t * s[at + TILE]


@kernel
def place_points(
    place: Place, t: np.float32, depths: tuple[float, float, float], s: Floats, xyz: Floats
) -> None:
    """Points of a tile from its coordinates, px, and the slope of the depth, mm / px.

    `t` is the row counted from the middle of its block. NaN outside the depth range.
    """
    i, begin, n = place
    end = begin + n
    x, y, z = xyz[0, i, begin:end], xyz[1, i, begin:end], xyz[2, i, begin:end]
    origin, near, far = np.float32(depths[0]), np.float32(depths[1]), np.float32(depths[2])
    for j in range(min(n, TILE)):
        at, c1 = s[REFERENCE + j] - curved(s, ORIGIN + j, t), curved(s, C1 + j, t)
        c2, c3, bend = straight(s, C2 + j, t), straight(s, C3 + j, t), straight(s, BEND + j, t)
        share = straighten(at, bend)
        line = bent_line(at, c1, c2, c3, share)
        depth = origin + line
        depth = depth if depth > near and depth < far else NAN
        s[SLOPE + j] = share * bent_slope(line, at, c1, c2, c3, bend)
        s[DEPTH + j] = depth
        x[j], y[j] = curved(s, RAY_X + j, t) * depth, curved(s, RAY_Y + j, t) * depth
        z[j] = depth


@kernel
def write_sigma(
    place: Place, rules: Rules, sigma: tuple[Floats, np.float32], work: Work, points: Points
) -> None:
    """Sigma of a tile's depths, mm, and why pixels have none."""
    i, begin, n = place
    spread, reason = points.sigma_mm[i, begin : begin + n], points.reason[i, begin : begin + n]
    s, (of_phase, per_rad) = work.s, sigma
    for j in range(min(n, TILE)):
        of_depth = abs(s[SLOPE + j]) * (of_phase[j] * per_rad)
        spread[j] = of_depth if s[DEPTH + j] == s[DEPTH + j] else NAN
    void = work.marks[VOID : VOID + TILE]
    undecoded, outside, misfit = rules.marks
    for j in range(min(n, TILE)):
        mark = misfit if void[j] == rules.broken[2] else undecoded
        mark = outside if s[REFERENCE + j] == s[REFERENCE + j] else mark
        reason[j] = mark if s[DEPTH + j] != s[DEPTH + j] else np.uint8(0)
