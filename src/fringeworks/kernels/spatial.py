"""Spatial unwrapping by runs: pieces of rows that are continuous by themselves, then joined.

A run is a stretch of valid pixels along a row with no broken link inside. Links between a run and
the runs that it touches above give the number of turns between them; a union-find that carries
those turns joins runs into regions. Two runs whose links tell different numbers enclose a residue;
two runs that hang together already, with another number, close an open loop, round a hole of the
mask for instance. Where neither occurs every path gives the same phase.

Links are named after the pixel that they lead to: bit `LEFT` of ``broken[i, j]`` is the link from
``(i, j - 1)``, bit `ABOVE` the one from ``(i - 1, j)``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import inlined, kernel

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Marks = NDArray[np.uint8]

PI = np.float32(math.pi)
LEFT, ABOVE = np.uint8(1), np.uint8(2)
NEITHER, BOTH = np.uint8(0), np.uint8(3)


@inlined
def turns_between(before: np.float32, after: np.float32) -> np.int32:
    """Turns to add in going from one wrapped phase to the next, so that they differ by pi at most.

    Zero where either is NaN.
    """
    rise = after - before
    return np.int32(rise < -PI) - np.int32(rise > PI)


@kernel
def unwrap_runs(
    phase: Floats, broken: Marks, turns: Ints, run: Ints, tree: Ints
) -> tuple[int, int, int]:
    """Unwrap inside runs, name them, and join them along the links between rows.

    Parameters
    ----------
    phase
        ``(H, W)`` wrapped phase, rad; NaN where void.
    broken
        ``(H, W)`` links that are not to be used.
    turns
        ``(H, W)`` out: turns of a pixel in its run; 0 where void.
    run
        ``(H, W)`` out: number of the pixel's run; -1 where void.
    tree
        ``(2, most)`` out: parent of each run, itself for a root, and its turns from the parent.
        ``H W`` are enough.

    Returns
    -------
    Number of runs; of overlaps of two runs whose links disagree (residues); of links between
    runs of one region that disagree (open loops).
    """
    height, _ = phase.shape
    count, residues, loops = 0, 0, 0
    for i in range(height):
        count = _trace_row(phase[i], broken[i], turns[i], run[i], tree, count)
        if i:
            further = _join_rows(
                (phase[i - 1], phase[i]),
                broken[i],
                (turns[i - 1], turns[i]),
                (run[i - 1], run[i]),
                tree,
            )
            residues, loops = residues + further[0], loops + further[1]
    return count, residues, loops


@kernel
def _trace_row(phase: Floats, broken: Marks, turns: Ints, run: Ints, tree: Ints, count: int) -> int:
    """Number the runs of a row, from `count` on, and unwrap inside them; returns the new count."""
    inside, turn = False, np.int32(0)
    for j in range(phase.size):
        if math.isnan(phase[j]):
            inside, turn = False, np.int32(0)
            run[j] = -1
        else:
            if inside and not broken[j] & LEFT:
                turn += turns_between(phase[j - 1], phase[j])
            else:
                inside, turn = True, np.int32(0)
                tree[0, count], tree[1, count] = count, 0
                count += 1
            run[j] = count - 1
        turns[j] = turn
    return count


@kernel
def _join_rows(
    phase: tuple[Floats, Floats],
    broken: Marks,
    turns: tuple[Ints, Ints],
    run: tuple[Ints, Ints],
    tree: Ints,
) -> tuple[int, int]:
    """Join the runs of two rows; returns how many overlaps, and how many loops, disagree."""
    residues, loops = 0, 0
    upper, lower, told = -1, -1, np.int32(0)
    for j in range(broken.size):
        above, here = run[0][j], run[1][j]
        if above < 0 or here < 0 or broken[j] & ABOVE:
            continue
        turn = turns[0][j] + turns_between(phase[0][j], phase[1][j]) - turns[1][j]
        if above == upper and here == lower:
            residues += turn != told
        else:
            loops += not join(tree, above, here, turn)
        upper, lower, told = above, here, turn
    return residues, loops


@kernel
def join(tree: Ints, first: int, second: int, turns: int) -> bool:
    """Put two runs into one tree, `second` being `turns` higher than `first`.

    False where they are in one tree already with another number of turns, and stay so.
    """
    of_first, of_second = find(tree, first), find(tree, second)
    rise = of_first[1] + turns - of_second[1]
    if of_first[0] == of_second[0]:
        return bool(rise == 0)
    if of_first[0] < of_second[0]:  # the older root stays: row by row that is the larger tree
        tree[0, of_second[0]], tree[1, of_second[0]] = of_first[0], rise
    else:
        tree[0, of_first[0]], tree[1, of_first[0]] = of_second[0], -rise
    return True


@kernel
def find(tree: Ints, run: int) -> tuple[int, int]:
    """Root of a run, and the run's turns from it; paths are halved on the way."""
    turns = 0
    while tree[0, run] != run:
        parent = tree[0, run]
        tree[1, run] += tree[1, parent]  # zero at a root
        tree[0, run] = tree[0, parent]
        turns += tree[1, run]
        run = tree[0, run]
    return run, turns


@kernel
def settle(run: Ints, turns: Ints, tree: Ints, count: int) -> int:
    """Turn `run` into labels of regions, in the order of their first pixels, and add their turns.

    `count` is the number of runs; returns the number of regions.
    """
    label, shift = np.empty(count, np.int32), np.empty(count, np.int32)
    regions = 0
    for n in range(count):
        root, turn = find(tree, n)
        if root == n:
            label[n] = regions
            regions += 1
        label[n], shift[n] = label[root], turn
    height, width = run.shape
    for i in range(height):
        for j in range(width):
            n = run[i, j]
            if n >= 0:
                run[i, j] = label[n]
                turns[i, j] += shift[n]
    return regions
