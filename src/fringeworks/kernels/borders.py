"""Orders pixel by pixel where two surfaces with different starts meet inside one region.

Their patches hold pixels of both. Each pixel is asked together with the few about it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.codeframe import SLOTS, TILE_COLUMNS, TILE_ROWS, code_and_weight
from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.surface import HALF, NAN, ZERO

Floats = NDArray[np.float32]
Integers = NDArray[np.int32]

ASIDE = 3
"""Pixels to each side that are asked too."""

MOST_SHIFTS = 8
"""Different starts that are looked at about a tile."""

OUTSIDE = np.float32(-1)
"""Log-likelihood of a pixel whose light would come from outside the projector's image."""


@kernel
def _shifts_about(
    first_slot: int,
    region: int,
    grid: tuple[int, int],
    owner: Integers,
    shift: Integers,
    known: NDArray[np.bool_],
    found: Integers,
) -> int:
    """Collect in `found` the shifts that a region has in the nine tiles about one; their number."""
    tile, count = first_slot // SLOTS, 0
    rows, tiles = grid
    i, j = tile // tiles, tile % tiles
    for y in range(max(i - 1, 0), min(i + 2, rows)):
        for x in range(max(j - 1, 0), min(j + 2, tiles)):
            for slot in range((y * tiles + x) * SLOTS, (y * tiles + x + 1) * SLOTS):
                if owner[slot] != region or not known[slot]:
                    continue
                new = count < MOST_SHIFTS
                for n in range(count):
                    new = new and found[n] != shift[slot]
                if new:
                    found[count] = shift[slot]
                    count += 1
    return count


@kernel
def mixed_slots(
    owner: Integers,
    shift: Integers,
    known: NDArray[np.bool_],
    tiles: int,
    mixed: NDArray[np.bool_],
) -> None:
    """Mark the slots of regions that have other shifts nearby than their own, all per slot.

    `owner` is a slot's region, -1 for none; a slot whose shift is not `known` has none.
    """
    grid = owner.size // (SLOTS * tiles), tiles
    found = np.empty(MOST_SHIFTS, np.int32)
    for slot in range(owner.size):
        if owner[slot] >= 0:
            first = slot - slot % SLOTS
            count = _shifts_about(first, owner[slot], grid, owner, shift, known, found)
            mixed[slot] = count > 1 or (count == 1 and not known[slot])


@kernel
def _add_evidence(
    code: np.float32,
    weight: np.float32,
    turns: np.float32,
    shifts: Integers,
    words: tuple[Integers, int],
    templates: Floats,
    says: Floats,
) -> None:
    """Log-likelihood of one pixel under each shift; `words` as `settle_mixed`."""
    of_order, first = words
    turn = np.floor(turns + HALF)
    lag = int((turns + HALF - turn) * np.float32(templates.shape[1]))
    for n in range(shifts.size):
        place = min(max(int(turn) + shifts[n] - first + 1, 0), of_order.size - 1)
        if of_order[place] == templates.shape[0]:
            says[n] += OUTSIDE
        else:
            wave = templates[of_order[place], lag]
            says[n] += weight * (code * wave - HALF * wave * wave)


@kernel
def _best_within(
    says: Floats, rows: tuple[int, int], columns: tuple[int, int]
) -> tuple[np.float32, int]:
    """By how much the best shift leads within a rectangle, and which it is."""
    best, top, second = 0, -np.float32(np.inf), -np.float32(np.inf)
    for n in range(says.shape[2]):
        total = ZERO
        for y in range(rows[0], rows[1]):
            for x in range(columns[0], columns[1]):
                total += says[y, x, n]
        if total > top:
            best, top, second = n, total, top
        elif total > second:
            second = total
    return top - second, best


@kernel
def _best_about(says: Floats, i: int, j: int) -> tuple[np.float32, int]:
    """The same within `ASIDE` of a pixel; no lead where its four quarters do not agree.

    A border that runs nearer than half a quarter is seen by one of them.
    """
    lead, best = _best_within(says, (i - ASIDE, i + ASIDE + 1), (j - ASIDE, j + ASIDE + 1))
    for y in (i - ASIDE, i):
        for x in (j - ASIDE, j):
            _, here = _best_within(says, (y, y + ASIDE + 1), (x, x + ASIDE + 1))
            if here != best:
                return ZERO, best
    return lead, best


@kernel
def settle_mixed(
    mixed: NDArray[np.bool_],
    owner: Integers,
    shift: Integers,
    known: NDArray[np.bool_],
    level: Floats,
    scale: Floats,
    transfer: Integers,
    image: NDArray[np.generic],
    maps: tuple[Floats, Floats, Floats, Integers, Integers, Integers],
    noise: tuple[float, float, float],
    limits: tuple[float, int, float],
    words: tuple[Integers, int],
    templates: Floats,
    order: Integers,
    margin: Floats,
) -> None:
    """Decide every pixel of the mixed slots with the pixels of its region within `ASIDE`.

    Parameters
    ----------
    mixed, owner, shift, known, level, scale, transfer
        Per slot; of the last three the code's offset, by how much its likelihood is too sure, and
        the index of its transfer.
    maps
        Continuous phase in turns, offset, modulation, region, turns, slot; ``(H, W)``.
    limits
        Saturation, empty bins at either end, and the nats that the best must be ahead.
    words
        Word of each order from the one before the first on, which is "outside", to the one after
        the last; and the first order.
    templates
        ``(transfers, words, bins)``.
    """
    at, offset, modulation, region, turns, place = maps
    height, width = at.shape
    spread = np.float32(noise[0]), np.float32(noise[1]), np.float32(noise[2])
    most, edge, least = np.float32(limits[0]), limits[1], np.float32(limits[2])
    bins = templates.shape[2]
    tiles = (width + TILE_COLUMNS - 1) // TILE_COLUMNS
    grid = owner.size // (SLOTS * tiles), tiles
    found = np.empty(MOST_SHIFTS, np.int32)
    for slot in range(mixed.size):
        if not mixed[slot]:
            continue
        first = slot - slot % SLOTS
        count = _shifts_about(first, owner[slot], grid, owner, shift, known, found)
        shifts, waves = found[:count], templates[transfer[slot]]
        tile = slot // SLOTS
        top, left = tile // tiles * TILE_ROWS - ASIDE, tile % tiles * TILE_COLUMNS - ASIDE
        says = np.zeros((TILE_ROWS + 2 * ASIDE, TILE_COLUMNS + 2 * ASIDE, count), np.float32)
        for i in range(max(top, 0), min(top + says.shape[0], height)):
            for j in range(max(left, 0), min(left + says.shape[1], width)):
                grey, turn = np.float32(image[i, j]), at[i, j] + HALF
                if region[i, j] != owner[slot] or grey >= most:
                    continue
                lag = int((turn - np.floor(turn)) * np.float32(bins))
                if lag < edge or lag >= bins - edge:
                    continue
                c, weight = code_and_weight(grey, offset[i, j], modulation[i, j], spread)
                c, weight = c - level[slot], weight / scale[slot]
                _add_evidence(c, weight, at[i, j], shifts, words, waves, says[i - top, j - left])
        for i in range(top + ASIDE, min(top + ASIDE + TILE_ROWS, height)):
            for j in range(left + ASIDE, min(left + ASIDE + TILE_COLUMNS, width)):
                if place[i, j] == slot:
                    lead, best = _best_about(says, i - top, j - left)
                    sure = lead >= least
                    order[i, j] = turns[i, j] + shifts[best] if sure else -1
                    margin[i, j] = -math.expm1(-lead) if sure else NAN
