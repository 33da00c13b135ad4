"""Where one surface may end and another begin, and regions that do not reach across.

Links over which phase or brightness changes more than noise explains are edges; pixels near one
are rim. Cores, what is left without the rim, are joined first. Then the rim grows onto them, link
by link, but two cores are never joined through it: where a jump of nearly whole turns leaves a
gap in an edge, the rim closes it. Links and marks are named as in `spatial`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.links import HALF_TURN, PER_RADIAN, Steps
from fringeworks.kernels.spatial import ABOVE, BOTH, LEFT, NEITHER, find, join, turns_between

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]
Marks = NDArray[np.uint8]

REACH = 3
"""A pixel is rim where an edge lies in the box of 4 x 4 links about it."""

RIM_SHIFT = 8
"""Deviations are sorted by so many bits less than they have: into 128 levels."""


@kernel
def find_edges(
    deviations: Steps,
    sigma: Floats,
    offset: Floats,
    limits: tuple[float, float, float, float],
    jumps: Marks,
    edges: Marks,
) -> None:
    """Mark links over which the phase jumps, and those over which phase or brightness do.

    `limits` are the step's largest deviation, rad, and the offset's largest relative change over
    three pixels, which is what lenses spread an edge to: each a constant and a multiple of the
    phase's sigma. `jumps` and `edges` ``(H, W)`` are overwritten.
    """
    height, width = sigma.shape
    lit, noise = np.empty(width + 3, np.float32), np.empty(width + 1, np.float32)
    noise[0] = np.nan
    for i in range(height):
        after, ahead = offset[min(i + 1, height - 1)], offset[max(i - 2, 0)]
        for j in range(width):
            jumps[i, j], edges[i, j] = NEITHER, NEITHER
            lit[j + 2], noise[j + 1] = offset[i, j], sigma[i, j]
        lit[0], lit[1], lit[width + 2] = lit[2], lit[2], lit[width + 1]
        above = sigma[max(i - 1, 0)]
        _mark_row(
            deviations[1, i], (sigma[i], above), (after, ahead), (limits, ABOVE), jumps[i], edges[i]
        )
        _mark_row(
            deviations[0, i], (noise[1:], noise), (lit[3:], lit), (limits, LEFT), jumps[i], edges[i]
        )


@kernel
def _mark_row(
    deviations: NDArray[np.int16],
    noise: tuple[Floats, Floats],
    lit: tuple[Floats, Floats],
    rule: tuple[tuple[float, float, float, float], np.uint8],
    jumps: Marks,
    edges: Marks,
) -> None:
    """Mark the links of one row and one kind, besides those that are marked already."""
    limits, kind = rule
    deviate, by_sigma = np.float32(limits[0]) * PER_RADIAN, np.float32(limits[1]) * PER_RADIAN
    change, by_noise = np.float32(limits[2]) / 2, np.float32(limits[3]) / 2
    here, before = noise
    after, ahead = lit
    for j in range(deviations.size):
        worst = max(here[j], before[j])
        jumped = np.float32(deviations[j]) > deviate + by_sigma * worst
        limit = (change + by_noise * worst) * (after[j] + ahead[j])
        changed = (abs(after[j] - ahead[j]) > limit) & (deviations[j] >= 0)
        jumps[j] |= kind if jumped else NEITHER
        edges[j] |= kind if jumped | changed else NEITHER


@kernel
def widen_edges(edges: Marks, rim: Marks) -> None:
    """One in ``rim``, ``(H, W)``, for the pixels that have an edge near; zero elsewhere."""
    height, width = edges.shape
    any_row = np.zeros(width + REACH, np.uint8)
    for i in range(height):
        for j in range(width):
            any_row[j + 1] = NEITHER
        for row in range(max(i - 1, 0), min(i + REACH, height)):
            for j in range(width):
                any_row[j + 1] |= edges[row, j]
        for j in range(width):
            near = any_row[j] | any_row[j + 1] | any_row[j + 2] | any_row[j + 3]
            rim[i, j] = 1 if near else 0


@kernel
def break_rims(rim: Marks, broken: Marks) -> None:
    """Break every link of the rim's pixels, besides those that are broken already."""
    height, width = rim.shape
    for i in range(height):
        here, above, marks = rim[i], rim[max(i - 1, 0)], broken[i]
        for j in range(width):
            marks[j] |= BOTH if here[j] else (ABOVE if above[j] else NEITHER)
        for j in range(1, width):
            marks[j] |= LEFT if here[j - 1] else NEITHER


@kernel
def list_rim_links(deviations: Steps, broken: Marks, jumps: Marks) -> Ints:
    """Links that are broken but are no jumps, the least deviation first: as `links.sort_links`."""
    height, width = broken.shape
    place_of = np.zeros((HALF_TURN >> RIM_SHIFT) + 2, np.int32)
    for i in range(height):
        for j in range(width):
            open_links = broken[i, j] & ~jumps[i, j]
            for axis in range(2 if open_links else 0):
                off = deviations[axis, i, j]
                if open_links & (LEFT << axis) and off >= 0:
                    place_of[(off >> RIM_SHIFT) + 1] += 1
    for cost in range(1, place_of.size):
        place_of[cost] += place_of[cost - 1]
    links = np.empty(place_of[-1], np.int32)
    for i in range(height):
        for j in range(width):
            open_links = broken[i, j] & ~jumps[i, j]
            for axis in range(2 if open_links else 0):
                off = deviations[axis, i, j]
                if open_links & (LEFT << axis) and off >= 0:
                    links[place_of[off >> RIM_SHIFT]] = 2 * (i * width + j) + axis
                    place_of[off >> RIM_SHIFT] += 1
    return links


@kernel
def count_cores(run: Ints, rim: Marks, tree: Ints, sizes: Ints) -> None:
    """Pixels of each root that are not rim in `sizes`, ``(runs,)``; the others' do not matter."""
    sizes[:] = 0
    height, width = run.shape
    for i in range(height):
        start = 0
        for j in range(1, width + 1):
            if j == width or run[i, j] != run[i, start]:
                if run[i, start] >= 0 and not rim[i, start]:  # a rim's pixel is a run by itself
                    sizes[run[i, start]] += j - start
                start = j
    for n in range(sizes.size):
        root = find(tree, n)[0]
        if root != n:
            sizes[root] += sizes[n]


@kernel
def grow_rims(
    links: Ints,
    phase: Floats,
    turns: Ints,
    run: Ints,
    tree: Ints,
    sizes: Ints,
    least: int,
) -> None:
    """Join runs along `links`, in that order, but never two cores of `least` pixels or more.

    `turns`, `run` and `tree` as `spatial.unwrap_runs` leaves them, `sizes` as `count_cores` does.
    """
    width = phase.shape[1]
    for n in range(links.size):
        place, axis = links[n] >> 1, links[n] & 1
        i, j = place // width, place % width
        above, left = (i - 1, j) if axis else (i, j - 1)
        one, other = find(tree, run[above, left])[0], find(tree, run[i, j])[0]
        if one == other or min(sizes[one], sizes[other]) >= least:
            continue
        rise = turns_between(phase[above, left], phase[i, j])
        join(tree, run[above, left], run[i, j], turns[above, left] + rise - turns[i, j])
        sizes[min(one, other)] = sizes[one] + sizes[other]
