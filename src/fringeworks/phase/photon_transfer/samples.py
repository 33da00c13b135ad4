"""Variance against mean, pixel by pixel from repeats, gathered by grey level.

From each frame of a repeated image its own light is taken first: ``x_i - mean = a_i + b_i mean``
by least squares over the pixels, so that flicker of the projector and of ambient light is no
noise. What the pixels differ in among each other (fixed pattern, vignetting, fringes) cancels in
``x_i - mean``. Means of tiles then show where the scene or its light changed otherwise.

The variance of rounding is 1/12 where noise or scene spread the levels over more than one step.
Over evenly spread levels the difference of two repeats d = sqrt(2) sigma n rounds to its
neighbours, and ``E[d^2] / 2 = sigma^2 + 1/12 - sum_k exp(-(2 pi k sigma)^2) / (2 pi^2 k^2)``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Capture, Frames
from fringeworks.phase.noise import QUANTISATION_VARIANCE
from fringeworks.phase.photon_transfer.nouns import Array, CurvePoints

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

BINS = 64
LEAST_STEPS = 4
ABOUT_PX = 5
"""Pixels go into the bin of the mean about them: by their own the darkest bin would take those
whose own offset or noise is low, which have the variance of brighter light."""

TILE_PX = 16
MOVED_SIGMAS = 5.0
LEAST_VARIANCE = 0.01
"""Of a tile: below it, in steps, rounding hides the noise."""

LEAST_DOF = 50
MOST_CLIPPED = 1e-3
SPREAD_VARIANCE = 0.3
"""Noise of this variance, rounding included, spreads levels over a step by itself."""

SPREAD_STEPS = 0.4
"""1 sd of the pixels' own levels that does so."""

ROUNDED_TERMS = 5
SMALLEST_SIGMA = 0.02


@dataclass(frozen=True, slots=True)
class Ruler:
    """Bins of grey levels from `first` on, `width` levels each.

    `top` is the level from which on a sample is clipped.
    """

    first: int
    width: int
    step: int
    top: float


def lay_ruler(first: int, last: int, *, step: int, top: float) -> Ruler:
    """About 64 bins over the levels that occur."""
    steps = (last - first) // step + 1
    return Ruler(first, max(-(-steps // BINS), LEAST_STEPS) * step, step, top)


@dataclass(frozen=True, slots=True, eq=False)
class Sums:
    """Per bin ``(BINS,)``: pixels' degrees of freedom, squares, means; clipped samples, samples."""

    dof: Array
    squares: Array
    means: Array
    mean_squares: Array
    clipped: Array
    samples: Array


def repeated_frames(captures: Iterable[Capture]) -> Iterator[Frames]:
    """Images of one thing, ``(n, H, W)`` with n >= 2: each frame of each repeated set."""
    for capture in captures:
        for item, stack in capture:
            if item.repeats > 1 and stack.ndim == 3:
                yield from stack.reshape(-1, item.repeats, *stack.shape[1:])


def gather(stacks: Iterable[Frames], ruler: Ruler) -> tuple[Sums, float]:
    """Sums over all stacks, and the share of the tiles that changed between repeats.

    Those tiles are left out.
    """
    sums = Sums(*np.zeros((6, BINS)))
    moved = tested = 0
    for stack in stacks:
        levels = stack.astype(np.float32) / np.float32(ruler.step)
        mean = levels.mean(axis=0)
        clipped = (stack == 0) | (stack >= ruler.top)
        good = ~clipped.any(axis=0)
        noise = _without_light(levels - mean, mean, good)
        changed, known = find_changed(noise, good)
        moved, tested = moved + int(changed.sum()), tested + int(known.sum())
        _add(sums, (mean, noise, clipped), ~_pixels_of(changed, mean.shape), ruler)
    return sums, moved / max(tested, 1)


def _without_light(noise: Floats, mean: Floats, good: Mask) -> Floats:
    """Frames ``(n, H, W)`` less their mean, without what an even change of the light explains."""
    if np.count_nonzero(good) < LEAST_DOF:
        return noise
    middle = mean[good].mean(dtype=np.float64)
    centred = (mean - middle).astype(np.float32)
    shade = centred[good]
    power = float(np.square(shade, dtype=np.float64).sum())
    left = np.empty_like(noise)
    for place, frame in enumerate(noise):
        seen = frame[good]
        slope = float(np.sum(seen * shade, dtype=np.float64)) / max(power, 1e-12)
        left[place] = frame - np.float32(seen.mean(dtype=np.float64)) - np.float32(slope) * centred
    return left


def find_changed(noise: Floats, good: Mask) -> tuple[Mask, Mask]:
    """Tiles that differ between repeats by more than noise, and those that could be tested.

    Both are ``(H // 16, W // 16)``: half of a tile's pixels must be good.
    """
    count = _tiled(good).sum(axis=(1, 3))
    known = count >= TILE_PX**2 / 2
    total = np.stack([_tiled(frame * good).sum(axis=(1, 3)) for frame in noise])
    squares = _tiled(np.square(noise).sum(axis=0) * good).sum(axis=(1, 3))
    per_frame = np.maximum(squares / np.maximum(count, 1) / len(noise), LEAST_VARIANCE)
    score = np.abs(total) / np.sqrt(per_frame * np.maximum(count, 1))
    return known & (score > MOVED_SIGMAS).any(axis=0), known


def _tiled(image: NDArray[Any]) -> NDArray[Any]:
    rows, columns = (size // TILE_PX for size in image.shape)
    cut = image[: rows * TILE_PX, : columns * TILE_PX]
    return cut.reshape(rows, TILE_PX, columns, TILE_PX)


def _pixels_of(tiles: Mask, shape: tuple[int, ...]) -> Mask:
    pixels = np.zeros(shape, np.bool_)
    each = np.ones((TILE_PX, TILE_PX), np.bool_)
    pixels[: TILE_PX * tiles.shape[0], : TILE_PX * tiles.shape[1]] = np.kron(tiles, each)
    return pixels


def _add(
    sums: Sums, images: tuple[Floats, Floats, NDArray[np.bool_]], keep: Mask, ruler: Ruler
) -> None:
    import cv2

    mean, noise, clipped = images
    level = mean[keep].astype(np.float64)
    about = cv2.blur(mean, (ABOUT_PX, ABOUT_PX))[keep].astype(np.float64)
    place = np.floor((about * ruler.step - ruler.first) / ruler.width).astype(np.intp)
    place = np.clip(place, 0, BINS - 1)
    dof = len(noise) - 1
    squares = np.square(noise).sum(axis=0)[keep]
    sums.dof[:] += dof * np.bincount(place, minlength=BINS)
    sums.squares[:] += np.bincount(place, squares, minlength=BINS)
    sums.means[:] += dof * np.bincount(place, level, minlength=BINS)
    sums.mean_squares[:] += dof * np.bincount(place, np.square(level), minlength=BINS)
    sums.clipped[:] += np.bincount(place, clipped.sum(axis=0)[keep], minlength=BINS)
    sums.samples[:] += len(noise) * np.bincount(place, minlength=BINS)


def points_of(sums: Sums, step: int) -> CurvePoints:
    """The curve, grey levels; bins of less than 50 degrees of freedom are no points."""
    enough = sums.dof >= LEAST_DOF
    dof = sums.dof[enough]
    variance, level = sums.squares[enough] / dof, sums.means[enough] / dof
    own = sums.mean_squares[enough] / dof - np.square(level) - variance / 2
    spread = (variance >= SPREAD_VARIANCE) | (own >= SPREAD_STEPS**2)
    unclipped = sums.clipped[enough] <= MOST_CLIPPED * sums.samples[enough]
    noisy = variance > 0
    return CurvePoints(
        level=level * step,
        variance=without_rounding(variance) * step**2,
        sigma=variance * np.sqrt(2 / dof) * step**2,
        used=spread & unclipped & noisy,
    )


def with_rounding(sigma: Array) -> Array:
    """Variance, steps squared, of noise `sigma` on evenly spread levels that are rounded."""
    k = np.arange(1, ROUNDED_TERMS + 1)[:, np.newaxis]
    lost = np.exp(-np.square(2 * np.pi * k * sigma)) / (2 * np.square(np.pi * k))
    return np.asarray(np.square(sigma) + QUANTISATION_VARIANCE - lost.sum(axis=0))


def without_rounding(variance: Array) -> Array:
    """Variance of the noise, steps squared, whose rounded levels have this one."""
    sigma = np.linspace(SMALLEST_SIGMA, 1.0, 500)
    near = np.interp(variance, with_rounding(sigma), np.square(sigma))
    return np.where(variance < 1, near, variance - QUANTISATION_VARIANCE)
