"""Branch cuts (Goldstein, Zebker and Werner 1988): barriers between residues that balance.

A residue is a loop of four pixels round which the wrapped steps do not add up to zero: one turn
is gained or lost. A path between two residues of opposite sign, or from one to the ground, must
not be crossed. Loops are named after their lower right pixel, ``(H + 1, W + 1)`` of them with
those at the image's rim; a loop that has a void pixel, or reaches over the rim, is ground.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.spatial import ABOVE, LEFT, turns_between

Floats = NDArray[np.float32]
Charges = NDArray[np.int8]
Marks = NDArray[np.uint8]

GROUND = np.int8(2)
LONGEST_SEARCH = 64
"""Boxes grow to this many pixels; what finds nothing in them is cut to the image's rim."""


@kernel
def find_charges(phase: Floats, charges: Charges) -> int:
    """Turns gained round each loop, ``(H + 1, W + 1)``: -1, 0, 1 or `GROUND`; how many residues."""
    height, width = phase.shape
    charges[:] = GROUND
    count = 0
    for i in range(1, height):
        above, here, out = phase[i - 1], phase[i], charges[i]
        for j in range(1, width):
            gained = (
                turns_between(above[j - 1], above[j])
                + turns_between(above[j], here[j])
                + turns_between(here[j], here[j - 1])
                + turns_between(here[j - 1], above[j - 1])
            )
            total = above[j - 1] + above[j] + here[j] + here[j - 1]
            out[j] = GROUND if math.isnan(total) else np.int8(gained)
            count += out[j] != 0 and out[j] != GROUND
    return count


@kernel
def grow_boxes(charges: Charges, count: int, broken: Marks) -> None:
    """Cut from each residue to the nearest of opposite sign, or to ground, nearest pairs first.

    Boxes about all `count` residues grow together, so that short cuts are made before long ones.
    Balanced residues become zero in `charges`; links that cuts cross are marked in `broken`.
    """
    live = _list_residues(charges, count)
    for reach in range(1, LONGEST_SEARCH + 1):
        left = 0
        for n in range(count):
            i, j = live[n]
            if charges[i, j] == 0:
                continue
            at_i, at_j = _nearest_on_box(charges, i, j, reach)
            if at_i < 0:
                live[left] = i, j
                left += 1
                continue
            _cut(broken, (i, j), (at_i, at_j))
            charges[i, j] = 0
            if charges[at_i, at_j] != GROUND:
                charges[at_i, at_j] = 0
        count = left
    height, width = broken.shape
    for n in range(count):
        i, j = live[n]
        if charges[i, j] != 0:
            _cut(broken, (i, j), _nearest_rim(i, j, height, width))
            charges[i, j] = 0


@kernel
def _list_residues(charges: Charges, count: int) -> NDArray[np.int32]:
    """Places ``(count, 2)`` of all residues."""
    places = np.empty((count, 2), np.int32)
    n = 0
    for i in range(charges.shape[0]):
        for j in range(charges.shape[1]):
            if charges[i, j] != 0 and charges[i, j] != GROUND:
                places[n] = i, j
                n += 1
    return places


@kernel
def _nearest_on_box(charges: Charges, i: int, j: int, reach: int) -> tuple[int, int]:
    """What balances the residue at (i, j) on the rim of the box about it; (-1, -1) if nothing."""
    rows, columns = charges.shape
    charge = np.int64(charges[i, j])
    best, at_i, at_j = 2 * reach + 1, -1, -1
    for row in range(max(i - reach, 0), min(i + reach, rows - 1) + 1):
        whole = abs(row - i) == reach
        stride = 1 if whole else 2 * reach
        for column in range(j - reach, j + reach + 1, stride):
            if 0 <= column < columns:
                found = charges[row, column]
                away = abs(row - i) + abs(column - j)
                if (charge + found == 0 or found == GROUND) and away < best:
                    best, at_i, at_j = away, row, column
    return at_i, at_j


@kernel
def _nearest_rim(i: int, j: int, height: int, width: int) -> tuple[int, int]:
    """The loop at the image's rim that is nearest to (i, j)."""
    vertical, horizontal = min(i, height - i), min(j, width - j)
    if vertical <= horizontal:
        return (0 if i <= height - i else height), j
    return i, (0 if j <= width - j else width)


@kernel
def _cut(broken: Marks, start: tuple[int, int], end: tuple[int, int]) -> None:
    """Mark the links that the straight way between two loops crosses."""
    height, width = broken.shape
    (i, j), (to_i, to_j) = start, end
    while i != to_i or j != to_j:
        if abs(to_i - i) >= abs(to_j - j):
            step = 1 if to_i > i else -1
            row = min(i, i + step)
            if 0 <= row < height and 0 <= j < width:
                broken[row, j] |= LEFT
            i += step
        else:
            step = 1 if to_j > j else -1
            column = min(j, j + step)
            if 0 <= i < height and 0 <= column < width:
                broken[i, column] |= ABOVE
            j += step
