"""Where rays meet the twin's shapes, each in its own frame.

A ray is ``o + t d``, d of length one and o near the shape: then the roots of a quadratic are exact
to rounding. A hit is ``(t, nx, ny, nz)``: the least ``t > low``, and the normal of length one, on
either side; t is inf without one.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.blend import meet_blend, unit
from fringeworks.kernels.compiled import kernel

Array: TypeAlias = NDArray[np.float64]
Vector: TypeAlias = tuple[float, float, float]
Hit: TypeAlias = tuple[float, float, float, float]

PLANE, SPHERE, CYLINDER, CONE, BOX, SHEET, BLEND = range(7)


@kernel
def roots(a: float, b: float, c: float) -> tuple[float, float]:
    """Solutions of ``a t^2 + 2 b t + c = 0``, the lesser first; NaN without any.

    Neither is a difference of near numbers. With a = 0 one of them is infinite.
    """
    square = b * b - a * c
    if not square >= 0:
        return math.nan, math.nan
    q = -(b + math.copysign(math.sqrt(square), b))
    one, other = q / a, c / q
    if q == 0:
        one, other = 0.0, 0.0
    return (one, other) if one <= other else (other, one)


@kernel
def meet_plane(o: Vector, d: Vector, low: float, sizes: Array) -> Hit:
    """`sizes`: half the width and half the height."""
    t = -o[2] / d[2]
    inside = abs(o[0] + t * d[0]) <= sizes[0] and abs(o[1] + t * d[1]) <= sizes[1]
    if t > low and t < math.inf and inside:
        return t, 0.0, 0.0, 1.0
    return math.inf, 0.0, 0.0, 0.0


@kernel
def meet_sphere(o: Vector, d: Vector, low: float, sizes: Array) -> Hit:
    """`sizes`: the radius."""
    along = o[0] * d[0] + o[1] * d[1] + o[2] * d[2]
    c = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - sizes[0] * sizes[0]
    near, far = roots(1.0, along, c)
    t = near if near > low else far
    if t > low:
        return unit(t, o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
    return math.inf, 0.0, 0.0, 0.0


@kernel
def nearest_disc(o: Vector, d: Vector, low: float, best: Hit, disc: tuple[float, float]) -> Hit:
    """The disc about the axis (its height and radius) where it is met before `best`."""
    z, radius = disc
    t = (z - o[2]) / d[2]
    x, y = o[0] + t * d[0], o[1] + t * d[1]
    if t > low and t < best[0] and x * x + y * y <= radius * radius:
        return t, 0.0, 0.0, 1.0
    return best


@kernel
def meet_cylinder(o: Vector, d: Vector, low: float, sizes: Array) -> Hit:
    """`sizes`: radius and half the length."""
    radius, half = sizes[0], sizes[1]
    best = (math.inf, 0.0, 0.0, 0.0)
    across = o[0] * d[0] + o[1] * d[1]
    c = o[0] * o[0] + o[1] * o[1] - radius * radius
    for t in roots(d[0] * d[0] + d[1] * d[1], across, c):
        if t > low and t < best[0] and abs(o[2] + t * d[2]) <= half:
            best = unit(t, o[0] + t * d[0], o[1] + t * d[1], 0.0)
    best = nearest_disc(o, d, low, best, (-half, radius))
    return nearest_disc(o, d, low, best, (half, radius))


@kernel
def meet_cone(o: Vector, d: Vector, low: float, sizes: Array) -> Hit:
    """`sizes`: radius of the base and height; the mantle is ``x^2 + y^2 = s^2 (height - z)^2``."""
    radius, height = sizes[0], sizes[1]
    square = (radius / height) ** 2
    down = height - o[2]
    a = d[0] * d[0] + d[1] * d[1] - square * d[2] * d[2]
    b = o[0] * d[0] + o[1] * d[1] + square * down * d[2]
    c = o[0] * o[0] + o[1] * o[1] - square * down * down
    best = (math.inf, 0.0, 0.0, 0.0)
    for t in roots(a, b, c):
        z = o[2] + t * d[2]
        if t > low and t < best[0] and z >= 0 and z <= height:
            best = unit(t, o[0] + t * d[0], o[1] + t * d[1], square * (height - z))
    return nearest_disc(o, d, low, best, (0.0, radius))


@kernel
def meet_box(o: Vector, d: Vector, low: float, sizes: Array) -> Hit:
    """`sizes`: half the edges. The ray is inside where it is between all three pairs of faces."""
    enter, leave = -math.inf, math.inf
    first, last = 0, 0
    for axis in range(3):
        one, other = (-sizes[axis] - o[axis]) / d[axis], (sizes[axis] - o[axis]) / d[axis]
        if d[axis] == 0:
            outside = abs(o[axis]) > sizes[axis]
            one, other = (math.inf, math.inf) if outside else (-math.inf, math.inf)
        if min(one, other) > enter:
            enter, first = min(one, other), axis
        if max(one, other) < leave:
            leave, last = max(one, other), axis
    t, axis = (enter, first) if enter > low else (leave, last)
    if enter <= leave and t > low and t < math.inf:
        x, y = 1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0
        return t, x, y, 1 - x - y
    return math.inf, 0.0, 0.0, 0.0


@kernel
def meet_sheet(o: Vector, d: Vector, low: float, sizes: Array) -> Hit:
    """A bowed sheet; `sizes`: middle x, y, half the sides, bow along x, y.

    ``z + bow_x (1 - x'^2) + bow_y (1 - y'^2) = 0`` with x', y' from -1 to 1.
    """
    half_x, half_y, bow_x, bow_y = sizes[2], sizes[3], sizes[4], sizes[5]
    x, y = (o[0] - sizes[0]) / half_x, (o[1] - sizes[1]) / half_y
    dx, dy = d[0] / half_x, d[1] / half_y
    a = -bow_x * dx * dx - bow_y * dy * dy
    b = d[2] / 2 - bow_x * x * dx - bow_y * y * dy
    c = o[2] + bow_x * (1 - x * x) + bow_y * (1 - y * y)
    for t in roots(a, b, c):
        px, py = x + t * dx, y + t * dy
        if t > low and abs(px) <= 1 and abs(py) <= 1:
            return unit(t, -2 * bow_x * px / half_x, -2 * bow_y * py / half_y, 1.0)
    return math.inf, 0.0, 0.0, 0.0


@kernel
def meet_shape(shape: int, o: Vector, d: Vector, span: tuple[float, float], sizes: Array) -> Hit:
    """The hit of any shape; beyond the far end of `span` it may be inf."""
    if shape == PLANE:
        return meet_plane(o, d, span[0], sizes)
    if shape == SPHERE:
        return meet_sphere(o, d, span[0], sizes)
    if shape == CYLINDER:
        return meet_cylinder(o, d, span[0], sizes)
    if shape == CONE:
        return meet_cone(o, d, span[0], sizes)
    if shape == BOX:
        return meet_box(o, d, span[0], sizes)
    if shape == SHEET:
        return meet_sheet(o, d, span[0], sizes)
    return meet_blend(o, d, span, sizes)
