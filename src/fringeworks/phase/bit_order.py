"""Whether a Gray code's frames are listed in their order, by what its bits do across the image.

Between neighbouring pixels a reflected code changes one bit at a time, and each such change leads
to the next cell. With bits out of order the edges of those bits lead anywhere else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Axis, Capture, Frames, Fringe, GrayCode
from fringeworks.phase.gray import (
    Contrast,
    contrast_at,
    inverted_contrast,
    mean_repeats,
    uniform_contrast,
)

Bits = NDArray[np.bool_]

LEAST_MODULATION = 0.05
"""Of full scale: darker pixels do not take part."""

LEAST_EDGES = 30
"""Pixel pairs; a bit with fewer edges in view says nothing."""

MOST_PAIRS = 20_000
WRONG_SHARE = 0.5
"""Of a bit's edges those that lead to no neighbouring cell: where it stands in the wrong place
nearly all. Depth steps and noise in the finest bits lead up to 0.6 astray on procam-graycode."""

BETTER = 0.6
"""Another order must leave less than so much of that."""


def find_bit_order(capture: Capture, axis: Axis) -> tuple[int, ...] | None:
    """The order in which the bits of an axis's Gray code fit together, most significant first.

    Returns
    -------
    order
        Places in the list of frames; None where the order listed fits, or where none fits better
        (the reverse and every exchange of two are tried); for a code of one bit, without a code,
        and without a threshold too.
    """
    entry = next((e for e in capture.find(GrayCode) if e[0].axis == axis), None)
    if entry is None or entry[0].bits == 1:
        return None
    code, frames, repeats = entry
    frames = mean_repeats(frames, repeats)
    contrast = _contrast(capture, code, frames)
    if contrast is None:
        return None
    least = LEAST_MODULATION * capture.sensor.full_scale
    edges = _single_changes(frames[: code.bits], contrast, least)
    astray = _worst_share(edges, range(code.bits))
    if astray < WRONG_SHARE:
        return None
    share, best = min((_worst_share(edges, order), order) for order in _orders(code.bits))
    return best if share < BETTER * astray else None


def _contrast(capture: Capture, code: GrayCode, frames: Frames) -> Contrast | None:
    """Of white and black, of the inverses, else of fringes: their mean and half their span."""
    shown = next(item for item in capture.sequence.sets if item.pattern == code)
    seen = uniform_contrast(capture)
    contrast = (
        inverted_contrast(code, frames) if seen is None else contrast_at(seen, shown, capture)
    )
    fringes = next((stack for _, stack, _ in capture.find(Fringe)), None)
    if contrast is not None or fringes is None:
        return contrast
    span = fringes.max(axis=0).astype(np.float32) - fringes.min(axis=0)
    return Contrast(fringes.mean(axis=0, dtype=np.float32), span / 2)


def _single_changes(frames: Frames, contrast: Contrast, least: float) -> tuple[Bits, Bits]:
    """Bits ``(n, pairs)`` of lit neighbours that differ in one bit, on either side."""
    lit = contrast.modulation >= least
    bits = frames > contrast.offset
    sides = []
    for near, far in (
        ((slice(None), slice(-1)), (slice(None), slice(1, None))),
        ((slice(-1), slice(None)), (slice(1, None), slice(None))),
    ):
        first, second = bits[:, *near], bits[:, *far]
        use = lit[near] & lit[far] & ((first != second).sum(axis=0) == 1)
        sides.append((first[:, use], second[:, use]))
    pairs = [np.concatenate(parts, axis=1) for parts in zip(*sides, strict=True)]
    step = 1 + pairs[0].shape[1] // MOST_PAIRS
    return pairs[0][:, ::step], pairs[1][:, ::step]


def _worst_share(edges: tuple[Bits, Bits], order: Sequence[int]) -> float:
    """Of the edges of one bit the share that leads to no neighbouring cell, for the worst bit."""
    first, second = (side[list(order)] for side in edges)
    changed = first != second
    astray = np.abs(_index(first) - _index(second)) != 1
    counts = changed.sum(axis=1)
    told = counts >= LEAST_EDGES
    shares = (changed & astray).sum(axis=1)[told] / counts[told]
    return float(shares.max(initial=0.0))


def _index(bits: Bits) -> NDArray[np.int64]:
    """``(pairs,)`` cells of reflected code words ``(n, pairs)``."""
    plain = np.logical_xor.accumulate(bits, axis=0)
    weights = 2 ** np.arange(len(bits))[::-1]
    return np.asarray(weights @ plain, dtype=np.int64)


def _orders(bits: int) -> Iterator[tuple[int, ...]]:
    yield tuple(range(bits))[::-1]
    for one, other in combinations(range(bits), 2):
        order = list(range(bits))
        order[one], order[other] = other, one
        yield tuple(order)
