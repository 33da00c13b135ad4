"""What a projector does to its image before it shows it: sharpening, and scaling (keystone).

A blur spreads light and never overshoots, nor does it pass fine fringes better than coarse ones: a
projector that sharpens does both. An image that is scaled is interpolated; halfway between two of
its pixels linear interpolation keeps ``cos(pi / p)`` of fringes of period p, on a pixel all of it,
so the modulation of fine fringes beats across the image, which no lens does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.advice_blur import LEAST_TRANSFER, Ratio
from fringeworks.diagnose.advice_complaints import Complaint
from fringeworks.diagnose.look import Look
from fringeworks.model import Capture, Colour, FloatMap

Array = NDArray[np.float64]

MOST_TRANSFER = 1.03
LEAST_OVERSHOOT = 0.02
"""Of the step between two stripes."""

MEDIAN_ERROR = 1.2533
"""Of a median over that of a mean."""

EDGE_BINS_PX = np.arange(0.25, 8.0, 0.5)
FLAT_PX = (10.0, 22.0)
"""Distance from an edge at which a stripe is flat."""

MOST_SPARSE = 50
"""So few pixels or fewer at one distance from an edge tell nothing."""

FINEST_PX = 6.0
"""Longer periods beat too little to be seen."""

BEAT_TILES = (48, 96)
"""Camera px: the wider ones see slow beats, the others fit on small things."""

LEAST_BEAT = 0.05
"""Rms over the mean. Linear interpolation makes 0.11 of 4 px, lenses and pixels up to 0.02."""

SIGMAS_OF_NOISE = 2.0
LEAST_TILES = 3


def find_sharpening(
    capture: Capture, looks: Sequence[Look], ratios: Sequence[Ratio]
) -> Iterator[Complaint]:
    """Overshoot at the edges of grey stripes, or fine fringes stronger than coarse ones."""
    remedy = "Switch sharpness, detail and super-resolution off in the projector's menu."
    for pattern, frames, _ in capture.find(Colour):
        look = _beneath(pattern, looks)
        if look is None or frames.ndim != 3:
            continue
        picture, overshoot = _overshoot(frames[0].astype(np.float32), look)
        if overshoot > LEAST_OVERSHOOT:
            yield Complaint(
                "sharpening",
                f"light overshoots by {overshoot:.0%} of the step at the edges of grey stripes: "
                "the projector sharpens its image, which bends every fringe.",
                remedy,
                "grey stripes",
                picture,
                "grey stripes, share of white",
            )
            return
    for ratio in ratios:
        if ratio.fringes.enough and ratio.median > MOST_TRANSFER and np.isfinite(ratio.coarse_px):
            yield Complaint(
                "sharpening",
                f"{ratio.fringes.name} are {ratio.median - 1:.0%} stronger than {ratio.against}: "
                "no lens does that, a projector that sharpens does.",
                remedy,
                ratio.fringes.where,
                ratio.picture,
                "modulation over that of coarser fringes",
            )
            return


def find_scaling(ratios: Sequence[Ratio]) -> Iterator[Complaint]:
    """Fine fringes whose modulation beats across the image."""
    for ratio in ratios:
        fringe = ratio.fringes.fringe
        if fringe.period_px > FINEST_PX or not ratio.median >= LEAST_TRANSFER:
            continue
        beat, noise = _beat(ratio)
        if beat > max(LEAST_BEAT, SIGMAS_OF_NOISE * noise):
            yield Complaint(
                "keystone",
                f"the modulation of {ratio.fringes.name} beats by {beat:.0%} across the image: the "
                "projector shows scaled images (keystone, zoom, overscan, or not its own size).",
                "Switch keystone, zoom and overscan off, and show images of the projector's own "
                "pixel count one to one.",
                ratio.fringes.where,
                ratio.picture,
                "modulation over that of coarser light",
            )
            return


def _beneath(pattern: Colour, looks: Sequence[Look]) -> Look | None:
    """The fringes whose phase says where the stripes' edges are."""
    for look in looks:
        fringe = look.fringe
        if (fringe.axis, fringe.period_px) == (pattern.axis, pattern.period_px) and look.enough:
            return look
    return None


def _overshoot(frame: FloatMap, look: Look) -> tuple[FloatMap, float]:
    """The stripes as share of white, and how far they overshoot, share of their step."""
    light = (frame - look.offset + look.modulation) / np.maximum(2 * look.modulation, 1e-3)
    picture = np.where(look.lit, light, np.nan).astype(np.float32)
    share = light[look.lit]
    away = (np.pi - np.abs(look.phase[look.lit])) * look.fringe.period_px / (2 * np.pi)
    flat = (away > FLAT_PX[0]) & (away < FLAT_PX[1])
    if np.count_nonzero(flat) < MOST_SPARSE * len(EDGE_BINS_PX):
        return picture, 0.0
    middle = float(np.mean(np.percentile(share[flat], (5, 95))))
    sides = [(share > middle, 1.0), (share <= middle, -1.0)]
    levels = [float(np.median(share[side & flat])) for side, _ in sides if (side & flat).any()]
    if len(levels) < 2 or levels[0] - levels[1] < 0.1:
        return picture, 0.0
    step = levels[0] - levels[1]
    beyond = [
        _most_beyond(away[side], sign * (share[side] - level) / step)
        for (side, sign), level in zip(sides, levels, strict=True)
    ]
    return picture, float(np.mean(beyond))


def _most_beyond(away: Array, beyond: Array) -> float:
    """Largest median over the distances from the edge, less three of its standard errors."""
    edges = np.append(EDGE_BINS_PX - 0.25, EDGE_BINS_PX[-1] + 0.25)
    which = np.digitize(away, edges) - 1
    bins = [beyond[which == number] for number in range(len(EDGE_BINS_PX))]
    sure = [
        float(np.median(some) - 3 * MEDIAN_ERROR * np.std(some) / np.sqrt(len(some)))
        for some in bins
        if len(some) > MOST_SPARSE
    ]
    return max(sure, default=0.0)


def _beat(ratio: Ratio) -> tuple[float, float]:
    """Spread of the modulation inside tiles over its median, and what noise makes of it."""
    import cv2

    known = np.isfinite(ratio.picture)
    filled = np.where(known, ratio.picture, 0).astype(np.float32)
    weight = cv2.blur(known.astype(np.float32), (3, 3))
    smooth = np.where(weight > 0.99, cv2.blur(filled, (3, 3)), np.nan)
    spread = max(_spread(smooth, side) for side in BEAT_TILES)
    look = ratio.fringes
    of_one = look.noise * np.sqrt(2 / look.fringe.frame_count) / 3
    modulation = float(np.median(look.modulation[known]))
    return spread / ratio.median, float(of_one / modulation)


def _spread(picture: FloatMap, side: int) -> float:
    """Median over tiles of such a side of what a surface leaves; 0 where there are few tiles."""
    height, width = picture.shape
    tiles = [
        picture[top : top + side, left : left + side]
        for top in range(0, height - side + 1, side)
        for left in range(0, width - side + 1, side)
    ]
    spreads = [spread for tile in tiles if (spread := _left_by_surface(tile)) is not None]
    return float(np.median(spreads)) if len(spreads) >= LEAST_TILES else 0.0


def _left_by_surface(tile: FloatMap) -> float | None:
    """Robust spread that a quadratic surface leaves; None where the tile is not full."""
    rows, columns = np.nonzero(np.isfinite(tile))
    if len(rows) < 0.8 * tile.size:
        return None
    values = tile[rows, columns].astype(np.float64)
    x, y = columns / len(tile) - 0.5, rows / len(tile) - 0.5
    design = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    left = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return float(1.4826 * np.median(np.abs(left)))
