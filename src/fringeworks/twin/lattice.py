"""What a projector's pixels look like: squares, diamonds, or none.

Diamond pixels (DLP3000): pixel (c, r) stands at u = c + (r odd) / 2, v = r and covers
``|du| / 0.5 + |dv| <= 1``, which tiles the plane. A strip, an image that is constant along one
axis, needs only one period of the lattice across: there every pixel is a box, whose width changes
with the place across.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Axis
from fringeworks.twin.effects import Lattice

Array: TypeAlias = NDArray[np.float64]
F = TypeVar("F", bound=np.floating)

PER_PX = 8
"""Samples of a strip per projector pixel, along and across."""

FINER = 4
"""Samples across, per sample of the strip, from which the point spread across is summed."""

LINEAR_VARIANCE = 1 / (6 * PER_PX**2)
"""Variance, px^2, that reading between samples on straight lines adds to a point spread."""

SIGMAS_KEPT = 5.0
NODES = 8
"""Pixels from which light without a lattice is interpolated."""


@dataclass(frozen=True, slots=True, eq=False)
class StripResponse:
    """Light of one pixel of a strip about its place.

    Attributes
    ----------
    pixels
        Which pixels of the strip have it: all, or every other one.
    taps
        ``(2 reach + 1, levels, across, PER_PX)`` float32: the share of a pixel's light that its
        neighbour, -reach .. reach pixels further along, receives in each of its samples.
    """

    pixels: slice
    taps: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class _Boxes:
    """What some pixels of a strip cover: boxes along it, as wide as the place across makes them."""

    pixels: slice
    offsets: tuple[float, ...]
    widths: tuple[Array, ...]


def strip_responses(
    lattice: Lattice, axis: Axis, *, along_px: Array, across_px: Array
) -> list[StripResponse]:
    """Responses of strips whose light varies along `axis`.

    `along_px` and `across_px` are the standard deviations of the point spread, projector px, one
    each per level.
    """
    period = _period_px(lattice, axis)
    count = period * PER_PX
    fine = (np.arange(count * FINER) + 0.5) / (PER_PX * FINER)
    spread = np.stack([_spread_across(fine, count, period, sigma) for sigma in across_px])
    if lattice == "square":  # nothing changes across
        fine, spread = np.zeros(1), np.ones((len(across_px), 1, 1))
    sigmas = np.sqrt(np.maximum(along_px**2 - LINEAR_VARIANCE, 0))
    return [
        StripResponse(boxes.pixels, _taps(boxes, sigmas, spread))
        for boxes in _boxes(lattice, axis, fine)
    ]


def _period_px(lattice: Lattice, axis: Axis) -> int:
    return 2 if lattice == "diamond" and axis == "x" else 1


def _boxes(lattice: Lattice, axis: Axis, across: Array) -> list[_Boxes]:
    every, even, odd = slice(None), slice(0, None, 2), slice(1, None, 2)
    if lattice == "square":
        return [_Boxes(every, (0.0,), (np.ones_like(across),))]
    if axis == "x":
        odd_share = np.abs(across - 2 * np.round(across / 2))
        return [_Boxes(every, (0.0, 0.5), (1 - odd_share, odd_share))]
    from_even = np.abs(across - np.round(across))
    return [
        _Boxes(even, (0.0,), (2 - 4 * from_even,)),
        _Boxes(odd, (0.0,), (4 * from_even,)),
    ]


def _spread_across(fine: Array, count: int, period: int, sigma: float) -> Array:
    """Weights ``(count, fine)`` of a Gaussian around the circle of one period."""
    places = (np.arange(count) + 0.5) / PER_PX
    sigma = max(sigma, 1 / (PER_PX * FINER))
    turns = math.ceil(SIGMAS_KEPT * sigma / period) + 1
    images = period * np.arange(-turns, turns + 1)
    distance = places[:, None, None] - fine[None, :, None] + images
    weights = np.exp(-(distance**2) / (2 * sigma**2)).sum(axis=-1)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _taps(boxes: _Boxes, sigmas: Array, spread: Array) -> NDArray[np.float32]:
    """Boxes spread along in closed form and across by sums."""
    widest = max(float(widths.max()) for widths in boxes.widths)
    reach = math.ceil(SIGMAS_KEPT * float(sigmas.max()) + widest / 2 + 0.5)
    neighbours = np.arange(-reach, reach + 1)
    samples = (np.arange(PER_PX) + 0.5) / PER_PX - 0.5
    # A neighbour d further along sees this pixel at -d: taps are in the order of a dot product.
    x = samples - neighbours[:, None]
    light = np.stack(
        [
            sum(
                _spread_box(x - offset, widths, sigma)
                for offset, widths in zip(boxes.offsets, boxes.widths, strict=True)
            )
            for sigma in sigmas
        ]
    )
    taps = np.einsum("liq,lqtj->tlij", spread, light)
    return np.ascontiguousarray(taps, dtype=np.float32)


def _spread_box(x: Array, widths: Array, sigma: float) -> Array:
    """Light ``(widths, *x)`` at `x` of boxes about zero after a Gaussian."""
    from scipy.special import erf

    half = widths[:, None, None] / 2
    if sigma == 0:
        return 0.5 * (np.sign(x + half) - np.sign(x - half))
    scale = 1 / (math.sqrt(2) * sigma)
    return np.asarray(0.5 * (erf((x + half) * scale) - erf((x - half) * scale)))


def spread_strip(
    light: NDArray[np.float32], responses: list[StripResponse], margin: int
) -> NDArray[np.float32]:
    """Light ``(levels, across, (n + 2 margin) PER_PX)`` of a strip of n pixels, dark around."""
    cells = len(light) + 2 * margin
    _, levels, across, _ = responses[0].taps.shape
    total = np.zeros((cells, levels * across * PER_PX), np.float32)
    for response in responses:
        count = len(response.taps)
        padded = np.zeros(cells + count - 1, np.float32)
        inner = padded[margin + count // 2 :][: len(light)]
        inner[response.pixels] = light[response.pixels]
        windows = np.lib.stride_tricks.sliding_window_view(padded, count)
        total += np.ascontiguousarray(windows) @ response.taps.reshape(count, -1)
    folded = total.reshape(cells, levels, across, PER_PX).transpose(1, 2, 0, 3)
    return np.ascontiguousarray(folded).reshape(levels, across, cells * PER_PX)


def interpolate(light: NDArray[F], per_px: int, margin: int) -> NDArray[F]:
    """Smooth light through pixel centres, along the first axis: ``((n + 2 margin) per_px, ...)``.

    Lagrange's polynomial through the nearest `NODES` pixels, held to 0 .. 1. A sinusoid of 16 px
    is right to 1e-6 of its modulation between the pixels, and to 1e-4 in the half pixel outside
    the last centre; beyond the image's edge the light stays what it is there.
    """
    count = len(light)
    nodes = min(NODES, count)
    places = (np.arange((count + 2 * margin) * per_px) + 0.5) / per_px - 0.5 - margin
    beyond = 0.5 + 0.5 / per_px
    places = np.clip(places, -beyond, count - 1 + beyond)
    first = np.clip(np.floor(places).astype(np.int64) - nodes // 2 + 1, 0, count - nodes)
    weights = _lagrange(places - first, nodes)
    total = np.zeros((len(places), *light.shape[1:]), light.dtype)
    for node in range(nodes):
        column = weights[:, node].reshape(-1, *[1] * (light.ndim - 1)).astype(light.dtype)
        total += column * light[first + node]
    return total.clip(0, 1)


def _lagrange(x: Array, nodes: int) -> Array:
    """Weights ``(n, nodes)`` of values at 0, 1, ... for the polynomial's value at `x`."""
    weights = np.ones((len(x), nodes))
    for node in range(nodes):
        for other in range(nodes):
            if other != node:
                weights[:, node] *= (x - other) / (node - other)
    return weights
