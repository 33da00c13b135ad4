"""Points that both devices see, on the rays of camera pixels: where uncertainty is asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.geometry.lens import pixel_rays, project
from fringeworks.model import Rig

Array = NDArray[np.float64]

ROWS, COLUMNS = 9, 13
FINE = 40
"""Cells each way by which a working range is found."""

WORKING_SHARE = 0.7
"""Of what the projector can light of the camera's image, where a rig is said to work."""

SEARCHED_MM = (10.0, 20_000.0)
SEARCH_STEPS = 400


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Points of one scan.

    Attributes
    ----------
    points
        ``(n, 3)`` mm, camera frame.
    camera_px, projector_px
        ``(n, 2)`` where both devices see them.
    """

    points: Array
    camera_px: Array
    projector_px: Array

    @classmethod
    def of(cls, rig: Rig, camera_px: Array, depth_mm: Array) -> Seen:
        """Points at these depths ``(n,)`` on the rays of these pixels ``(n, 2)``."""
        points = pixel_rays(camera_px, rig.camera.lens.vector) * depth_mm[:, None]
        moved = rig.projector_from_camera.apply(points)
        return cls(points, camera_px, project(moved, rig.projector.lens.vector))

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Seen:
        return Seen(self.points[chosen], self.camera_px[chosen], self.projector_px[chosen])

    def lit(self, rig: Rig) -> NDArray[np.bool_]:
        """``(n,)`` whether the projector's image covers them."""
        last = np.array([rig.projector.width, rig.projector.height]) - 0.5
        return np.asarray(((self.projector_px >= -0.5) & (self.projector_px <= last)).all(axis=1))


def grid_of(rig: Rig, *, rows: int = ROWS, columns: int = COLUMNS) -> Array:
    """``(n, 2)`` the middles of as many cells of the camera's image, px."""
    x = (np.arange(columns) + 0.5) * rig.camera.width / columns - 0.5
    y = (np.arange(rows) + 0.5) * rig.camera.height / rows - 0.5
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def wall_at(
    rig: Rig, depth_mm: float, *, rows: int = ROWS, columns: int = COLUMNS
) -> tuple[Seen, float]:
    """What is lit of a wall at this depth, across the camera's axis, and its share of the image."""
    pixels = grid_of(rig, rows=rows, columns=columns)
    wall = Seen.of(rig, pixels, np.full(len(pixels), depth_mm))
    lit = wall.lit(rig)
    return wall[lit], float(lit.mean())


def working_range(rig: Rig, *, share: float = WORKING_SHARE) -> tuple[float, float]:
    """Depths, mm, where the projector lights this share of the most of the image that it can.

    The far end is infinite where it still does at 20 m. Found to one part in fifty.

    Raises
    ------
    UsageError
        It lights nothing that the camera sees, at any depth.
    """
    depths = np.geomspace(*SEARCHED_MM, SEARCH_STEPS)
    lit = np.array([wall_at(rig, depth, rows=FINE, columns=FINE)[1] for depth in depths])
    if not lit.any():
        raise UsageError("the rig's projector must light what its camera sees, got no such depth")
    works = lit >= share * lit.max()
    ends = depths[works][[0, -1]]
    return float(ends[0]), float(np.inf if works[-1] else ends[1])
