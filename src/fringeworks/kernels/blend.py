"""Where rays meet capsules that melt into each other: sphere tracing, then Newton.

The distance of a capsule (all spheres whose centre and radius run linearly between two ends) is
the least of ``|p - c(h)| - r(h)``, convex in h: its free minimum, clamped. Capsules are joined by
the polynomial smooth minimum ``min(a, b) - h^2 k / 4`` with ``h = max(k - |a - b|, 0) / k``, whose
gradient is a mean of both: the field never changes faster than the way walked, so a step as long
as its value is safe. (Sphere tracing: Hart, The Visual Computer 12, 1996.)
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Hit = tuple[float, float, float, float]

HEAD, STRIDE = 2, 13
"""Sizes: smooth_mm, count; then start, axis, length, both radii, middle and radius of its ball."""

MARCH_STEPS = 500
NEAR_MM = 1.0
"""Newton takes over where the value is below this times the square of its slope along the ray: a
surface less curved than 1 / (2 NEAR_MM) is then ahead."""

NEWTON_STEPS = 12
NEWTON_MM = 1e-6
"""A step below this leaves its square times half the curvature, below 1e-11 mm."""

TOUCH_MM = 1e-7
"""A ray that grazes nearer than this meets the surface."""


@kernel
def blend_at(x: float, y: float, z: float, sizes: Array) -> Hit:
    """Value, mm, and gradient of the field."""
    smooth = sizes[0]
    value, gx, gy, gz = math.inf, 0.0, 0.0, 0.0
    for i in range(int(sizes[1])):
        k = HEAD + i * STRIDE
        bx, by, bz = x - sizes[k + 9], y - sizes[k + 10], z - sizes[k + 11]
        far = value + smooth + sizes[k + 12]
        if bx * bx + by * by + bz * bz > far * far and far > 0:
            continue  # its distance exceeds the value by more than `smooth`: no influence
        other, ox, oy, oz = capsule_at((x, y, z), k, sizes)
        gap = abs(value - other)
        if other < value:
            value, other, gx, gy, gz, ox, oy, oz = other, value, ox, oy, oz, gx, gy, gz
        if gap < smooth:
            share = (smooth - gap) / smooth
            value -= share * share * smooth / 4
            weight = share / 2
            gx, gy, gz = gx + weight * (ox - gx), gy + weight * (oy - gy), gz + weight * (oz - gz)
    return value, gx, gy, gz


@kernel
def capsule_at(p: Vector, k: int, sizes: Array) -> Hit:
    """Signed distance to the capsule whose sizes start at k, mm, and its gradient."""
    px, py, pz = p[0] - sizes[k], p[1] - sizes[k + 1], p[2] - sizes[k + 2]
    ax, ay, az = sizes[k + 3], sizes[k + 4], sizes[k + 5]
    length, radius, taper = sizes[k + 6], sizes[k + 7], sizes[k + 7] - sizes[k + 8]
    along = px * ax + py * ay + pz * az
    across = math.sqrt(max(px * px + py * py + pz * pz - along * along, 0.0))
    if abs(taper) < length:
        h = along - across * taper / math.sqrt(length * length - taper * taper)
        h = min(max(h, 0.0), length)
    else:
        h = 0.0 if taper >= 0 else length  # one end's sphere holds all the others
    if length > 0:
        radius -= taper * h / length
    qx, qy, qz = px - h * ax, py - h * ay, pz - h * az
    reach = math.sqrt(qx * qx + qy * qy + qz * qz)
    if reach == 0:
        return -radius, 0.0, 0.0, 1.0
    return reach - radius, qx / reach, qy / reach, qz / reach


@kernel
def meet_blend(o: Vector, d: Vector, span: tuple[float, float], sizes: Array) -> Hit:
    """The first hit inside `span`, as in `kernels.shapes`; good to 1e-9 mm unless it grazes."""
    t, high = clip(o, d, span, sizes)
    if not t <= high:
        return math.inf, 0.0, 0.0, 0.0
    for _ in range(MARCH_STEPS):
        value, gx, gy, gz = blend_at(o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2], sizes)
        slope = gx * d[0] + gy * d[1] + gz * d[2]
        if slope < 0 and abs(value) < NEAR_MM * slope * slope:
            polished = polish(o, d, t, 4 * abs(value / slope), sizes)
            if polished[0] < math.inf:
                return polished
        if value < TOUCH_MM and slope < 0:
            return unit(t, gx, gy, gz)
        t += max(abs(value), TOUCH_MM)
        if not t <= high:
            break
    return math.inf, 0.0, 0.0, 0.0


@kernel
def clip(o: Vector, d: Vector, span: tuple[float, float], sizes: Array) -> tuple[float, float]:
    """The part of `span` in which a ray can meet the surface; its ends cross where it cannot.

    The smooth minimum is never below the least distance by more than `smooth`, so the surface lies
    in the capsules' balls grown by that.
    """
    low, high = math.inf, -math.inf
    for i in range(int(sizes[1])):
        k = HEAD + i * STRIDE
        bx, by, bz = sizes[k + 9] - o[0], sizes[k + 10] - o[1], sizes[k + 11] - o[2]
        nearest = bx * d[0] + by * d[1] + bz * d[2]
        radius = sizes[k + 12] + sizes[0]
        left = radius * radius - (bx * bx + by * by + bz * bz) + nearest * nearest
        if left >= 0:
            reach = math.sqrt(left)
            low, high = min(low, nearest - reach), max(high, nearest + reach)
    return max(low, span[0]), min(high, span[1])


@kernel
def polish(o: Vector, d: Vector, start: float, furthest: float, sizes: Array) -> Hit:
    """The hit near `start` by Newton; inf if it runs further away than it may."""
    t = start
    for _ in range(NEWTON_STEPS):
        value, gx, gy, gz = blend_at(o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2], sizes)
        slope = gx * d[0] + gy * d[1] + gz * d[2]
        step = value / slope
        t -= step
        if not (slope < 0 and abs(t - start) <= furthest):
            break
        if abs(step) < NEWTON_MM:
            return unit(t, gx, gy, gz)
    return math.inf, 0.0, 0.0, 0.0


@kernel
def unit(t: float, x: float, y: float, z: float) -> Hit:
    """A hit with its normal made of length one; an apex, which has none, gets z."""
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0:
        return t, 0.0, 0.0, 1.0
    return t, x / length, y / length, z / length
