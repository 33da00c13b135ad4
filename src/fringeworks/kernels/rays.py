"""Rays against bodies: shapes at their places in the camera's frame.

A ray is moved to its place nearest to the middle of a body's bounding ball and passes the body by
if that is outside the ball; what is left is `kernels.shapes`' matter.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.shapes import Array, Hit, Vector, meet_shape

Surfaces: TypeAlias = NDArray[np.int16]

CLEARANCE_MM = 1e-3
"""What is nearer to a ray's ends than this does not count: rays start and end on surfaces.

Points lie on their surface to 1e-9 mm, so a ray that leaves at more than 1e-6 rad is clear of it.
"""


class Body(NamedTuple):
    """A shape, its sizes, and its place in the camera's frame.

    Attributes
    ----------
    shape
        One of `PLANE` ... `BLEND`.
    sizes
        What the shape's function takes.
    rotation
        ``(3, 3)``, object_from_camera's.
    middle, offset
        ``(3,)``: the middle of the bounding ball in the camera's frame and in the object's.
    radius
        Of that ball, mm; may be inf.
    """

    shape: int
    sizes: Array
    rotation: Array
    middle: Array
    offset: Array
    radius: float


@kernel
def meet_body(o: Vector, d: Vector, span: tuple[float, float], body: Body) -> Hit:
    """The hit of a body by a ray in the camera's frame: t inside `span`, normal in the object's."""
    bx, by, bz = o[0] - body.middle[0], o[1] - body.middle[1], o[2] - body.middle[2]
    nearest = -(bx * d[0] + by * d[1] + bz * d[2])
    bx, by, bz = bx + nearest * d[0], by + nearest * d[1], bz + nearest * d[2]
    left = body.radius * body.radius - (bx * bx + by * by + bz * bz)
    if not left >= 0:
        return math.inf, 0.0, 0.0, 0.0
    reach = math.sqrt(left)
    low, high = max(span[0] - nearest, -reach), min(span[1] - nearest, reach)
    if not low <= high:
        return math.inf, 0.0, 0.0, 0.0
    place = rotated(body.rotation, (bx, by, bz))
    place = (place[0] + body.offset[0], place[1] + body.offset[1], place[2] + body.offset[2])
    t, nx, ny, nz = meet_shape(
        body.shape, place, rotated(body.rotation, d), (low, high), body.sizes
    )
    if not t + nearest < span[1]:
        return math.inf, 0.0, 0.0, 0.0
    return t + nearest, nx, ny, nz


@kernel
def rotated(rotation: Array, v: Vector) -> Vector:
    """``rotation @ v``."""
    x = rotation[0, 0] * v[0] + rotation[0, 1] * v[1] + rotation[0, 2] * v[2]
    y = rotation[1, 0] * v[0] + rotation[1, 1] * v[1] + rotation[1, 2] * v[2]
    z = rotation[2, 0] * v[0] + rotation[2, 1] * v[1] + rotation[2, 2] * v[2]
    return x, y, z


@kernel
def look_at(
    body: Body, index: int, rays: tuple[Array, Array], met: tuple[Array, Surfaces, Array]
) -> None:
    """Enter a body where rays (origins and directions, ``(n, 3)``) meet it before anything else.

    `met` holds distance, surface and normals of what they met so far.
    """
    origins, directions = rays
    distance, surface, normals = met
    for i in range(len(origins)):
        o = (origins[i, 0], origins[i, 1], origins[i, 2])
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        t, nx, ny, nz = meet_body(o, d, (CLEARANCE_MM, distance[i]), body)
        if t < distance[i]:
            distance[i], surface[i] = t, index
            enter_normal(body.rotation, (nx, ny, nz), d, normals[i])


@kernel
def enter_normal(rotation: Array, normal: Vector, d: Vector, out: Array) -> None:
    """Turn a normal of the object's frame into the camera's, against the ray's direction."""
    x = rotation[0, 0] * normal[0] + rotation[1, 0] * normal[1] + rotation[2, 0] * normal[2]
    y = rotation[0, 1] * normal[0] + rotation[1, 1] * normal[1] + rotation[2, 1] * normal[2]
    z = rotation[0, 2] * normal[0] + rotation[1, 2] * normal[1] + rotation[2, 2] * normal[2]
    side = -1.0 if x * d[0] + y * d[1] + z * d[2] > 0 else 1.0
    out[0], out[1], out[2] = side * x, side * y, side * z


@kernel
def finish(
    rays: tuple[Array, Array],
    met: tuple[Array, Surfaces, Array],
    albedos: Array,
    out: tuple[Array, Array],
) -> None:
    """Enter points ``(n, 3)`` and albedos ``(n,)`` of what was met; NaN for nothing."""
    origins, directions = rays
    points, albedo = out
    for i in range(len(origins)):
        surface = met[1][i]
        albedo[i] = albedos[surface] if surface >= 0 else math.nan
        for j in range(3):
            reached = origins[i, j] + met[0][i] * directions[i, j]
            points[i, j] = reached if surface >= 0 else math.nan


@kernel
def towards(origins: Array, points: Array, i: int) -> tuple[Vector, Vector, float]:
    """Origin i, the unit direction from it to point i, and their distance."""
    ox, oy, oz = origins[i, 0], origins[i, 1], origins[i, 2]
    dx, dy, dz = points[i, 0] - ox, points[i, 1] - oy, points[i, 2] - oz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return (ox, oy, oz), (dx / length, dy / length, dz / length), length


@kernel
def hide_behind(body: Body, points: Array, origins: Array, hidden: NDArray[np.bool_]) -> None:
    """Mark the points ``(n, 3)`` between which and their origins the body stands."""
    for i in range(len(points)):
        if hidden[i]:
            continue
        o, d, length = towards(origins, points, i)
        high = length - CLEARANCE_MM
        hidden[i] = meet_body(o, d, (CLEARANCE_MM, high), body)[0] < high
