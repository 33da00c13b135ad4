"""What every patch of an image says of every codeword.

A patch is what a tile of the image holds of one fringe of one surface. The wrapped phase is the
abscissa: where in its fringe a pixel lies is known to a fraction of a projector pixel whatever the
surface's slope, and c = (I - A) / B has neither its texture nor ambient light in it (methods page,
The code frame, decoded well).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels import codeframe as kernels
from fringeworks.kernels.surface import mark_steps, smooth_phase
from fringeworks.model import Codeword, FloatMap, Frames, UnwrappedPhase, WrappedPhase
from fringeworks.model.phase import OrderMap
from fringeworks.phase.window import CoordinateWindow

LEAST_PIXELS = 100
"""Smaller regions decide nothing: what the masks leave there is no sample of the noise."""

ALIKE_TURNS = 0.125
"""Neighbours further apart than this, their slope apart, are not of one surface."""

LEAST_JUMP_TURNS, MOST_JUMP_TURNS = 0.1, 0.3
"""A step beyond the slope that ends a surface, whatever the noise."""

SAMPLED = 101
"""Every so many pixels tell the noise of the phase."""

BINS_PER_WAVE = 4
"""Bins in the shortest codeword's period: each then holds nine tenths of its amplitude."""

EDGE_PX = 1.5
"""Nearer to its fringe's edge, projector px, blur brings in the next codeword."""


@dataclass(frozen=True, slots=True)
class Patches:
    """Sums over the n patches of an image.

    Attributes
    ----------
    at
        ``(H, W)``: continuous phase, smoothed, turns.
    index
        ``(H, W)``: place of each pixel's patch among the slots of all tiles, -1 without one.
    slots, tiles
        Number of slots, and of tiles side by side.
    place, region, turn
        ``(n,)``.
    link
        ``(slots, most, 2)``: places of the patches in which one goes on, and along how many pixels.
    pixels, square
        ``(n,)``: pixels that show the code, and the sum of their weighted c^2.
    weight, code
        ``(n, bins)`` along the fringe: weights, and weighted c.
    low, high
        ``(n,)``: mean of what the window admits to be added to the turns; NaN where it says
        nothing.
    """

    at: FloatMap
    index: OrderMap
    slots: int
    tiles: int
    place: OrderMap
    region: OrderMap
    turn: OrderMap
    link: OrderMap
    pixels: FloatMap
    square: FloatMap
    weight: FloatMap
    code: FloatMap
    low: FloatMap
    high: FloatMap


def gather_patches(
    image: Frames | FloatMap,
    code: Codeword,
    unwrapped: UnwrappedPhase,
    *,
    window: CoordinateWindow | None,
    saturation: float,
) -> Patches:
    """Gather the pixels of a code frame ``(H, W)`` along the fringes under it.

    Weights are one over the variance of c (`code_noise`).
    """
    wrapped = unwrapped.wrapped
    height, width = wrapped.phase.shape
    tiles = -(-width // kernels.TILE_COLUMNS)
    slots = tiles * -(-height // kernels.TILE_ROWS) * kernels.SLOTS
    bins = round(BINS_PER_WAVE * code.period_px / min(code.codewords_px))
    at, index = np.empty((height, width), np.float32), np.empty((height, width), np.int32)
    smooth_phase(wrapped.phase, unwrapped.turns, ALIKE_TURNS, at)
    goes_on = np.empty(at.shape, np.uint8), np.empty(at.shape, np.uint8)
    mark_steps(at, _jump_turns(wrapped), *goes_on)
    key, sums = np.full((slots, 2), -1, np.int32), np.zeros((slots, kernels.SUMS), np.float32)
    along = np.zeros((slots, bins, 2), np.float32)
    kernels.gather_patches(
        image,
        at,
        goes_on,
        wrapped.offset,
        wrapped.modulation,
        unwrapped.region,
        _large_regions(unwrapped),
        _window_of(window, code),
        code_noise(wrapped),
        saturation,
        edge_bins(code, bins),
        index,
        key,
        sums,
        along,
    )
    link = np.zeros((slots, kernels.MOST_LINKS, 2), np.int32)
    kernels.link_patches(index, goes_on, key, link)
    place = np.flatnonzero(key[:, 0] >= 0).astype(np.int32)
    sums, along = sums[place], along[place]
    with np.errstate(invalid="ignore", divide="ignore"):
        low, high = sums[:, [kernels.LOWEST, kernels.HIGHEST]].T / sums[:, kernels.WINDOWED]
    return Patches(
        at=at,
        index=index,
        slots=slots,
        tiles=tiles,
        place=place,
        region=key[place, 0],
        turn=key[place, 1],
        link=link,
        pixels=sums[:, kernels.PIXELS],
        square=sums[:, kernels.SQUARE],
        weight=along[:, :, 0],
        code=along[:, :, 1],
        low=low.astype(np.float32),
        high=high.astype(np.float32),
    )


def _jump_turns(wrapped: WrappedPhase) -> float:
    """Step beyond its slope that ends a surface, turns: at least five sigma of such a difference.

    One of four neighbours, with weights 1/2, -3/2, 3/2, -1/2, has 2.2 sigma of each.
    """
    sample = wrapped.sigma.ravel()[::SAMPLED]
    known = sample[np.isfinite(sample)]
    sigma = float(np.median(known)) / (2 * np.pi) if known.size else 0.0
    return float(np.clip(5 * 2.2 * sigma, LEAST_JUMP_TURNS, MOST_JUMP_TURNS))


def code_noise(wrapped: WrappedPhase) -> tuple[float, float, float]:
    """Variance of c times B^2: without light, per grey level, and the level without light.

    ``sigma_I^2 (1 + 2 / N)``: of N frames A brings an N-th of a frame's variance with it, and B
    two N-ths times c^2, a half of it at most.
    """
    noise, share = wrapped.noise, 1 + 2 / wrapped.fringe.frame_count
    return share * noise.read**2, share * noise.gain, noise.black_level


def edge_bins(code: Codeword, bins: int) -> int:
    """How many bins at either end of a fringe lie within `EDGE_PX` of it."""
    return round(EDGE_PX / code.period_px * bins)


def _large_regions(unwrapped: UnwrappedPhase) -> NDArray[np.bool_]:
    count = np.zeros(unwrapped.region_count, np.int32)
    kernels.count_regions(unwrapped.region, count)
    return np.asarray(count >= LEAST_PIXELS)


def _window_of(
    window: CoordinateWindow | None, code: Codeword
) -> tuple[FloatMap, FloatMap, float, float]:
    """Both ends of a window, and the zero and period to count turns by; one pixel for no window."""
    nothing = np.full((1, 1), np.nan, np.float32)
    low, high = (nothing, nothing) if window is None else (window.low_px, window.high_px)
    return low, high, code.zero_px, code.period_px


def fit_words(patches: Patches, templates: NDArray[np.float64]) -> tuple[FloatMap, FloatMap]:
    """Log-likelihood ``(n, transfers, words)`` of each template in each patch, up to a constant.

    ``-1/2 sum w (c - d - t)^2`` with the offset d profiled out; templates ``(transfers, words,
    bins)``. The constant is that of the second result, ``(n,)``: twice the misfit of no code at
    all, ``sum w (c - d)^2``.
    """
    transfers, words, bins = templates.shape
    waves = templates.reshape(-1, bins).T.astype(np.float32)
    weight, code = patches.weight, patches.code
    total = np.maximum(weight.sum(axis=1), np.finfo(np.float32).tiny)
    mean_code = code.sum(axis=1) / total
    mean_wave = (weight @ waves) / total[:, None]
    square = weight @ np.square(waves) - total[:, None] * np.square(mean_wave)
    product = code @ waves - (total * mean_code)[:, None] * mean_wave
    fit = (product - square / 2).reshape(-1, transfers, words)
    return fit, patches.square - total * np.square(mean_code)
