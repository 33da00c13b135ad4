"""Rays cast into a scene: what each meets first, and what stands in the light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.rays import Body, finish, hide_behind, look_at
from fringeworks.kernels.sheet import Sheet, sheet_albedo
from fringeworks.twin.bodies import body_of
from fringeworks.twin.meshes import MeshBody, mesh_body
from fringeworks.twin.scene import Board, Mesh, Object, Scene
from fringeworks.twin.texture import sheet_of

Array = NDArray[np.float64]

CHUNK = 1 << 16
"""Rays at a time: their arrays stay within a core's cache."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What each of n rays meets first.

    Attributes
    ----------
    distance
        ``(n,)``, mm along the ray; inf where it meets nothing.
    surface
        ``(n,)`` int16, index into ``scene.objects``; -1 where it meets nothing.
    points, normals
        ``(n, 3)``, mm, and of length one, turned towards the ray's origin; NaN for nothing.
    albedo
        ``(n,)``, 0 to 1, a texture averaged over the ray's footprint; NaN for nothing.
    """

    distance: Array
    surface: NDArray[np.int16]
    points: Array
    normals: Array
    albedo: Array


class Caster:
    """A scene made ready for rays: its shapes packed, its prints drawn, its meshes searchable.

    Raises
    ------
    UsageError
        A mesh or a board of the scene cannot be used.
    MissingExtraError
        The scene has a mesh and Embree is not installed.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._bodies = [_body(thing) for thing in scene.objects]
        self._sheets = [_sheet(thing) for thing in scene.objects]
        self._albedos = np.array([thing.material.albedo for thing in scene.objects])

    def look(self, origins: Array, directions: Array, *, pixel_rad: float = 0.0) -> Sight:
        """What rays ``(n, 3)`` of unit direction, in the camera's frame, meet first.

        `pixel_rad` is the angle that a ray stands for (pixel pitch over focal length over samples
        per side): prints are averaged over it. Nothing nearer to an origin than `CLEARANCE_MM`
        counts. Rays with NaN meet nothing.
        """
        count = len(origins)
        sight = Sight(
            distance=np.full(count, np.inf),
            surface=np.full(count, -1, np.int16),
            points=np.empty((count, 3)),
            normals=np.full((count, 3), np.nan),
            albedo=np.empty(count),
        )
        for part in _chunks(count):
            rays = _plain(origins[part]), _plain(directions[part])
            self._look(rays, _part_of(sight, part), pixel_rad)
        return sight

    def hidden(self, points: Array, origins: Array) -> NDArray[np.bool_]:
        """``(n,)``: whether something stands between each point ``(n, 3)`` and its origin.

        Nothing nearer to either end than `CLEARANCE_MM` counts. False where there is NaN.
        """
        hidden = np.zeros(len(points), np.bool_)
        for part in _chunks(len(points)):
            ends, starts, mask = _plain(points[part]), _plain(origins[part]), hidden[part]
            for body in self._bodies:
                if isinstance(body, MeshBody):
                    body.hide(ends, starts, mask)
                else:
                    hide_behind(body, ends, starts, mask)
        return hidden

    def _look(self, rays: tuple[Array, Array], sight: Sight, pixel_rad: float) -> None:
        met = sight.distance, sight.surface, sight.normals
        for index, body in enumerate(self._bodies):
            if isinstance(body, MeshBody):
                body.look(index, rays, met)
            else:
                look_at(body, index, rays, met)
        finish(rays, met, self._albedos, (sight.points, sight.albedo))
        for index, sheet in enumerate(self._sheets):
            if sheet is not None:
                views = sight.points, rays[1], sight.normals
                widths = pixel_rad, sight.distance
                sheet_albedo(sheet, index, sight.surface, views, widths, sight.albedo)


def _body(thing: Object) -> Body | MeshBody:
    if isinstance(thing.shape, Mesh):
        return mesh_body(thing.shape, thing.camera_from_object)
    return body_of(thing.shape, thing.camera_from_object)


def _sheet(thing: Object) -> Sheet | None:
    return sheet_of(thing, thing.shape) if isinstance(thing.shape, Board) else None


def _chunks(count: int) -> list[slice]:
    return [slice(start, min(start + CHUNK, count)) for start in range(0, count, CHUNK)]


def _part_of(sight: Sight, part: slice) -> Sight:
    """A view of some of the rays."""
    return Sight(
        sight.distance[part],
        sight.surface[part],
        sight.points[part],
        sight.normals[part],
        sight.albedo[part],
    )


def _plain(array: Array) -> Array:
    return np.ascontiguousarray(array, dtype=np.float64)
