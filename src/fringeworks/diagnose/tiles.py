"""Parts of the image on which a surface is smooth enough for a polynomial."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import CodedAxis

LEAST_PIXELS = 400
MOST_PIXELS = 4000
FULL_SHARE = 0.6
"""Of its pixels that a tile must have decoded."""

SMOOTH = 0.25
"""Of the period: a step of the coordinate between neighbours beyond the usual is an edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """A square part of the image without an edge in it.

    Attributes
    ----------
    rows, columns
        Where it is.
    y, x
        ``(n,)`` rows and columns of decoded pixels, of many at most about `MOST_PIXELS`.
    """

    rows: slice
    columns: slice
    y: NDArray[np.intp]
    x: NDArray[np.intp]

    def places(self) -> NDArray[np.float64]:
        """``(x, y)`` of all its pixels ``(n, 2)``, row by row."""
        y, x = np.mgrid[self.rows, self.columns]
        return np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)


def cut_tiles(axis: CodedAxis, *, span_px: float) -> list[Tile]:
    """Square parts of an axis's map that span about so many projector px each."""
    steps = np.abs(np.diff(axis.coordinate, axis=1 if axis.axis == "x" else 0))
    usual = float(np.nanmedian(steps)) if np.isfinite(steps).any() else 0.0
    if not usual > 0:
        return []
    side = int(np.clip(span_px / usual, 24, min(axis.coordinate.shape)))
    return list(_tiles(axis, side, usual))


def _tiles(axis: CodedAxis, side: int, usual: float) -> Iterator[Tile]:
    height, width = axis.coordinate.shape
    period = axis.phase.wrapped.fringe.period_px if axis.phase is not None else 4 * usual
    for rows in _parts(height, side):
        for columns in _parts(width, side):
            part = axis.coordinate[rows, columns]
            known = np.isfinite(part)
            if known.mean() < FULL_SHARE or known.sum() < LEAST_PIXELS:
                continue
            jumps = np.concatenate([np.abs(np.diff(part, axis=n)).ravel() for n in (0, 1)])
            if np.nanmax(jumps) > SMOOTH * period + 3 * usual:
                continue
            y, x = np.nonzero(known)
            step = 1 + len(y) // MOST_PIXELS
            yield Tile(rows, columns, y[::step] + rows.start, x[::step] + columns.start)


def _parts(extent: int, side: int) -> list[slice]:
    """Equal parts of an image's height or width, each at least `side`."""
    edges = np.linspace(0, extent, max(extent // side, 1) + 1).astype(int)
    return [slice(int(one), int(other)) for one, other in pairwise(edges)]
