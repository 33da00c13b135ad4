"""The decoded projector coordinate at a corner, from a robust quadratic fit about it.

A quadratic in the pixel offsets, fitted by iteratively reweighted least squares with Tukey's
biweight. It starts from medians: least squares as a start is led astray by the wrong codes of dark
squares (it cost 0.65 px on a real capture). No local homography (methods.md, Calibration).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TUKEY = 4.685
MAD_TO_SIGMA = 1.4826
PIXELS_ACROSS = 64
"""Wider windows are sampled on a coarser grid: more pixels no longer help."""

_BLOCKS = 5
_ROUNDS = 50
_SETTLED = 2e-3
_SMALLEST_SCALE = 1e-7
_FEWEST = 12


@dataclass(frozen=True, slots=True)
class LocalFit:
    """Value at the window's centre.

    Attributes
    ----------
    value, sigma
        Projector px; NaN if fewer than 12 pixels are valid or they do not fix a surface.
    support
        Share of the window's pixels that are valid and no outliers.
    imbalance
        Distance of their centre of gravity from the window's centre, in radii: 0 all round,
        0.42 for half a window.
    """

    value: float
    sigma: float
    support: float
    imbalance: float


NOTHING = LocalFit(np.nan, np.nan, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class _Samples:
    """Valid pixels of a window: offsets in radii, coordinate and weight 1 / sigma."""

    x: Array
    y: Array
    value: Array
    weight: Array
    offered: int


def fit_local(
    coordinate: NDArray[np.floating], sigma: NDArray[np.floating], *, at: Array, radius: float
) -> LocalFit:
    """Robust quadratic fit of a map about a point.

    Parameters
    ----------
    coordinate, sigma
        ``(H, W)`` projector px; NaN where void.
    at
        ``(2,)`` point (x, y), camera px.
    radius
        Of the round window, camera px.

    Returns
    -------
    fit
        NaN and zero support where too few pixels are valid; never an exception.
    """
    samples = _gather(coordinate, sigma, (at, radius))
    if len(samples.value) < _FEWEST:
        return NOTHING
    plane = _median_plane(samples)
    if plane is None:
        return NOTHING
    x, y = samples.x, samples.y
    linear = np.stack([np.ones_like(x), x, y], axis=1)
    quadratic = np.concatenate([linear, np.stack([x * x, x * y, y * y], axis=1)], axis=1)
    start, _ = _reweighted(linear, samples, plane)
    solution, weights = _reweighted(quadratic, samples, np.concatenate([start, np.zeros(3)]))
    return _summarise(quadratic, samples, (solution, weights))


def _gather(
    coordinate: NDArray[np.floating], sigma: NDArray[np.floating], window: tuple[Array, float]
) -> _Samples:
    """Valid samples of the round window (centre, radius)."""
    (centre_x, centre_y), radius = window
    height, width = coordinate.shape
    step = max(1, int(2 * radius / PIXELS_ACROSS))
    rows = np.arange(int(np.ceil(centre_y - radius)), int(centre_y + radius) + 1, step)
    columns = np.arange(int(np.ceil(centre_x - radius)), int(centre_x + radius) + 1, step)
    y, x = np.meshgrid(rows, columns, indexing="ij")
    dx, dy = (x - centre_x) / radius, (y - centre_y) / radius
    inside = dx**2 + dy**2 <= 1
    offered = int(inside.sum())
    inside &= (x >= 0) & (x < width) & (y >= 0) & (y < height)
    x, y, dx, dy = x[inside], y[inside], dx[inside], dy[inside]
    value = coordinate[y, x].astype(np.float64)
    spread = sigma[y, x].astype(np.float64)
    valid = np.isfinite(value) & np.isfinite(spread) & (spread > 0)
    return _Samples(dx[valid], dy[valid], value[valid], 1 / spread[valid], offered)


def _median_plane(samples: _Samples) -> Array | None:
    """Intercept and slopes from medians over blocks of the window, None without enough blocks.

    Slopes are medians of the differences between blocks of one row (or column) of blocks;
    medians inside the blocks take most of the quantisation and the outliers out first.
    """
    column = np.minimum(((samples.x + 1) * (_BLOCKS / 2)).astype(int), _BLOCKS - 1)
    row = np.minimum(((samples.y + 1) * (_BLOCKS / 2)).astype(int), _BLOCKS - 1)
    block = row * _BLOCKS + column
    order = np.argsort(block, kind="stable")
    ends = np.searchsorted(block[order], np.arange(_BLOCKS**2 + 1))
    blocks: dict[tuple[int, int], tuple[float, ...]] = {}
    for number, (start, stop) in enumerate(pairwise(ends)):
        here = order[start:stop]
        if len(here) >= 3:
            place = float(samples.x[here].mean()), float(samples.y[here].mean())
            blocks[divmod(number, _BLOCKS)] = (*place, _median(samples.value[here]))
    slope_x = _median_slope(blocks, along=0)
    slope_y = _median_slope(blocks, along=1)
    if slope_x is None or slope_y is None:
        return None
    rest = samples.value - slope_x * samples.x - slope_y * samples.y
    return np.array([_median(rest), slope_x, slope_y])


def _median_slope(blocks: dict[tuple[int, int], tuple[float, ...]], *, along: int) -> float | None:
    """Median slope between all pairs of blocks that lie beside each other along x (0) or y (1)."""
    slopes = [
        (second[2] - first[2]) / (second[along] - first[along])
        for key, first in blocks.items()
        for other, second in blocks.items()
        if key[along] == other[along] and key[1 - along] < other[1 - along]
    ]
    return _median(np.array(slopes)) if slopes else None


def _reweighted(design: Array, samples: _Samples, start: Array) -> tuple[Array, Array]:
    """Tukey's estimate and its weights; scale from the median absolute residual."""
    solution = start
    weights = np.ones(len(design))
    sharpest = float(samples.weight.max())
    for _ in range(_ROUNDS):
        residuals = (samples.value - design @ solution) * samples.weight
        scale = robust_scale(residuals)
        weights = tukey_weights(residuals, scale)
        weighted = design * (weights * samples.weight**2)[:, None]
        moved, *_ = np.linalg.lstsq(weighted.T @ design, weighted.T @ samples.value, rcond=None)
        step = float(np.abs(moved - solution).max())
        solution = np.asarray(moved, dtype=np.float64)
        if step * sharpest < _SETTLED * scale:
            break
    return solution, weights


def robust_scale(residuals: Array) -> float:
    """Standard deviation by the median absolute residual, never zero."""
    return max(MAD_TO_SIGMA * _median(np.abs(residuals)), _SMALLEST_SCALE)


def _median(values: Array) -> float:
    """What `np.median` gives, which for a few hundred values takes longer than their sorting.

    NaN where any is, which sorting puts last, and of none.
    """
    if not values.size:
        return float("nan")
    low, high = (values.size - 1) // 2, values.size // 2
    parted = np.partition(values, (low, high, values.size - 1), axis=None)
    if np.isnan(parted[-1]):
        return float("nan")
    return float((parted[low] + parted[high]) / 2)


def tukey_weights(residuals: Array, scale: float) -> Array:
    """Tukey's biweight: one at zero, nothing beyond 4.7 scales."""
    ratio = residuals / (TUKEY * scale)
    weights: Array = np.where(np.abs(ratio) < 1, (1 - ratio**2) ** 2, 0.0)
    return weights


def _summarise(design: Array, samples: _Samples, result: tuple[Array, Array]) -> LocalFit:
    solution, weights = result
    weighted = design * (weights * samples.weight**2)[:, None]
    normal = weighted.T @ design
    if np.linalg.matrix_rank(normal) < len(normal):
        return NOTHING
    scale = robust_scale((samples.value - design @ solution) * samples.weight)
    used = weights > 0
    centre = np.hypot(samples.x[used].mean(), samples.y[used].mean())
    return LocalFit(
        value=float(solution[0]),
        sigma=scale * float(np.sqrt(np.linalg.inv(normal)[0, 0])),
        support=float(used.sum()) / samples.offered,
        imbalance=float(centre),
    )
