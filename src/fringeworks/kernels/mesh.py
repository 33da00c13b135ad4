"""Triangles met by rays, in double precision, after a search in single named them.

The search runs in the mesh's frame about the middle of its bounding ball and from where the ray
enters the ball: its coordinates are no larger than the mesh, so float32 places them to 1e-7 of its
size.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.rays import (
    CLEARANCE_MM,
    Body,
    Surfaces,
    enter_normal,
    rotated,
    towards,
)
from fringeworks.kernels.shapes import Vector

Array: TypeAlias = NDArray[np.float64]
Singles: TypeAlias = NDArray[np.float32]


@kernel
def into_body(o: Vector, d: Vector, high: float, body: Body) -> tuple[float, Vector, Vector]:
    """Where a ray enters a body's ball: distance, place about its middle, and direction.

    The last two in the object's frame; the distance is inf for a ray that misses the ball, or
    enters it beyond `high`.
    """
    bx, by, bz = o[0] - body.middle[0], o[1] - body.middle[1], o[2] - body.middle[2]
    nearest = -(bx * d[0] + by * d[1] + bz * d[2])
    bx, by, bz = bx + nearest * d[0], by + nearest * d[1], bz + nearest * d[2]
    left = body.radius * body.radius - (bx * bx + by * by + bz * bz)
    along = rotated(body.rotation, d)
    if not (left >= 0 and nearest + math.sqrt(left) > CLEARANCE_MM):
        return math.inf, along, along
    start = max(nearest - math.sqrt(left), CLEARANCE_MM)
    if not start < high:
        return math.inf, along, along
    back = start - nearest
    place = rotated(body.rotation, (bx + back * d[0], by + back * d[1], bz + back * d[2]))
    return start, place, along


@kernel
def ray_of(rays: tuple[Array, Array], ends: bool, i: int) -> tuple[Vector, Vector, float]:
    """Ray i: origin, direction and length; `ends` says that points stand in place of directions."""
    origins, others = rays
    if ends:
        return towards(origins, others, i)
    o = (origins[i, 0], origins[i, 1], origins[i, 2])
    return o, (others[i, 0], others[i, 1], others[i, 2]), math.inf


@kernel
def aim(
    body: Body, rays: tuple[Array, Array], ends: bool, highs: Array
) -> tuple[NDArray[np.int64], Singles, Singles]:
    """Rays that may meet the body before `highs`, mm.

    Their indices ``(m,)``, and for the search their origins and directions ``(m, 3)``.
    """
    chosen = np.empty(len(highs), np.int64)
    origins = np.empty((len(highs), 3), np.float32)
    directions = np.empty((len(highs), 3), np.float32)
    count = 0
    for i in range(len(highs)):
        o, d, _ = ray_of(rays, ends, i)
        start, place, along = into_body(o, d, highs[i], body)
        if not start < math.inf:
            continue
        for j, value in enumerate(place):
            origins[count, j] = value
        for j, value in enumerate(along):
            directions[count, j] = value
        chosen[count] = i
        count += 1
    return chosen[:count], origins[:count], directions[:count]


@kernel
def meet_triangle(place: Vector, along: Vector, corners: Array, normal: Array) -> float:
    """Distance to a triangle's plane, kept between the triangle's nearest and furthest corner.

    The search knows that the triangle is met, but an all but parallel ray may leave its plane far
    outside it.
    """
    low, high, height, fall = math.inf, -math.inf, 0.0, 0.0
    for k in range(3):
        t = 0.0
        for j in range(3):
            t += (corners[k, j] - place[j]) * along[j]
        low, high = min(low, t), max(high, t)
    for j in range(3):
        height += (corners[0, j] - place[j]) * normal[j]
        fall += along[j] * normal[j]
    t = height / fall
    return min(max(t, low), high) if math.isfinite(t) else low


@kernel
def look_at_mesh(
    body: Body,
    index: int,
    rays: tuple[Array, Array],
    triangles: tuple[Array, Array],
    found: tuple[NDArray[np.int64], NDArray[np.int32]],
    met: tuple[Array, Surfaces, Array],
) -> None:
    """Enter the triangles found, as `rays.look_at` does.

    `triangles` are corners ``(m, 3, 3)`` about the ball's middle and normals ``(m, 3)``; `found`
    names rays and their triangles, -1 for none; `met` is distance, surface, normals.
    """
    corners, flats = triangles
    distance, surface, normals = met
    for n in range(len(found[0])):
        i, face = found[0][n], found[1][n]
        if face < 0:
            continue
        o, d, _ = ray_of(rays, False, i)
        start, place, along = into_body(o, d, distance[i], body)
        t = start + meet_triangle(place, along, corners[face], flats[face])
        if t > CLEARANCE_MM and t < distance[i]:
            distance[i], surface[i] = t, index
            flat = flats[face]
            enter_normal(body.rotation, (flat[0], flat[1], flat[2]), d, normals[i])


@kernel
def hide_behind_mesh(
    body: Body,
    rays: tuple[Array, Array],
    triangles: tuple[Array, Array],
    found: tuple[NDArray[np.int64], NDArray[np.int32]],
    hidden: NDArray[np.bool_],
) -> None:
    """Mark the points (second of `rays`, after their origins) that the triangles found hide."""
    corners, flats = triangles
    for n in range(len(found[0])):
        i, face = found[0][n], found[1][n]
        if face < 0:
            continue
        o, d, length = ray_of(rays, True, i)
        start, place, along = into_body(o, d, length, body)
        t = start + meet_triangle(place, along, corners[face], flats[face])
        hidden[i] |= t > CLEARANCE_MM and t < length - CLEARANCE_MM
