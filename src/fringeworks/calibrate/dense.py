"""Sites all over the board: averages of the decoded maps over small tiles of its bright parts.

Bright parts are found in the modulation, about the corners, a few pixels away from every edge, so
that it does not matter what is printed: the white squares of a checkerboard, what markers leave of
them, the ground between circles. A smooth surface is fitted to each map over the whole board; a
tile keeps the mean of what its pixels differ from it by. So a tile may be of any shape, wrong
codes stand out, and what the surface cannot follow stays in the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.local_fit import robust_scale, tukey_weights
from fringeworks.calibrate.sites import Sites
from fringeworks.model import CodedAxis, ProjectorMap

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TILES_ACROSS = 3
"""Per square. More of them say no more: on the twin's board 8 px and 16 px do the same."""

LEAST_SHARE = 0.3
"""Of a tile, so that slivers of tiles do not count as observations."""

LEAST_SITES = 60
EDGE_PX = 3
"""Pixels this close to an edge of the print see both sides of it through the lens's blur."""

BRIGHT_SHARE = 0.5
"""Of the brightest within a square: white paper is above it, black print far below."""

RIM_SQUARES = 0.8
"""How far, in squares, a checkerboard goes on beyond its outermost inner corners, with a margin."""

DEGREE = 4
"""Of the smooth surface: of a plane seen through two lenses it leaves less than the noise."""

OUTLIER_SIGMAS = 5.0
_START_DEGREE = 2
_FIT_PIXELS = 20000
_ROUNDS = 8


@dataclass(frozen=True, slots=True, eq=False)
class _Pixels:
    """Bright pixels: camera px, and the same from -1 to 1 over the board."""

    x: NDArray[np.intp]
    y: NDArray[np.intp]
    middle: Array
    half: Array

    def scaled(self, places: Array) -> Array:
        return (places - self.middle) / self.half

    @property
    def places(self) -> Array:
        return np.column_stack([self.x, self.y]).astype(np.float64)


def find_sites(
    projector_map: ProjectorMap, corners: tuple[Array, Array], square_px: float
) -> Sites | None:
    """Sites on the bright parts of a board.

    Parameters
    ----------
    projector_map
        With both axes.
    corners
        ``(n, 2)`` camera px, and projector px as `fit_local` found them: where to look, and about
        what to expect there. At least six, not on one line.
    square_px
        Size of the smallest square, camera px.

    Returns
    -------
    sites
        None where fewer than 60 tiles are decoded.
    """
    axes = projector_map.axes
    lit = np.minimum(*(axis.modulation for axis in axes))
    decoded = np.logical_and(*(np.isfinite(axis.coordinate) for axis in axes))
    y, x = np.nonzero(bright_parts(lit, corners[0], square_px) & decoded)
    tile_px = max(1, round(square_px / TILES_ACROSS))
    if len(x) < LEAST_SITES * LEAST_SHARE * tile_px**2:
        return None
    low, high = corners[0].min(axis=0), corners[0].max(axis=0)
    pixels = _Pixels(x, y, (low + high) / 2, (high - low) / 2)
    surfaces = [
        _Surface.fit(axis, pixels, (corners[0], corners[1][:, place]))
        for place, axis in enumerate(axes)
    ]
    return _tile(pixels, surfaces, tile_px)


def bright_parts(lit: NDArray[np.floating], corners: Array, square_px: float) -> Mask:
    """``(H, W)`` pixels of a board's bright parts, away from all edges, by its modulation."""
    light = cv2.medianBlur(np.nan_to_num(lit).astype(np.float32), 3)
    across = 2 * int(square_px) + 1
    brightest = cv2.dilate(light, np.ones((across, across), np.uint8))
    bright = (light > BRIGHT_SHARE * brightest).astype(np.uint8)
    edges = 2 * EDGE_PX + 1
    inner = cv2.erode(bright, np.ones((edges, edges), np.uint8), borderValue=0)
    board = np.zeros(lit.shape, np.uint8)
    hull = cv2.convexHull(corners.astype(np.float32).reshape(-1, 1, 2))
    cv2.fillConvexPoly(board, np.rint(hull).astype(np.int32), 1)
    rim = 2 * int(RIM_SQUARES * square_px) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (rim, rim))
    return np.logical_and(inner, cv2.dilate(board, disc))


@dataclass(frozen=True, slots=True, eq=False)
class _Surface:
    """A polynomial over a map, what it leaves at each pixel, and by how much a pixel scatters."""

    coefficients: Array
    rest: Array
    sigma: Array

    @classmethod
    def fit(cls, axis: CodedAxis, pixels: _Pixels, corners: tuple[Array, Array]) -> _Surface:
        """By Tukey's biweight; it starts from the corners, which are robust already."""
        value = axis.coordinate[pixels.y, pixels.x].astype(np.float64)
        sharp = 1 / axis.sigma[pixels.y, pixels.x].astype(np.float64)
        design = _terms(pixels.scaled(pixels.places), DEGREE)
        start = _terms(pixels.scaled(corners[0]), _START_DEGREE)
        first, *_ = np.linalg.lstsq(start, corners[1], rcond=None)
        coefficients = np.zeros(design.shape[1])
        coefficients[: len(first)] = first
        some = slice(None, None, 1 + len(value) // _FIT_PIXELS)
        for _ in range(_ROUNDS):
            score = (value[some] - design[some] @ coefficients) * sharp[some]
            pull = np.sqrt(tukey_weights(score, robust_scale(score))) * sharp[some]
            coefficients[:], *_ = np.linalg.lstsq(
                design[some] * pull[:, None], value[some] * pull, rcond=None
            )
        rest = value - design @ coefficients
        scale = robust_scale(rest * sharp)
        return cls(coefficients, rest, scale / sharp)

    @property
    def fits(self) -> Mask:
        return np.abs(self.rest) < OUTLIER_SIGMAS * self.sigma

    def at(self, scaled: Array) -> Array:
        return _terms(scaled, DEGREE) @ self.coefficients


def _terms(places: Array, degree: int) -> Array:
    """``(n, k)`` products of powers of x and y up to a degree, low degrees first."""
    x, y = places.T
    return np.stack(
        [x ** (total - j) * y**j for total in range(degree + 1) for j in range(total + 1)], axis=1
    )


def _tile(pixels: _Pixels, surfaces: Sequence[_Surface], tile_px: int) -> Sites | None:
    """One site per tile that has enough pixels which neither axis leaves out."""
    used = np.logical_and(*(surface.fits for surface in surfaces))
    x, y = pixels.x[used], pixels.y[used]
    _, tile = np.unique((y // tile_px) * (x.max() + 1) + x // tile_px, return_inverse=True)
    full = np.bincount(tile) >= LEAST_SHARE * tile_px**2
    if np.count_nonzero(full) < LEAST_SITES:
        return None
    # both axes belong to one place: the mean of the pixels, whatever they weigh
    count = np.bincount(tile)[full]
    places = np.stack([np.bincount(tile, part)[full] / count for part in (x, y)], axis=1)
    values, sigmas = [], []
    for surface in surfaces:
        rest = np.bincount(tile, surface.rest[used])[full] / count
        values.append(surface.at(pixels.scaled(places)) + rest)
        sigmas.append(np.sqrt(np.bincount(tile, surface.sigma[used] ** 2)[full]) / count)
    return Sites(places, np.stack(values, axis=1), np.stack(sigmas, axis=1))
