"""Images of flat boards through a homography: exact edges, blurred before the pixels see them."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Target

Array = NDArray[np.float64]
Ink = Callable[[Array, Array], Array]

FINE = 8
SIZE = (220, 190)
"""Width and height, px."""


def board_view(target: Target, *, square_px: float, tilt: float = 0.0, turn: float = 0.2) -> Array:
    """``(3, 3)`` px from mm: turned, rad, and seen at a slant where `tilt` is not 0."""
    scale = square_px / target.pitch_x_mm
    middle = np.append(target.corners_mm().mean(axis=0)[:2], 0.0)
    cosine, sine = np.cos(turn) * scale, np.sin(turn) * scale
    view = np.array([[cosine, -sine, 0.0], [sine, cosine * (1 - tilt), 0.0], [0.0, 0.0, 1.0]])
    view[2, :2] = tilt * np.array([0.3, 1.0]) / target.pitch_x_mm / 8
    shift = np.array([(SIZE[0] - 1) / 2 + 0.3, (SIZE[1] - 1) / 2 - 0.2, 0.0])
    to_middle, to_image = np.eye(3), np.eye(3)
    to_middle[:, 2] -= middle
    to_image[:, 2] += shift
    return np.asarray(to_image @ view @ to_middle)


def seen(view: Array, points: Array) -> Array:
    """``(n, 2)`` px of points ``(n, 2)`` or ``(n, 3)``, mm."""
    image = np.column_stack([points[:, :2], np.ones(len(points))]) @ view.T
    return image[:, :2] / image[:, 2:]


def photograph(view: Array, ink: Ink, *, blur_px: float, contrast: float = 100.0) -> Array:
    """``(H, W)`` grey levels: 140 white, less `contrast` where there is ink.

    Seen eight times finer, blurred there, averaged over each pixel. `ink` says for places x, y
    in mm how much there is, 0 to 1; it smooths its own edges over a sample.
    """
    width, height = SIZE
    v, u = np.mgrid[: height * FINE, : width * FINE]
    x, y = (u + 0.5) / FINE - 0.5, (v + 0.5) / FINE - 0.5
    back = np.linalg.inv(view)
    px, py, pw = (row[0] * x + row[1] * y + row[2] for row in back)
    fine = 140.0 - contrast * ink(px / pw, py / pw)
    blurred = np.asarray(cv2.GaussianBlur(fine, (0, 0), blur_px * FINE))
    return np.asarray(blurred.reshape(height, FINE, width, FINE).mean(axis=(1, 3)))


def squares_ink(target: Target) -> Ink:
    """A checkerboard's: black up and left of the first corner."""

    def ink(x: Array, y: Array) -> Array:
        sides = _side(x / target.pitch_x_mm, target.columns)
        sides = sides * _side(y / target.pitch_y_mm, target.rows)
        across = (x > -target.pitch_x_mm) & (x < target.columns * target.pitch_x_mm)
        down = (y > -target.pitch_y_mm) & (y < target.rows * target.pitch_y_mm)
        return np.where(across & down, (1 + sides) / 2, 0.0)

    return ink


def _side(shares: Array, count: int) -> Array:
    """1 and -1 in turns, changing over one sample at whole numbers 0 to count - 1."""
    nearest = np.clip(np.rint(shares), -1, count)
    slope = np.hypot(*np.gradient(shares))
    turns = 1 - 2 * (nearest % 2)
    return np.asarray(-turns * np.clip(2 * (shares - nearest) / slope, -1, 1))


def circles_ink(target: Target, diameter_mm: float) -> Ink:
    """Discs about the target's points."""

    def ink(x: Array, y: Array) -> Array:
        column = np.clip(np.rint(x / target.pitch_x_mm), 0, target.columns - 1)
        row = np.clip(np.rint(y / target.pitch_y_mm), 0, target.rows - 1)
        away = np.hypot(x - column * target.pitch_x_mm, y - row * target.pitch_y_mm)
        outside = away - diameter_mm / 2
        return np.asarray(np.clip(0.5 - outside / np.hypot(*np.gradient(away)), 0, 1))

    return ink
