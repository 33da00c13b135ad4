"""The code frame's pass over the image: a histogram along the fringe for every patch.

A patch is what one tile of the image holds of one turn of one region: pixels of one fringe of one
surface. Its pixels are gathered by where in the fringe they lie, as weights and weighted codes
c = (I - A) / B. Any codeword, transfer and offset can be fitted to that afterwards without looking
at a pixel again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.surface import HALF, NAN, ONE, ZERO

Floats = NDArray[np.float32]
Integers = NDArray[np.int32]
Marks = NDArray[np.uint8]

TILE_ROWS = 8
TILE_COLUMNS = 32
SLOTS = 8
"""Patches that a tile has room for; pixels of any further ones are left out."""

NEAR = np.float32(0.25)
"""A pixel's phase is so many turns from one diagonally above it on the same surface."""

MOST_LINKS = 8
LEAST_LINK = 3
"""Neighbours that a patch has room for, and pixels along which they must be one surface."""

PIXELS, SQUARE, LOWEST, HIGHEST, WINDOWED, SUMS = range(6)
"""Columns of a patch's sums: pixels, weighted c^2, and the window's ends and pixels."""


@kernel
def count_regions(region: Integers, count: Integers) -> None:
    """Add each pixel to its region's count; negative regions are none."""
    height, width = region.shape
    for i in range(height):
        row, began = region[i], 0
        for j in range(1, width + 1):
            if j == width or row[j] != row[began]:
                if row[began] >= 0:
                    count[row[began]] += j - began
                began = j


@kernel
def _find_slot(key: Integers, first: int, region: int, turn: int, split: bool) -> int:
    """Place of this region's turn among a tile's patches, made if there is none or it must be new.

    -1: no room.
    """
    for place in range(first, first + SLOTS):
        if not split and key[place, 0] == region and key[place, 1] == turn:
            return place
        if key[place, 0] < 0:
            key[place, 0], key[place, 1] = region, turn
            return place
    return -1


@kernel
def _slot_at(
    at: Floats,
    region: Integers,
    goes_on: tuple[Marks, Marks],
    patch: Integers,
    key: Integers,
    pixel: tuple[int, int, int],
) -> int:
    """Place of the patch of a pixel whose left neighbour is of another one, or across a jump."""
    i, j, first = pixel
    r, turn = region[i, j], int(np.floor(at[i, j] + HALF))
    split = j % TILE_COLUMNS > 0 and region[i, j - 1] == r and not goes_on[0][i, j]
    if i % TILE_ROWS > 0:
        for x in (j, j + 1, j - 1):
            if not (0 <= x < at.shape[1]) or region[i - 1, x] != r:
                continue
            place = patch[i - 1, x]
            inside = first <= place < first + SLOTS
            near = goes_on[1][i, j] > 0 if x == j else abs(at[i, j] - at[i - 1, x]) < NEAR
            if inside and near and key[place, 1] == turn:
                return int(place)
            split = split or (x == j and inside and not near)
    return _find_slot(key, first, r, turn, split and not goes_on[0][i, j])


@kernel
def code_and_weight(
    grey: np.float32,
    offset: np.float32,
    modulation: np.float32,
    noise: tuple[np.float32, np.float32, np.float32],
) -> tuple[np.float32, np.float32]:
    """The code ``c = (I - A) / B``, and one over its variance."""
    variance, gain, black = noise
    spread = variance + gain * max(offset - black, ZERO)
    return (grey - offset) / modulation, modulation * modulation / spread


@kernel
def gather_patches(
    code: NDArray[np.generic],
    at: Floats,
    goes_on: tuple[Marks, Marks],
    offset: Floats,
    modulation: Floats,
    region: Integers,
    use: NDArray[np.bool_],
    window: tuple[Floats, Floats, float, float],
    noise: tuple[float, float, float],
    saturation: float,
    edge: int,
    patch: Integers,
    key: Integers,
    sums: Floats,
    along: Floats,
) -> None:
    """Fill `patch` ``(H, W)``, and per patch `key` (region, turn), `sums` and `along`.

    Parameters
    ----------
    code
        The code frame, ``(H, W)`` grey levels; from `saturation` on it says nothing.
    at, goes_on
        Continuous phase, turns, ``(H, W)``, and the marks of `mark_steps`.
    use
        Regions that are large enough to look at.
    window
        Lowest and highest coordinate, px, ``(H, W)``, NaN: not known, ``(1, 1)``: none is; and
        the fringes' zero and period, px. Every fourth pixel is looked at.
    noise
        Variance of c times B^2: without light, per grey level, and the level without light.
    edge
        Bins at either end of the fringe that are left empty.
    patch, key, sums, along
        Place of each pixel's patch, -1 without one; ``(patches, 2)``, starting at -1;
        ``(patches, SUMS)``; ``(patches, bins, 2)`` weight and weighted c, bins over one turn
        from -pi on.
    """
    height, width = at.shape
    tiles = (width + TILE_COLUMNS - 1) // TILE_COLUMNS
    bins = along.shape[1]
    scale = np.float32(bins)
    spread = np.float32(noise[0]), np.float32(noise[1]), np.float32(noise[2])
    most = np.float32(saturation)
    low, high, right = window[0], window[1], goes_on[0]
    zero_px, per_px = np.float32(window[2]), np.float32(1 / window[3])
    windowed = low.size > 1
    for i in range(height):
        band = (i // TILE_ROWS) * tiles * SLOTS
        last_first, last_region, last_turn, place = -1, -1, np.float32(0), -1
        for j in range(width):
            r = region[i, j]
            if r < 0 or not use[r]:
                patch[i, j], last_region = -1, -1
                continue
            turns = at[i, j] + HALF
            turn, first = np.floor(turns), band + (j // TILE_COLUMNS) * SLOTS
            same = r == last_region and turn == last_turn and first == last_first
            if not (same and right[i, j]):
                place = _slot_at(at, region, goes_on, patch, key, (i, j, first))
            last_region, last_turn, last_first = r, turn, first
            patch[i, j] = place
            if place < 0:
                continue
            if windowed and (i + j) % 4 == 0 and low[i, j] == low[i, j]:
                sums[place, LOWEST] += (low[i, j] - zero_px) * per_px - at[i, j]
                sums[place, HIGHEST] += (high[i, j] - zero_px) * per_px - at[i, j]
                sums[place, WINDOWED] += ONE
            grey = np.float32(code[i, j])
            lag = int((turns - turn) * scale)
            if grey >= most or lag < edge or lag >= bins - edge:
                continue
            c, weight = code_and_weight(grey, offset[i, j], modulation[i, j], spread)
            along[place, lag, 0] += weight
            along[place, lag, 1] += weight * c
            sums[place, SQUARE] += weight * c * c
            sums[place, PIXELS] += ONE


@kernel
def score_starts(
    likelihood: Floats,
    owner: Integers,
    word: Integers,
    allowed: NDArray[np.bool_],
    weight: Floats,
    score: Floats,
    votes: Floats,
) -> None:
    """Add every patch's evidence to the starts of its region.

    Parameters
    ----------
    likelihood
        ``(patches, transfers, words)``.
    owner, weight
        Patches' regions and pixels.
    word, allowed
        ``(patches, starts)``: the word that a start gives a patch, and whether the window admits
        it, summed in `votes` ``(regions, starts)``.
    score
        ``(regions, transfers, starts)``.
    """
    patches, starts = word.shape
    for n in range(patches):
        r = owner[n]
        for k in range(starts):
            votes[r, k] += weight[n] if allowed[n, k] else ZERO
        for s in range(score.shape[1]):
            of_word, total = likelihood[n, s], score[r, s]
            for k in range(starts):
                total[k] += of_word[word[n, k]]


@kernel
def _add_link(link: Integers, place: int, other: int) -> None:
    """Count one more pixel along which a patch touches another."""
    for n in range(MOST_LINKS):
        if link[place, n, 1] == 0:
            link[place, n, 0] = other
        if link[place, n, 0] == other:
            link[place, n, 1] += 1
            return


@kernel
def link_patches(
    patch: Integers, goes_on: tuple[Marks, Marks], key: Integers, link: Integers
) -> None:
    """Fill `link` ``(slots, MOST_LINKS, 2)``: which patches go on in which, along how many pixels.

    It starts at zero.
    """
    height, width = patch.shape
    right, down = goes_on
    for i in range(height):
        for j in range(width):
            here = patch[i, j]
            left, above = patch[i, max(j - 1, 0)], patch[max(i - 1, 0), j]
            if here < 0 or (left == here and above == here):
                continue
            for other, mark in ((left, right[i, j]), (above, down[i, j])):
                if mark and other >= 0 and other != here and key[other, 0] == key[here, 0]:
                    _add_link(link, here, other)
                    _add_link(link, other, here)


@kernel
def sum_around(
    place: Integers, number: Integers, link: Integers, score: Floats, around: Floats
) -> None:
    """Sum the ``(patches, starts)`` scores of each patch and those that it is linked to.

    `place` is a patch's place among all slots, `number` the patch of each place, -1 for none.
    """
    for n in range(place.size):
        around[n] = score[n]
        for m in range(MOST_LINKS):
            other, pixels = link[place[n], m]
            if pixels >= LEAST_LINK:
                for k in range(score.shape[1]):
                    around[n, k] += score[number[other], k]


@kernel
def write_orders(
    patch: Integers,
    turns: Integers,
    start: Integers,
    confidence: Floats,
    order: Integers,
    margin: Floats,
) -> None:
    """Orders and margins of all pixels from their patches'; -1 and NaN where there are none.

    Per place: `start` is what to add to a pixel's turns; `confidence` is NaN where nobody knows.
    """
    height, width = patch.shape
    for i in range(height):
        for j in range(width):
            n = patch[i, j]
            known = n >= 0 and confidence[n] == confidence[n]
            order[i, j] = turns[i, j] + start[n] if known else -1
            margin[i, j] = confidence[n] if known else NAN
