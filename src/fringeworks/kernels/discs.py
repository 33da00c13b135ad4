"""Area of discs within upright rectangles, exact: what a ray sees of a print of circles."""

from __future__ import annotations

import math

from fringeworks.kernels.compiled import kernel


@kernel
def beyond(t: float) -> float:
    """Area of the unit disc where x > t."""
    t = min(max(t, -1.0), 1.0)
    return math.acos(t) - t * math.sqrt(1 - t * t)


@kernel
def quadrant(x: float, y: float) -> float:
    """Area of the unit disc above and left of (x, y).

    With the corner inside, the integral of the disc's height up to x, cut at y; outside, the disc
    less what one or both lines cut off.
    """
    if x * x + y * y < 1:
        halves = x * math.sqrt(1 - x * x) + math.asin(x) + y * math.sqrt(1 - y * y) + math.asin(y)
        return x * y + halves / 2 + math.pi / 4
    if x <= 0 and y <= 0:
        return 0.0
    if x > 0 and y > 0:
        return math.pi - beyond(x) - beyond(y)
    return beyond(-x) if x <= 0 else beyond(-y)


@kernel
def disc_area(low: tuple[float, float], high: tuple[float, float], radius: float) -> float:
    """Area of the disc about the origin in the rectangle from `low` to `high`, mm^2."""
    x0, y0, x1, y1 = low[0] / radius, low[1] / radius, high[0] / radius, high[1] / radius
    share = quadrant(x1, y1) - quadrant(x0, y1) - quadrant(x1, y0) + quadrant(x0, y0)
    return share * radius * radius


@kernel
def discs_area(
    low: tuple[float, float],
    high: tuple[float, float],
    grid: tuple[float, float, int, int],
) -> float:
    """Area of all discs of a grid in the rectangle, mm^2.

    Parameters
    ----------
    grid
        Radius and pitch, mm, columns and rows; the first disc is about the origin.
    """
    radius, pitch, columns, rows = grid
    first_column = max(math.floor((low[0] - radius) / pitch), 0)
    last_column = min(math.ceil((high[0] + radius) / pitch), columns - 1)
    first_row = max(math.floor((low[1] - radius) / pitch), 0)
    last_row = min(math.ceil((high[1] + radius) / pitch), rows - 1)
    area = 0.0
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            x, y = column * pitch, row * pitch
            area += disc_area((low[0] - x, low[1] - y), (high[0] - x, high[1] - y), radius)
    return area
