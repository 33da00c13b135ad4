"""Forming an image: light read from a table, pixels painted on a raster, grey levels read out."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Floats = NDArray[np.float32]

U, V, LEVEL, GAIN = 0, 1, 2, 3
"""Columns of a sample: projector pixel, index into the levels of blur, light received."""

BORDER = 1e-6
"""A place this close, px, to the border of two pixels belongs to both."""

REACH = 6.0
"""Standard deviations from the image's edge beyond which its point spread is not felt."""


@kernel
def bracket(place: float, count: int) -> tuple[int, np.float32]:
    """The sample before a place among `count` samples, clamped, and how far it is to the next."""
    index = min(max(int(place), 0), count - 2)
    return index, np.float32(min(max(place - index, 0.0), 1.0))


@kernel
def at_level(values: Floats, level: int, along: float, across: float, wraps: bool) -> np.float32:
    """Value of one level of a table by bilinear reading; around the circle if it wraps across."""
    _, rows, columns = values.shape
    i, share = bracket(along, columns)
    if rows == 1:
        here = values[level, 0, i]
        return np.float32(here + share * (values[level, 0, i + 1] - here))
    if wraps:
        across -= rows * math.floor(across / rows)
        row = min(int(across), rows - 1)
        down = np.float32(across - row)
        below = row + 1 if row + 1 < rows else 0
    else:
        row, down = bracket(across, rows)
        below = row + 1
    upper, lower = values[level, row, i], values[level, below, i]
    upper += share * (values[level, row, i + 1] - upper)
    lower += share * (values[level, below, i + 1] - lower)
    return np.float32(upper + down * (lower - upper))


@kernel
def edge_share(before: float, after: float, variance: float) -> float:
    """Share of the light between two edges that a point spread leaves at a place between them."""
    if variance == 0:
        return 1.0 if before >= 0 and after >= 0 else 0.0
    scale = 1 / math.sqrt(2 * variance)
    return 0.5 * (math.erf(before * scale) + math.erf(after * scale))


@kernel
def gather_light(
    samples: Floats,
    values: Floats,
    grid: tuple[int, float, float, float, float, bool],
    edges: tuple[float, float, NDArray[np.float64]],
    out: Floats,
) -> None:
    """Irradiance ``(H, W)`` at rays: their gain times the table's light.

    `samples` is ``(H, W, 4)``: u, v, level, gain. `values` is ``(levels, across, along)``.
    `grid` says how it lies: which coordinate runs along (0: u), the place of the first sample
    along and across, samples per px along and across, and whether it wraps across. `edges` are
    the image's across, and the point spread's variance across ``(levels,)``, px^2.
    """
    height, width, _ = samples.shape
    axis, start, start_across, per_px, per_px_across, wraps = grid
    low, high, variances = edges
    reach = REACH * math.sqrt(variances.max())
    low_felt, high_felt, last = low + reach, high - reach, len(values) - 1
    for i in range(height):
        for j in range(width):
            gain = samples[i, j, GAIN]
            if not gain > 0:
                out[i, j] = np.float32(0)
                continue
            beside = float(samples[i, j, 1 - axis])
            along = (samples[i, j, axis] - start) * per_px
            across = (beside - start_across) * per_px_across
            level = min(int(samples[i, j, LEVEL]), last)
            share = samples[i, j, LEVEL] - np.float32(level)
            light = at_level(values, level, along, across, wraps)
            if share > 0:
                more = at_level(values, level + 1, along, across, wraps)
                light += share * (more - light)
            if beside < low_felt or beside > high_felt:
                variance = variances[level]
                if share > 0:
                    variance += share * (variances[level + 1] - variance)
                light *= np.float32(edge_share(beside - low, high - beside, variance))
            out[i, j] = gain * light


@kernel
def paint_raster(
    light: Floats, per_px: tuple[int, int], margins: tuple[int, int], diamonds: bool, out: Floats
) -> None:
    """Each raster sample takes the light of the pixel that covers it; dark around the image.

    `out` is ``((H + 2 down) per_row, (W + 2 right) per_column)`` with margins and samples per
    px in the order right, down. A sample on the border of two diamonds takes half of each.
    """
    rows, columns = out.shape
    half = np.float32(0.5)
    for i in range(rows):
        v = (i + 0.5) / per_px[1] - 0.5 - margins[1]
        for j in range(columns):
            u = (j + 0.5) / per_px[0] - 0.5 - margins[0]
            if diamonds:
                left, right = (
                    diamond_light(light, u - BORDER, v),
                    diamond_light(light, u + BORDER, v),
                )
                out[i, j] = half * (left + right)
            else:
                out[i, j] = pixel_light(light, math.floor(u + 0.5), math.floor(v + 0.5))


@kernel
def pixel_light(light: Floats, column: int, row: int) -> np.float32:
    """Light of a pixel; none outside the image."""
    inside = 0 <= row < light.shape[0] and 0 <= column < light.shape[1]
    return np.float32(light[row, column]) if inside else np.float32(0)


@kernel
def diamond_light(light: Floats, u: float, v: float) -> np.float32:
    """Light of the diamond that covers a place; diamonds are squares in ``u + v/2, u - v/2``."""
    p, q = math.floor(u + v / 2 + 0.5), math.floor(u - v / 2 + 0.5)
    row = p - q
    return pixel_light(light, (p + q - (row & 1)) // 2, row)


@kernel
def read_out(
    light: Floats,
    pixels: tuple[Floats, Floats],
    noise: Floats,
    electronics: tuple[float, float, float, float, float],
    out: NDArray[np.generic],
) -> None:
    """Grey levels of light ``(H, W)``, share of full scale.

    `pixels` are gains and dark offsets, grey levels; `noise` is standard normal, or empty without
    noise; `electronics` full scale, black level, electrons at full scale, read noise in electrons
    and 1 with shot noise, else 0.
    """
    gains, offsets = pixels
    full_scale, black = np.float32(electronics[0]), np.float32(electronics[1])
    full_well, read = np.float32(electronics[2]), np.float32(electronics[3])
    shot = np.float32(electronics[4])
    per_electron = full_scale / full_well
    half, zero = np.float32(0.5), np.float32(0)
    noisy = noise.size > 0
    height, width = light.shape
    for i in range(height):
        for j in range(width):
            electrons = light[i, j] * gains[i, j] * full_well
            if noisy:
                variance = read * read + shot * max(electrons, zero)
                electrons += np.sqrt(variance) * noise[i, j]
            grey = black + offsets[i, j] + electrons * per_electron
            out[i, j] = int(min(max(np.floor(grey + half), zero), full_scale))
