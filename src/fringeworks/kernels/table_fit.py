"""How the numbers of a `table` come about, and how far they miss the full model they stand for."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.lattice import BLOCK, fill_powers, fill_row, first_row
from fringeworks.kernels.lens import undistort
from fringeworks.kernels.table import CURVED, LINE, RAY, bent_line, pair_at, straighten
from fringeworks.kernels.triangulate import projected, turned_ray

Array = NDArray[np.float64]
Optics = tuple[Array, Array, Array, Array]

SAMPLES = 33
"""Coordinates at which `strays` looks."""


@kernel
def divided(s: Array, value: Array) -> tuple[float, float, float, float]:
    """Divided differences of order 0 to 3 of four values at `s`."""
    one, two = (value[1] - value[0]) / (s[1] - s[0]), (value[2] - value[1]) / (s[2] - s[1])
    three = (value[3] - value[2]) / (s[3] - s[2])
    second, other = (two - one) / (s[2] - s[0]), (three - two) / (s[3] - s[1])
    return value[0], one, second, (other - second) / (s[3] - s[0])


@kernel
def fit_polynomial(s: Array, value: Array, out: Array) -> None:
    """Put c1 to c4 of ``s (c1 + c2 s + c3 s^2 + c4 s^3)`` through four points in `out`."""
    d0, d1, d2, d3 = divided(s, value / s)
    out[3] = d3
    out[2] = d2 - d3 * (s[0] + s[1] + s[2])
    out[1] = d1 - d2 * (s[0] + s[1]) + d3 * (s[0] * s[1] + s[0] * s[2] + s[1] * s[2])
    out[0] = d0 - s[0] * (d1 - s[1] * (d2 - s[2] * d3))


@kernel
def fit_bent_line(s: Array, value: Array, out: Array) -> None:
    """Put c1, c2, c3 and b of the bent line through four points in `out`; s = 0 is none of them.

    Each asks ``c1 + c2 s + c3 s^2 = value / s + b value``, whose third difference is nil.
    """
    bend = -divided(s, value / s)[3] / divided(s, value)[3]
    fit_polynomial(s, value * (1 + bend * s), out)
    out[3] = bend


@kernel
def ray_of(u: float, v: float, camera: Array) -> tuple[float, float]:
    """Ideal normalised point of a camera pixel; NaN where the lens has no inverse."""
    return undistort((u - camera[2]) / camera[0], (v - camera[3]) / camera[1], camera)


@kernel
def sample_nodes(
    step: tuple[float, float],
    optics: tuple[Array, Array, Array, Array],
    depths: Array,
    axis: int,
    nodes: Array,
) -> None:
    """Fill the lattice ``(K, rows, cols)`` from the full model.

    Parameters
    ----------
    step
        Of the lattice, px, down and across; its first node is the pixel (0, 0).
    optics
        Lenses ``(9,)`` of camera and projector, rotation and translation of
        ``projector_from_camera``.
    depths
        ``(5,)`` mm: those at which the bent lines are exact, the one of reference first.
    axis
        0 or 1: depth over this coordinate, seven numbers; 2: both coordinates over depth,
        thirteen.
    """
    camera, projector, rotation, translation = optics
    seen = np.empty((2, len(depths)))
    for row in range(nodes.shape[1]):
        for col in range(nodes.shape[2]):
            x, y = ray_of(col * step[1], row * step[0], camera)
            nodes[0, row, col], nodes[1, row, col] = x, y
            a = turned_ray(rotation, x, y)
            for i in range(len(depths)):
                seen[0, i], seen[1, i], _, _ = projected(a, translation, depths[i], projector)
            numbers = nodes[RAY:, row, col]
            away = depths[1:] - depths[0]
            if axis == 2:
                numbers[0] = a[2] / (a[2] * depths[0] + translation[2])
                for which in range(2):
                    line = numbers[1 + which * LINE :]
                    line[0] = seen[which, 0]
                    straight = away / (1 + numbers[0] * away)
                    fit_polynomial(straight, seen[which, 1:] - line[0], line[1:])
            else:
                numbers[0] = seen[axis, 0]
                fit_bent_line(seen[axis, 1:] - numbers[0], away, numbers[1:])


@kernel
def leave_out(powers: Array, t: float, numbers: Array) -> None:
    """Take from numbers, `t` px behind the powers' first row, what the fused pass leaves out."""
    half = BLOCK / 2
    for k in range(numbers.shape[0]):
        for n in range(numbers.shape[1]):
            cube, square = powers[k, 3, n], powers[k, 2, n] + 3 * t * powers[k, 3, n]
            numbers[k, n] -= cube * half**3
            if k >= CURVED:
                numbers[k, n] -= square * half**2


@kernel
def miss_at(
    pixel: Array, optics: tuple[Array, Array, Array, Array], z: float, z_reference: float, axis: int
) -> float:
    """How far, mm, the table's depth of a pixel lies from one that the full model projects.

    With both axes: of the depth from both coordinates, equally sure.
    """
    projector, rotation, translation = optics[1], optics[2], optics[3]
    a = turned_ray(rotation, pixel[0], pixel[1])
    column, row, _, _ = projected(a, translation, z, projector)
    if axis == 2:
        s, _, _ = pair_at((column, row), (1.0, 1.0), pixel)
    else:
        at = (column if axis == 0 else row) - pixel[2]
        s = bent_line(at, pixel[3], pixel[4], pixel[5], straighten(at, pixel[6]))
    return abs(z_reference + s - z)


@kernel
def strays(
    pixel: Array,
    optics: tuple[Array, Array, Array, Array],
    depths: Array,
    axis: int,
    extent: int,
) -> bool:
    """Whether coordinates inside the projector's image, but of no depth in the range, give one."""
    projector, rotation, translation = optics[1], optics[2], optics[3]
    a = turned_ray(rotation, pixel[0], pixel[1])
    first = projected(a, translation, depths[1], projector)[axis]
    last = projected(a, translation, depths[len(depths) - 1], projector)[axis]
    for k in range(SAMPLES):
        coordinate = k * extent / (SAMPLES - 1) - 0.5
        at = coordinate - pixel[2]
        z = depths[0] + bent_line(at, pixel[3], pixel[4], pixel[5], straighten(at, pixel[6]))
        beyond = (coordinate - first) * (coordinate - last) > 0
        if beyond and z > depths[1] and z < depths[len(depths) - 1]:
            return True
    return False


@kernel
def worst_miss(
    nodes: Array,
    step: tuple[float, float],
    optics: tuple[Array, Array, Array, Array],
    axis: int,
    depths: Array,
    sizes: tuple[int, int, int],
) -> float:
    """Largest error, mm, in the middle of every cell at `depths`, the first of them of reference.

    The ray's own error counts as far as it moves the point. Infinite where a depth is NaN, and
    where coordinates of no depth of the range lead into it. `sizes` are the camera's width and
    height and the projector's extent along the axis.
    """
    width, height, extent = sizes
    numbers, powers = np.empty((nodes.shape[0], width)), np.empty((nodes.shape[0], 4, width))
    worst = 0.0
    for row in range(nodes.shape[1] - 1):
        v = min(int((row + 0.5) * step[0]), height - 1)
        first = first_row(v, step[0], nodes.shape[1])
        fill_powers(nodes, step, (first, 0), powers)
        fill_row(powers, v - first, numbers)
        if axis != 2:
            leave_out(powers, v - first, numbers)
        for col in range(nodes.shape[2] - 1):
            u = min(int((col + 0.5) * step[1]), width - 1)
            pixel = numbers[:, u].copy()
            x, y = ray_of(float(u), float(v), optics[0])
            aside = math.hypot(pixel[0] - x, pixel[1] - y)
            pixel[0], pixel[1] = x, y
            if axis != 2 and strays(pixel, optics, depths, axis, extent):
                return math.inf
            for i in range(1, len(depths)):
                z = depths[i]
                miss = math.hypot(miss_at(pixel, optics, z, depths[0], axis), aside * z)
                worst = max(worst, miss) if miss == miss else math.inf
    return worst
