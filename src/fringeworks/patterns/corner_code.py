"""A code in the corners of a projected image, by which a camera frame itself tells what it shows.

Twelve pairs of cells, one white and one black each: the first pair is always the same, eight hold
the number in the reflected binary code, three its checksum. What is read is the difference within
a pair, so that neither exposure nor other light matters, and every number sends out the same
light: nothing else in the scene changes with it. The four corners bear the same code. Displays
and rolling shutters work from edge to edge, so that a frame between two images has two codes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Frames
from fringeworks.patterns.checks import require

Bools: TypeAlias = NDArray[np.bool_]

ROWS, COLUMNS = 4, 6
CELLS = ROWS * COLUMNS
"""Of one corner."""

CORNERS = 4
NUMBER_BITS = 8
NUMBERS = 2**NUMBER_BITS
"""Numbers begin anew after so many: frames are mistaken for near ones."""

CHECK_BITS = 3
CHECK_WEIGHTS = (1, 2, 3, 4, 5, 6, 7, 7)
"""What each bit adds to the checksum, modulo 2: a wrong bit always shows."""

LEAST_CELL_PX = 4
CELLS_ALONG = 64
"""Cells that would fit along the shorter side of the image."""


@dataclass(frozen=True, slots=True)
class CornerCode:
    """The code in an image of this size, px.

    `inset` is its distance from the edges, as a share of the image: a camera need not see those.

    Raises
    ------
    UsageError
        The image is too small for four corners.
    """

    width: int
    height: int
    inset: float = 0.0

    def __post_init__(self) -> None:
        least = (2 * LEAST_CELL_PX * (COLUMNS + 2), 2 * LEAST_CELL_PX * (ROWS + 2))
        require(
            self.width >= least[0] and self.height >= least[1],
            "projector",
            expected=f"{least[0]}x{least[1]} px or more for a corner code",
            actual=f"{self.width}x{self.height}",
        )

    @property
    def cell_px(self) -> int:
        """Side of a cell."""
        return max(LEAST_CELL_PX, math.ceil(min(self.width, self.height) / CELLS_ALONG))

    def stamp(self, image: Frames, number: int, *, white: int) -> Frames:
        """A copy of ``(height, width[, 3])`` with a number, modulo `NUMBERS`, in its corners."""
        return self.light(image, np.tile(cells_of(number), CORNERS), white=white)

    def light(self, image: Frames, lit: Bools, *, white: int) -> Frames:
        """A copy with these cells ``(CORNERS * CELLS,)`` at the level `white`, the others black."""
        stamped = image.copy()
        for corner, cells in enumerate(lit.reshape(CORNERS, ROWS, COLUMNS)):
            stamped[self._place(corner)] = self._patch(cells, image.ndim) * white
        return stamped

    def fill(self, image: Frames, level: int) -> Frames:
        """A copy with all of the corners, the black border too, at one level."""
        filled = image.copy()
        for corner in range(CORNERS):
            filled[self._place(corner)] = level
        return filled

    def _place(self, corner: int) -> tuple[slice, slice]:
        rows, columns = self.cell_px * (ROWS + 2), self.cell_px * (COLUMNS + 2)
        down = min(int(self.inset * self.height), self.height // 2 - rows)
        across = min(int(self.inset * self.width), self.width // 2 - columns)
        below, right = divmod(corner, 2)
        top = self.height - rows - down if below else down
        left = self.width - columns - across if right else across
        return slice(top, top + rows), slice(left, left + columns)

    def _patch(self, cells: Bools, dimensions: int) -> NDArray[Any]:
        """Cells, with a black border of one cell between them and the image."""
        patch = np.kron(np.pad(cells, 1), np.ones((self.cell_px, self.cell_px), np.int64))
        return patch if dimensions == 2 else patch[:, :, np.newaxis]


def cells_of(number: int) -> Bools:
    """Which cells ``(CELLS,)`` a number, modulo `NUMBERS`, lights: pair by pair."""
    number %= NUMBERS
    gray = number ^ (number >> 1)
    bits = [bool(gray >> place & 1) for place in range(NUMBER_BITS)]
    pairs = np.array([True, *bits, *_checksum(bits)])
    return np.stack([pairs, ~pairs], axis=1).ravel()


def number_of(pairs: Bools) -> int | None:
    """The number of pairs ``(CELLS // 2,)``, True where the first cell is the brighter one.

    None if they are no code.
    """
    first, *bits = (bool(pair) for pair in pairs[: 1 + NUMBER_BITS])
    if not first or _checksum(bits) != [bool(pair) for pair in pairs[1 + NUMBER_BITS :]]:
        return None
    gray = sum(bit << place for place, bit in enumerate(bits))
    return reduce(xor, (gray >> place for place in range(NUMBER_BITS)))


def _checksum(bits: Iterable[bool]) -> list[bool]:
    total = reduce(xor, (w for w, bit in zip(CHECK_WEIGHTS, bits, strict=True) if bit), 0)
    return [bool(total >> place & 1) for place in range(CHECK_BITS)]
