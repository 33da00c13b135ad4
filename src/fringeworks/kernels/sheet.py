"""What a camera's rays see of a printed sheet: its ink, averaged over each ray's footprint.

The print is constant on the cells of a grid with lines at `across` and `down`, mm; `sums` holds
the area of ink above and left of every crossing. Between crossings that area is bilinear, so the
mean over any upright rectangle is exact, and so is the place of an edge. Circles stand on no such
grid: their area in a rectangle is known by itself, see `discs`.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.discs import discs_area
from fringeworks.kernels.rays import Surfaces, rotated
from fringeworks.kernels.shapes import Vector

Array: TypeAlias = NDArray[np.float64]

LEAST_SIDE_MM = 1e-3
"""A point is looked at through a square of this side."""

WARP_STEPS = 8
"""Each shrinks the error by the slope of the print's error, about 1e-2 or less."""


class Sheet(NamedTuple):
    """A print and where it is.

    Attributes
    ----------
    rotation, translation
        object_from_camera.
    across, down
        ``(m,)`` and ``(n,)`` grid lines, mm in the print.
    sums
        ``(n, m)``, mm^2 of ink.
    circles
        Radius, mm, columns and rows of circles on the corners' grid from (0, 0); none where the
        radius is 0, else there is no other ink.
    scale_x, scale_y
        Size of the print over the ideal one.
    shifts_x, shifts_y
        ``(r, c)``: how far the print's corners are off their places, mm; the corners stand
        `square` apart, the first at ``(-square, -square)``.
    white, black
        Albedos of sheet and ink.
    """

    rotation: Array
    translation: Array
    across: Array
    down: Array
    sums: Array
    circles: tuple[float, int, int]
    scale_x: float
    scale_y: float
    shifts_x: Array
    shifts_y: Array
    square: float
    white: float
    black: float


@kernel
def bilinear(table: Array, cell: tuple[int, int], share: tuple[float, float]) -> float:
    """Value in the cell whose first corner is [i, j], at shares of its width and height."""
    i, j = cell
    top = table[i, j] + share[0] * (table[i, j + 1] - table[i, j])
    low = table[i + 1, j] + share[0] * (table[i + 1, j + 1] - table[i + 1, j])
    return float(top + share[1] * (low - top))


@kernel
def shift_at(u: float, v: float, sheet: Sheet) -> tuple[float, float]:
    """Error of the print at (u, v), mm: bilinear between corners, constant beyond the last."""
    rows, columns = sheet.shifts_x.shape[0], sheet.shifts_x.shape[1]
    x = min(max(u / sheet.square + 1, 0.0), columns - 1.0)
    y = min(max(v / sheet.square + 1, 0.0), rows - 1.0)
    i, j = min(int(y), rows - 2), min(int(x), columns - 2)
    share = (x - j, y - i)
    return bilinear(sheet.shifts_x, (i, j), share), bilinear(sheet.shifts_y, (i, j), share)


@kernel
def place_in_print(x: float, y: float, sheet: Sheet) -> tuple[float, float]:
    """What of the ideal print stands at (x, y) of the sheet, mm."""
    u, v = x / sheet.scale_x, y / sheet.scale_y
    for _ in range(WARP_STEPS):
        sx, sy = shift_at(u, v, sheet)
        u, v = (x - sx) / sheet.scale_x, (y - sy) / sheet.scale_y
    return u, v


@kernel
def ink_before(u: float, v: float, sheet: Sheet) -> float:
    """Ink above and left of (u, v), mm^2."""
    across, down = sheet.across, sheet.down
    u = min(max(u, across[0]), across[-1])
    v = min(max(v, down[0]), down[-1])
    j = min(max(int(np.searchsorted(across, u)) - 1, 0), len(across) - 2)
    i = min(max(int(np.searchsorted(down, v)) - 1, 0), len(down) - 2)
    fx = (u - across[j]) / (across[j + 1] - across[j])
    fy = (v - down[i]) / (down[i + 1] - down[i])
    return bilinear(sheet.sums, (i, j), (fx, fy))


@kernel
def ink_within(low: tuple[float, float], high: tuple[float, float], sheet: Sheet) -> float:
    """Ink in the rectangle from `low` to `high`, mm^2."""
    radius, columns, rows = sheet.circles
    if radius > 0:
        return float(discs_area(low, high, (radius, sheet.square, columns, rows)))
    right = ink_before(high[0], high[1], sheet) - ink_before(high[0], low[1], sheet)
    return float(right - (ink_before(low[0], high[1], sheet) - ink_before(low[0], low[1], sheet)))


@kernel
def footprint(d: Vector, normal: Vector, width: float, rotation: Array) -> tuple[float, float]:
    """Sides, mm, of the upright rectangle in the sheet that a ray of `width` mm sees.

    A square across the ray (its edges as near to the camera's x and y as can be) becomes a
    parallelogram on the sheet; the rectangle has the parallelogram's spread along x and y.
    """
    upright = (1.0, 0.0, 0.0) if abs(d[0]) < 0.9 else (0.0, 1.0, 0.0)
    along = upright[0] * d[0] + upright[1] * d[1] + upright[2] * d[2]
    ax, ay, az = upright[0] - along * d[0], upright[1] - along * d[1], upright[2] - along * d[2]
    size = math.sqrt(ax * ax + ay * ay + az * az)
    first = (ax / size, ay / size, az / size)
    second = (
        d[1] * first[2] - d[2] * first[1],
        d[2] * first[0] - d[0] * first[2],
        d[0] * first[1] - d[1] * first[0],
    )
    slope = normal[0] * d[0] + normal[1] * d[1] + normal[2] * d[2]
    x_square, y_square = 0.0, 0.0
    for e in (first, second):
        lean = (normal[0] * e[0] + normal[1] * e[1] + normal[2] * e[2]) / slope
        edge = rotated(rotation, (e[0] - lean * d[0], e[1] - lean * d[1], e[2] - lean * d[2]))
        x_square += edge[0] * edge[0]
        y_square += edge[1] * edge[1]
    x_side, y_side = width * math.sqrt(x_square), width * math.sqrt(y_square)
    return max(x_side, LEAST_SIDE_MM), max(y_side, LEAST_SIDE_MM)


@kernel
def sheet_albedo(
    sheet: Sheet,
    index: int,
    surface: Surfaces,
    geometry: tuple[Array, Array, Array],
    widths: tuple[float, Array],
    albedo: Array,
) -> None:
    """Enter the sheet's albedo where `surface` is `index`; its back is white.

    `geometry` is points, directions and normals ``(n, 3)``, `widths` the angle of
    each ray and its length: their product is the footprint's width, mm.
    """
    points, directions, normals = geometry
    for i in range(len(surface)):
        if surface[i] != index:
            continue
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        normal = (normals[i, 0], normals[i, 1], normals[i, 2])
        albedo[i] = sheet.white
        if rotated(sheet.rotation, normal)[2] > 0:
            continue
        x, y, _ = rotated(sheet.rotation, (points[i, 0], points[i, 1], points[i, 2]))
        u, v = place_in_print(x + sheet.translation[0], y + sheet.translation[1], sheet)
        du, dv = footprint(d, normal, widths[0] * widths[1][i], sheet.rotation)
        ink = ink_within((u - du / 2, v - dv / 2), (u + du / 2, v + dv / 2), sheet)
        albedo[i] += (sheet.black - sheet.white) * ink / (du * dv)
