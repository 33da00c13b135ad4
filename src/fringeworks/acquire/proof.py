"""Reads the corner code in camera frames (`patterns.corner_code`): the proof of what they show.

Where the camera sees each cell is found once, from a few images in which every cell blinks its
own number; no shape of the scene is assumed. A corner counts if all its cells are seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DeviceError
from fringeworks.model import Frames
from fringeworks.patterns.corner_code import CELLS, CORNERS, CornerCode, number_of

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]


class UnseenError(DeviceError):
    """No corner is seen whole."""


Take: TypeAlias = Callable[[Frames], Frames]
"""Shows an image and gives the frame that shows it for certain."""

LABEL_BITS = (CORNERS * CELLS).bit_length()
LEAST_STEP = 0.04
"""From black to white, as a share of the camera's full scale, where a cell is seen."""

CORE = 0.25
"""Pixels whose light is farther than this share of the step from black and white are not read."""

LEAST_PIXELS = 4
"""Of a cell; where there are more, the clearer half is read."""

LEAST_SHARE = 0.75
"""Difference within each pair, as a share of the largest: less is a mixture of two images.

Blur alone, by an eighth of a cell, brings it down to 0.8.
"""

BLANK_STEP = 0.015
"""Pixels that see more of the code than this share of the full scale are no measurement."""

BLANK_REACH_PX = 5
"""Side of the square over which that is averaged."""

TRIAL = 0b01011010


@dataclass(frozen=True, slots=True, eq=False)
class CodeReader:
    """Where a camera sees the code.

    Attributes
    ----------
    corners
        How many corners are seen.
    pixels, cells
        ``(n,)`` flat indices of pixels that each see one cell, and which of the seen ones.
    black, step
        ``(corners * CELLS,)`` grey levels of each cell when black, and what white adds.
    touched
        ``(H, W)`` pixels that see anything of the code.
    """

    corners: int
    pixels: NDArray[np.int64]
    cells: NDArray[np.int64]
    black: Floats
    step: Floats
    touched: Flags

    def read(self, frame: Frames) -> int | None:
        """The number in ``(H, W[, 3])``; None if it has none, or several, or mixed ones."""
        levels = self._mean(to_grey(frame))
        differences = self._differences(levels)
        # Another exposure than that of the code's finding: by the brightness of what it looks like.
        first = differences > 0
        likely = self.black + self.step * np.stack([first, ~first], axis=2).ravel()
        differences = self._differences(levels * (likely @ likely) / (likely @ levels or 1))
        size = np.abs(differences)
        if (size < LEAST_SHARE * size.max(axis=1, keepdims=True)).any():
            return None
        numbers = {number_of(row) for row in differences > 0}
        return numbers.pop() if len(numbers) == 1 else None

    def blank(self, frame: Frames) -> Frames:
        """A copy in which the pixels that see the code are 0: they would pass for fringes."""
        blanked = frame.copy()
        blanked[self.touched] = 0
        return blanked

    def _differences(self, levels: Floats) -> Floats:
        """``(corners, CELLS // 2)`` by how much of its step each pair's first cell is brighter."""
        light = ((levels - self.black) / self.step).reshape(self.corners, CELLS // 2, 2)
        differences: Floats = light[:, :, 0] - light[:, :, 1]
        return differences

    def _mean(self, grey: Floats) -> Floats:
        return _mean_by_cell(grey.ravel()[self.pixels], self.cells, self.corners)


def find_code(code: CornerCode, take: Take, *, bits: int, full_scale: float) -> CodeReader:
    """Where a camera of this full scale sees the code of a projector of this depth.

    Shows `LABEL_BITS` + 4 images.

    Raises
    ------
    UnseenError
        No corner is seen.
    DeviceError
        What is seen is not read.
    """
    white = 2**bits - 1
    size = (code.height, code.width)
    dark: Frames = np.zeros(size, np.uint8) if bits == 8 else np.zeros(size, np.uint16)

    def look(lit: Flags) -> Floats:
        return to_grey(take(code.light(dark, lit, white=white)))

    labels = np.arange(1, CORNERS * CELLS + 1)
    black, bright = look(labels < 0), look(labels > 0)
    touched = _touched(to_grey(take(code.fill(dark, white))) - black, full_scale)
    step = bright - black
    seen = step > LEAST_STEP * full_scale
    found, doubt = np.zeros(black.shape, np.int64), np.zeros(black.shape)
    for place in range(LABEL_BITS):
        share = (look(labels >> place & 1 > 0) - black) / np.where(seen, step, np.inf)
        doubt = np.maximum(doubt, np.minimum(np.abs(share), np.abs(1 - share)))
        found |= (share > 1 / 2).astype(np.int64) << place
    found = _clear(np.where(seen & (doubt < CORE), found, 0), doubt)
    reader = _reader(found, black=black, step=step, touched=touched)
    told = reader.read(take(code.stamp(dark, TRIAL, white=white)))
    if told != TRIAL:
        raise DeviceError(
            f"the corner code is seen in {reader.corners} corners but not read (showed {TRIAL}, "
            f"read {told}); hold the scene still, or raise settle_ms in [timing]"
        )
    return reader


def to_grey(frame: Frames) -> Floats:
    """``(H, W)`` means of the channels."""
    levels = frame.astype(np.float64)
    return levels.mean(axis=2) if frame.ndim == 3 else levels


def _clear(found: NDArray[np.int64], doubt: Floats) -> NDArray[np.int64]:
    """The same with the clearer half of each cell's pixels alone, 0 elsewhere."""
    labels = found.ravel()
    counts = np.bincount(labels, minlength=2**LABEL_BITS)
    order = np.lexsort((doubt.ravel(), labels))
    rank = np.empty(labels.size, np.int64)
    rank[order] = np.arange(labels.size) - (np.cumsum(counts) - counts)[labels[order]]
    clear = rank < np.maximum(counts / 2, LEAST_PIXELS)[labels]
    return np.where(clear, labels, 0).reshape(found.shape)


def _reader(found: NDArray[np.int64], *, black: Floats, step: Floats, touched: Flags) -> CodeReader:
    counts = np.bincount(found.ravel(), minlength=2**LABEL_BITS)[1 : 1 + CORNERS * CELLS]
    cells_seen = counts.reshape(CORNERS, CELLS) >= LEAST_PIXELS
    corners = np.flatnonzero(cells_seen.all(axis=1))
    if not corners.size:
        best = int(cells_seen.sum(axis=1).max())
        raise UnseenError(
            f"no corner of the projected image is seen whole (of the best one {best} of {CELLS} "
            "cells are); the corner code needs one in the camera's view, bright and not saturated: "
            "move the camera, or do without --proof"
        )
    whose, cell = np.divmod(found - 1, CELLS)
    pixels = np.flatnonzero(np.isin(whose, corners) & (found > 0))
    cells = np.searchsorted(corners, whose.ravel()[pixels]) * CELLS + cell.ravel()[pixels]
    levels = [_mean_by_cell(grey.ravel()[pixels], cells, len(corners)) for grey in (black, step)]
    return CodeReader(len(corners), pixels, cells, levels[0], levels[1], touched)


def _mean_by_cell(values: Floats, cells: NDArray[np.int64], corners: int) -> Floats:
    counts = np.bincount(cells, minlength=corners * CELLS)
    means: Floats = np.bincount(cells, values, minlength=corners * CELLS) / counts
    return means


def _touched(step: Floats, full_scale: float) -> Flags:
    import cv2

    reach = (BLANK_REACH_PX, BLANK_REACH_PX)
    near: Any = cv2.blur(step, reach)
    touched: Flags = near > BLANK_STEP * full_scale
    return touched
