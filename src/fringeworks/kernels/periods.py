"""Fringe orders from several periods at once: the coordinate on which all of them agree best."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

TWO_PI = 2 * math.pi


@kernel
def _spread(turns: Array, weights: Array, periods: Array) -> float:
    """``sum w (x_n - mean)^2`` of the sets' coordinates nearest to that of set 0.

    `turns` are how many periods the coordinate of set 0 lies beyond some coordinate of each set.
    """
    squares, total, weight = 0.0, 0.0, 0.0
    for n in range(len(turns)):
        away = (turns[n] - np.rint(turns[n])) * periods[n]
        squares += weights[n] * away * away
        total += weights[n] * away
        weight += weights[n]
    return squares - total * total / weight


@kernel
def agree_on_order(
    phases: Floats,
    sigmas: Floats,
    grid: tuple[Array, Array],
    limits_px: tuple[Floats, Floats],
    order: NDArray[np.int32],
    best: Floats,
    second: Floats,
) -> None:
    """Order of set 0, the finest, on which all sets agree best, and two spreads.

    Parameters
    ----------
    phases, sigmas
        ``(n, H, W)`` wrapped phase and its standard deviation, rad.
    grid
        Periods and zeros of the sets, ``(n,)``, px.
    limits_px
        Lowest and highest coordinate to look at: ``(H, W)``, or ``(1, 1)`` for all pixels.
    order, best, second
        ``(H, W)``: the order, its spread in units of sigma^2 (chi squared), and that of the next
        best one, infinite where only one was looked at; -1, NaN, NaN where a phase is NaN or no
        order lies within the limits.
    """
    periods, zeros = grid
    low, high = limits_px
    count, height, width = phases.shape
    turns, weights = np.empty(count), np.empty(count)
    one_for_all = low.size == 1
    for i in range(height):
        for j in range(width):
            order[i, j], best[i, j], second[i, j] = -1, math.nan, math.nan
            lowest = low[0, 0] if one_for_all else low[i, j]
            highest = high[0, 0] if one_for_all else high[i, j]
            from_zero = phases[0, i, j] / TWO_PI
            first = math.ceil((lowest - zeros[0]) / periods[0] - from_zero)
            last = math.floor((highest - zeros[0]) / periods[0] - from_zero)
            at = zeros[0] + periods[0] * (from_zero + first)
            known = True
            for n in range(count):
                sigma = sigmas[n, i, j] * periods[n] / TWO_PI
                weights[n] = 1 / (sigma * sigma)
                turns[n] = (at - zeros[n]) / periods[n] - phases[n, i, j] / TWO_PI
                known = known and weights[n] == weights[n] and turns[n] == turns[n]
            if not known:
                continue
            least, next_least = math.inf, math.inf
            for k in range(first, last + 1):
                spread = _spread(turns, weights, periods)
                if spread < least:
                    least, next_least = spread, least
                    order[i, j] = k
                elif spread < next_least:
                    next_least = spread
                for n in range(count):
                    turns[n] += periods[0] / periods[n]
            if least < math.inf:
                best[i, j], second[i, j] = least, next_least
