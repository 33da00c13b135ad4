"""The paper's template: the code frame as a calibration board shows it, for its partitions.

Section 5: "the camera captures the design pattern [on the calibration board]. [It] can be used for
partition to the detected area to avoid the phase codewords aliasing effect." On the board every
camera pixel sees a known fringe. An object's pixel sees another one, further by its distance from
the board's plane; as long as it is within half a repeat of the code, the codeword tells which.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import Codeword, FloatMap
from fringeworks.phase.window import CoordinateWindow

LEAST_PIXELS = 100

PLANE_TOLERANCE_PX = 2.0
"""Median distance, projector px, of a board's coordinates from those of a plane: lenses bend them
by less; a board with something before it, or behind, by more."""

Array = NDArray[np.float64]


def template_window(column: FloatMap, code: Codeword) -> CoordinateWindow:
    """Window of half a repeat of the code on either side of what a board shows.

    Parameters
    ----------
    column
        ``(H, W)`` projector coordinate, px, along the code's axis, of the capture of a board alone,
        such as a pose of the calibration; NaN where it shows none. The board's plane is continued
        over the whole view.
    code
        Its period times its number of codewords is the repeat.

    Raises
    ------
    DecodeError
        Fewer than 100 pixels are known, or they lie on no plane.
    """
    centre = continue_plane(column)
    reach = np.float32(code.period_px * len(code.codewords_px) / 2)
    return CoordinateWindow(centre - reach, centre + reach)


def continue_plane(column: FloatMap) -> FloatMap:
    """Coordinate ``(H, W)``, px, that a plane seen in part shows over the whole view.

    Through pinholes a plane's coordinate is ``u = (a x + b y + c) / (g x + h y + 1)`` of the
    camera's pixel, a row of its homography; least squares on u times the denominator.
    """
    known = np.isfinite(column)
    if np.count_nonzero(known) < LEAST_PIXELS:
        raise DecodeError(
            f"the template shows {np.count_nonzero(known)} valid pixels: it needs a capture of a "
            f"board with {LEAST_PIXELS} or more"
        )
    rows, columns = column.shape
    y, x = np.indices(column.shape, dtype=np.float64)
    x, y = 2 * x / columns - 1, 2 * y / rows - 1  # of order one: the fit is well conditioned
    flat = np.stack([x, y, np.ones_like(x)], axis=-1)
    u = column[known].astype(np.float64)
    design = np.concatenate([flat[known], -u[:, None] * flat[known][:, :2]], axis=1)
    a, b, c, g, h = np.linalg.lstsq(design, u, rcond=None)[0]
    plane: FloatMap = ((flat @ [a, b, c]) / (flat @ [g, h, 1.0])).astype(np.float32)
    away = float(np.median(np.abs(plane[known] - column[known])))
    if away > PLANE_TOLERANCE_PX:
        raise DecodeError(
            f"the template is no plane: its coordinates are {away:.1f} px away from one (median); "
            "it needs a capture of the board alone"
        )
    return plane
