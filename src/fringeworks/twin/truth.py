"""What is true at the camera's pixel centres: where each looks, and what lights that point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.twin.cast import Caster, Sight
from fringeworks.twin.optics import Optics

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """A scene as a rig sees it, exact to rounding.

    Attributes
    ----------
    xyz
        ``(H, W, 3)``, mm in the camera's frame: where the ray of each pixel's centre ends; NaN
        where it meets nothing.
    column, row
        ``(H, W)`` projector coordinates, px, of that point; NaN where the projector does not light
        it: something stands between, it lies outside the image, or it faces away.
    surface
        ``(H, W)`` int16, index into `names`; -1 where the ray meets nothing.
    names
        Of the scene's objects.
    """

    xyz: Array
    column: Array
    row: Array
    surface: NDArray[np.int16]
    names: tuple[str, ...]


def find_truth(caster: Caster, camera: Optics, projector: Optics) -> Truth:
    """The truth of a scene under a rig's optics."""
    shape = (camera.height, camera.width)
    sight = caster.look(*camera.rays(camera.pixel_grid()))
    coordinates = light_on(caster, sight, projector)
    return Truth(
        xyz=sight.points.reshape(*shape, 3),
        column=coordinates[:, 0].reshape(shape).copy(),
        row=coordinates[:, 1].reshape(shape).copy(),
        surface=sight.surface.reshape(shape),
        names=tuple(thing.name for thing in caster.scene.objects),
    )


def light_on(caster: Caster, sight: Sight, projector: Optics) -> Array:
    """Projector coordinates ``(n, 2)``, px, of points seen; NaN where it does not light them."""
    coordinates = projector.pixels(sight.points)
    origins = projector.origins_of(sight.points)
    faces = np.einsum("ij,ij->i", origins - sight.points, sight.normals) > 0
    lit = faces & projector.inside(coordinates)
    some = np.flatnonzero(lit)
    lit[some] = ~caster.hidden(sight.points[some], origins[some])
    return np.where(lit[:, None], coordinates, np.nan)
