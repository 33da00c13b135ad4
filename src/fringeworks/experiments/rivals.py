"""The rivals of the paper's models, fitted to the same boards, and scanned with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.extended.points import Measured
from fringeworks.experiments.extended import Scanner
from fringeworks.experiments.held_rig import Still
from fringeworks.geometry.lens import project, unproject
from fringeworks.model import Axis, Cloud, FloatMap, Rig
from fringeworks.reconstruct.full import CloudRules, depth_window
from fringeworks.reconstruct.rivals import PixelPolynomials, RationalModel

Array = NDArray[np.float64]
Depths: TypeAlias = Callable[[FloatMap], NDArray[np.floating]]
"""From a map of coordinates to one of depths, mm."""

GOVERNING, FRACTION, PIXELS = "Du and Wang, 11", "linear fraction, 8", "polynomial per pixel"


def fit_rivals(measured: Measured, rig: Rig) -> Mapping[str, Scanner]:
    """Each rival by name, as it scans.

    Of the rig they take the camera's lens and the depth range; of its projector they know nothing.
    """
    points, rays = measured.points, _rays(rig)
    depths: dict[str, Depths] = {
        name: _rational(
            RationalModel.fit(points.rays, points.coordinate, points.depth, above=above), rays
        )
        for name, above in ((GOVERNING, 6), (FRACTION, 2))
    }
    seen = np.column_stack([points.rays.T, np.ones(len(points))])
    depths[PIXELS] = PixelPolynomials.fit(
        np.rint(project(seen, rig.camera.lens.vector)).astype(np.intp).T,
        points.coordinate,
        points.depth,
        shape=(rig.camera.height, rig.camera.width),
    ).depth
    return {name: _scanner(model, (rig, measured.axis), rays) for name, model in depths.items()}


def _rays(rig: Rig) -> Array:
    """``(2, H, W)`` x and y of the undistorted ray of every pixel."""
    y, x = np.mgrid[: rig.camera.height, : rig.camera.width].astype(np.float64)
    return np.moveaxis(unproject(np.stack([x, y], axis=-1), rig.camera.lens.vector), -1, 0)


def _rational(model: RationalModel, rays: Array) -> Depths:
    flat = rays.reshape(2, -1)
    return lambda coordinate: model.depth(flat, coordinate.astype(np.float64).ravel()).reshape(
        coordinate.shape
    )


def _scanner(depths: Depths, of: tuple[Rig, Axis], rays: Array) -> Scanner:
    rig, axis = of
    near, far = depth_window(rig, CloudRules())

    def scan(still: Still) -> Cloud:
        coded = next(item for item in still.projector_map.axes if item.axis == axis)
        z = depths(coded.coordinate)
        z = np.where((z > near) & (z < far), z, np.nan)
        xyz = np.stack([rays[0] * z, rays[1] * z, z], axis=-1).astype(np.float32)
        unknown = np.full(z.shape, np.nan, np.float32)
        return Cloud(xyz, unknown, coded.offset, unknown)

    return scan
