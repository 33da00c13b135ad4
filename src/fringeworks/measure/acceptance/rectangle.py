"""The least rectangle about flat points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rectangle_of(points: Array) -> Array:
    """``(4, 3)`` corners of the least rectangle that holds flat points, its longer side first.

    One of its sides lies along a side of the points' convex hull.
    """
    from scipy.spatial import ConvexHull

    centre = points.mean(axis=0)
    centred = points - centre
    plane = np.linalg.eigh(centred.T @ centred)[1][:, :0:-1]
    flat = centred @ plane
    hull = flat[ConvexHull(flat).vertices]
    sides = np.roll(hull, -1, axis=0) - hull
    least = min((_along(hull, side) for side in sides), key=_area)
    if np.linalg.norm(least[1] - least[0]) < np.linalg.norm(least[2] - least[1]):
        least = np.roll(least, -1, axis=0)
    return np.asarray(centre + least @ plane.T)


def _along(hull: Array, side: Array) -> Array:
    """``(4, 2)`` corners of the rectangle along `side` that holds the hull."""
    along = side / np.linalg.norm(side)
    frame = np.array([along, [-along[1], along[0]]])
    u, v = (hull @ frame.T).T
    ends = [(u.min(), v.min()), (u.max(), v.min()), (u.max(), v.max()), (u.min(), v.max())]
    return np.asarray(np.array(ends) @ frame)


def _area(loop: Array) -> float:
    return float(np.linalg.norm(loop[1] - loop[0]) * np.linalg.norm(loop[2] - loop[1]))
