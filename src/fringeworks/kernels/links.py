"""How far a link between two pixels may be trusted, from the phase alone.

A step along a link is right where the true one is within half a turn. The mean of the wrapped
steps round about, in a box, says what step to expect, whatever the carrier; the deviation from it
is what noise, or an edge, has put on top. Links are named as in `spatial`, axis 0 along the row.

Steps are whole numbers of `STEPS_PER_TURN`: sums are exact, so that a running box never drifts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import inlined, kernel
from fringeworks.kernels.spatial import ABOVE, LEFT, NEITHER, join, turns_between

Floats = NDArray[np.float32]
Steps = NDArray[np.int16]
Ints = NDArray[np.int32]
Costs = NDArray[np.uint16]

STEPS_PER_TURN = 65534
HALF_TURN = np.int32(STEPS_PER_TURN // 2)
VOID_STEP = np.int16(-32768)
PER_RADIAN = np.float32(STEPS_PER_TURN / (2 * math.pi))
PER_TURN = np.float32(1 / (2 * math.pi))
ONE_TURN = np.float32(2 * math.pi)

HALF_BOX = 5
"""The box is 11 pixels wide: smaller ones follow the noise, larger ones iron out the surface."""

COST_SHIFT = 10
COST_LEVELS = ((3 * int(HALF_TURN)) >> COST_SHIFT) + 1
"""Few, so that links of one cost, taken in the order of memory, are many."""

VOID_COST = np.uint16(65535)


@inlined
def wrapped_step(before: np.float32, after: np.float32) -> np.int16:
    """The step between two wrapped phases, at most half a turn; `VOID_STEP` where one is NaN."""
    rise = after - before
    rise -= ONE_TURN * np.rint(rise * PER_TURN)
    return np.int16(np.rint(rise * PER_RADIAN)) if rise == rise else VOID_STEP


@kernel
def find_steps(phase: Floats, steps: Steps) -> None:
    """Wrapped steps ``(2, H, W)`` along the links from the left and from above each pixel."""
    height, width = phase.shape
    for i in range(height):
        row, along, down = phase[i], steps[0, i], steps[1, i]
        before = phase[max(i - 1, 0)]
        along[0] = VOID_STEP
        for j in range(1, width):
            along[j] = wrapped_step(row[j - 1], row[j])
        for j in range(width):
            down[j] = wrapped_step(before[j], row[j]) if i else VOID_STEP


@kernel
def find_deviations(steps: Steps, deviations: Steps) -> None:
    """Distance of each step from the mean of its axis in the box about it; -1 where void.

    Both ``(2, H, W)``.
    """
    _, height, width = steps.shape
    sums = np.empty((2, width), np.int32)
    running = np.zeros((2, width + 2 * HALF_BOX + 1), np.int32)
    for axis in range(2):
        sums[:] = 0
        for i in range(min(HALF_BOX, height)):
            _add_row(steps[axis, i], sums[0], sums[1], np.int32(1))
        for i in range(height):
            if i + HALF_BOX < height:
                _add_row(steps[axis, i + HALF_BOX], sums[0], sums[1], np.int32(1))
            if i > HALF_BOX:
                _add_row(steps[axis, i - HALF_BOX - 1], sums[0], sums[1], np.int32(-1))
            _run_up(sums[0], running[0])
            _run_up(sums[1], running[1])
            _deviate_row(steps[axis, i], running[0], running[1], deviations[axis, i])


@kernel
def _add_row(steps: Steps, total: Ints, number: Ints, sign: np.int32) -> None:
    """Add a row's steps, and how many there are, to the sums of the columns."""
    for j in range(steps.size):
        known = steps[j] != VOID_STEP
        total[j] += sign * np.int32(steps[j]) if known else np.int32(0)
        number[j] += sign if known else np.int32(0)


@kernel
def _run_up(sums: Ints, running: Ints) -> None:
    """Sums of the columns up to each, as if there were `HALF_BOX` empty ones at both ends.

    They may overflow: only their differences are used, which do not.
    """
    total, width = np.int32(0), sums.size
    for j in range(width):
        total = np.int32(total + sums[j])
        running[j + HALF_BOX + 1] = total
    running[width + HALF_BOX + 1 :] = total


@kernel
def _deviate_row(steps: Steps, total: Ints, number: Ints, deviations: Steps) -> None:
    """Deviations of one row from the sums of the columns about it."""
    whole = np.float32(STEPS_PER_TURN)
    total_after, number_after = total[2 * HALF_BOX + 1 :], number[2 * HALF_BOX + 1 :]
    for j in range(steps.size):
        in_box = np.int32(total_after[j] - total[j])
        mean = np.float32(in_box) / np.float32(np.int32(number_after[j] - number[j]))
        off = abs(np.float32(steps[j]) - mean)
        off = min(off, whole - off)
        deviations[j] = np.int16(off) if steps[j] != VOID_STEP else np.int16(-1)


@kernel
def find_costs(deviations: Steps, costs: Costs) -> None:
    """What it costs to trust each link: its deviation, and the mean ones at both its pixels.

    Both ``(2, H, W)``; below `COST_LEVELS`, or `VOID_COST` where there is no link. A link whose own
    step happens to fit is not to be trusted among links that do not.
    """
    _, height, width = deviations.shape
    rough = np.empty((2, width), np.int32)
    for i in range(height):
        before, here = rough[(i + 1) & 1], rough[i & 1]
        _roughness(deviations, i, here)
        along, down = deviations[0, i], deviations[1, i]
        for j in range(width):
            sum_along = np.int32(along[j]) + here[j] + here[max(j - 1, 0)]
            costs[0, i, j] = VOID_COST if along[j] < 0 else np.uint16(sum_along >> COST_SHIFT)
            sum_down = np.int32(down[j]) + here[j] + before[j]
            costs[1, i, j] = VOID_COST if down[j] < 0 else np.uint16(sum_down >> COST_SHIFT)


@kernel
def _roughness(deviations: Steps, i: int, rough: Ints) -> None:
    """Mean deviation of the links at each pixel of row i."""
    _, height, width = deviations.shape
    zero = np.int32(0)
    for j in range(width):
        left, above = np.int32(deviations[0, i, j]), np.int32(deviations[1, i, j])
        right = np.int32(deviations[0, i, j + 1]) if j + 1 < width else np.int32(-1)
        below = np.int32(deviations[1, i + 1, j]) if i + 1 < height else np.int32(-1)
        total = max(left, zero) + max(above, zero) + max(right, zero) + max(below, zero)
        number = int(left >= 0) + int(above >= 0) + int(right >= 0) + int(below >= 0)
        rough[j] = np.int32(np.float32(total) / np.float32(max(number, 1)))


@kernel
def break_dear(costs: Costs, limit: int, broken: NDArray[np.uint8]) -> None:
    """Mark the links that cost more than `limit` in ``broken``, ``(H, W)``."""
    _, height, width = costs.shape
    for i in range(height):
        along, down, marks = costs[0, i], costs[1, i], broken[i]
        for j in range(width):
            marks[j] |= LEFT if along[j] > limit else NEITHER
            marks[j] |= ABOVE if down[j] > limit else NEITHER


@kernel
def bar_links(broken: NDArray[np.uint8], costs: Costs) -> None:
    """Make the costs of broken links void: they are not to be trusted at any price."""
    _, height, width = costs.shape
    for i in range(height):
        along, down, marks = costs[0, i], costs[1, i], broken[i]
        for j in range(width):
            along[j] = VOID_COST if marks[j] & LEFT else along[j]
            down[j] = VOID_COST if marks[j] & ABOVE else down[j]


@kernel
def join_in_order(links: Ints, phase: Floats, turns: Ints, run: Ints, tree: Ints) -> int:
    """Join runs along `links`, as `sort_links` gives them.

    `turns`, `run` and `tree` as `spatial.unwrap_runs` leaves them. Returns how many links tell
    other turns than those before them.
    """
    width = phase.shape[1]
    contrary = 0
    for n in range(links.size):
        place, axis = links[n] >> 1, links[n] & 1
        i, j = place // width, place % width
        above, left = (i - 1, j) if axis else (i, j - 1)
        rise = turns_between(phase[above, left], phase[i, j])
        turn = turns[above, left] + rise - turns[i, j]
        contrary += not join(tree, run[above, left], run[i, j], turn)
    return contrary


@kernel
def sort_links(costs: Costs, limit: int, numbers: Ints) -> Ints:
    """Links dearer than `limit`, the cheapest first: twice the pixel's place, plus the axis.

    `numbers` as `count_costs` leaves them.
    """
    _, height, width = costs.shape
    place_of = np.zeros(numbers.size, np.int32)
    total = 0
    for cost in range(limit + 1, numbers.size):
        place_of[cost] = total
        total += numbers[cost]
    links = np.empty(total, np.int32)
    for axis in range(2):
        for i in range(height):
            row = costs[axis, i]
            for j in range(width):
                if limit < row[j] < VOID_COST:
                    links[place_of[row[j]]] = 2 * (i * width + j) + axis
                    place_of[row[j]] += 1
    return links


@kernel
def count_costs(costs: Costs, numbers: Ints) -> None:
    """Count the links of each cost in `numbers`, ``(COST_LEVELS,)``."""
    _, height, width = costs.shape
    numbers[:] = 0
    for axis in range(2):
        for i in range(height):
            row = costs[axis, i]
            for j in range(width):
                if row[j] < VOID_COST:
                    numbers[row[j]] += 1
