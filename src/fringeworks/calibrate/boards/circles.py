"""Centres of a symmetric grid of dark circles.

OpenCV says which circle is which. Each one's image is an ellipse; the centroid of its darkness,
under light that may slope, is the ellipse's centre whatever the blur. That is not where the
circle's own centre is seen: the offset follows from the board's homography and the diameter
(Heikkila, IEEE TPAMI 22, 1066, 2000).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.boards.found import (
    FoundCorners,
    Image,
    Points,
    grid_steps,
    refuse_small,
    right_handed,
    to_8_bit,
)
from fringeworks.calibrate.boards.saddle import FALLBACK_SIGMA_PX, MODEL_SIGMA_PX
from fringeworks.errors import CalibrationError
from fringeworks.model import CirclesTarget

REACH = 0.5
"""Half the window, in steps from circle to circle."""

BLUR_PX = 4.0
"""How far from its edge a circle's darkness is looked for, and no white of the sheet..."""

GAP_SHARE = 0.6
"""...and at most this share of the way to where the next circle's window begins."""

LEAST_SHARE = 0.9
"""Of the window's pixels that must be there: a lack on one side moves the centroid."""

LEAST_RING = 12
LEAST_CONTRAST = 0.1

VOID = "too few pixels about the circle"
FLAT = "no contrast between circle and sheet"


def find_circles(image: Image, board: CirclesTarget) -> FoundCorners:
    """As `find_board`: centres of the circles, not of their images.

    Raises
    ------
    CalibrationError
        No such grid of circles, or circles less than 6 px apart.
    """
    start = _detect(to_8_bit(image), board)
    if start is None:
        raise CalibrationError(
            f"no grid of {board.columns} x {board.rows} dark circles was found: are all of them "
            "in the image, evenly lit, with white about them, and are columns and rows right?"
        )
    start = right_handed(start, board)
    refuse_small(start, board)
    values = np.asarray(image, dtype=np.float64)
    steps = grid_steps(start, board)
    fits = [_centroid(values, at, step, board) for at, step in zip(start, steps, strict=True)]
    centres = np.array([fit[0] for fit in fits])
    return FoundCorners(
        index=np.arange(board.corner_count),
        pixels=centres - ellipse_offsets(centres, board),
        sigma=np.array([fit[1] for fit in fits]),
        reasons=tuple(fit[2] for fit in fits),
    )


def ellipse_offsets(centres: Points, board: CirclesTarget) -> Points:
    """``(n, 2)`` px from where circles' centres are seen to the centres of their images.

    `centres` ``(n, 2)`` are those of the images. The conic ``C`` of a circle is seen as
    ``H^-T C H^-1``, whose centre is the pole of the line at infinity, ``H C^-1 H^T (0, 0, 1)``.
    H is fitted to the centres; what their offsets change in it is of third order.
    """
    flat = board.corners_mm()[:, :2]
    homography, _ = cv2.findHomography(flat, centres)
    radius2 = (board.diameter_mm / 2) ** 2
    last = homography[2]
    points = np.column_stack([flat, np.ones(len(flat))])
    # C^-1 of the circle about q is q q^T - r^2 diag(1, 1, 0), q homogeneous.
    poles = points * (points @ last)[:, None] - radius2 * last * [1.0, 1.0, 0.0]
    seen = points @ homography.T
    images = poles @ homography.T
    return np.asarray(images[:, :2] / images[:, 2:] - seen[:, :2] / seen[:, 2:])


def _detect(grey: NDArray[np.uint8], board: CirclesTarget) -> Points | None:
    found, centres = cv2.findCirclesGrid(
        grey, (board.columns, board.rows), flags=cv2.CALIB_CB_SYMMETRIC_GRID
    )
    return centres.reshape(-1, 2).astype(np.float64) if found else None


def _centroid(
    values: Points, at: Points, step: Points, board: CirclesTarget
) -> tuple[Points, Points, str]:
    """Centre ``(2,)`` of a circle's image, its sigma, and why it is the detector's."""
    fallback = at, np.full(2, FALLBACK_SIGMA_PX)
    places, levels, radius, whole = _window(values, at, step, board)
    pitch = min(board.pitch_x_mm, board.pitch_y_mm)
    gap = (pitch - board.diameter_mm) / 2
    blur = min(BLUR_PX * pitch / np.linalg.norm(step, axis=1).min(), GAP_SHARE * gap)
    ring = radius > board.diameter_mm / 2 + blur
    core = radius < max(board.diameter_mm / 2 - blur, board.diameter_mm / 4)
    if not whole or ring.sum() < LEAST_RING or not core.any():
        return *fallback, VOID
    design = np.column_stack([np.ones(len(places)), places])
    sheet, *_ = np.linalg.lstsq(design[ring], levels[ring], rcond=None)
    light = design @ sheet
    if light.min() <= 0:
        return *fallback, FLAT
    dark = 1 - levels / light
    depth = float(dark[core].mean())
    noise = float(np.sqrt(np.mean(dark[ring] ** 2) * ring.sum() / (ring.sum() - 3)))
    if depth < LEAST_CONTRAST or depth < noise:
        return *fallback, FLAT
    weight = np.where(ring, 0.0, dark)
    centre = weight @ places / weight.sum()
    spread = np.where(ring[:, None], 0.0, places - centre)
    sigma = noise * np.sqrt(np.sum(spread**2, axis=0)) / weight.sum()
    return at + centre, np.hypot(sigma, MODEL_SIGMA_PX), ""


def _window(
    values: Points, at: Points, step: Points, board: CirclesTarget
) -> tuple[Points, Points, Points, bool]:
    """Places ``(m, 2)`` from `at`, levels, distances on the board, mm; whether they are whole."""
    height, width = values.shape
    half = REACH * np.abs(step).sum(axis=0)
    low, high = np.ceil(at - half).astype(int), np.floor(at + half).astype(int)
    rows, columns = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
    places = np.stack([columns - at[0], rows - at[1]], axis=-1).reshape(-1, 2)
    shares = places @ np.linalg.inv(step)
    inside = (np.abs(shares) <= REACH).all(axis=1)
    seen = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    levels = np.full(rows.size, np.nan)
    levels[seen.ravel()] = values[rows[seen], columns[seen]]
    kept = inside & np.isfinite(levels)
    radius = np.linalg.norm(shares * [board.pitch_x_mm, board.pitch_y_mm], axis=1)
    return places[kept], levels[kept], radius[kept], kept.sum() >= LEAST_SHARE * inside.sum()
