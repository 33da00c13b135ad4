"""Least squares of a blurred checkerboard corner, one corner after the other.

About the corner c, d = x - c, the image is ``(1 + g.d) (a + b E1 E2)``: light with a slope g on two
crossing edges, ``E = erf(n.d / (sqrt2 s))`` with n the edge's normal. A pixel's own width is inside
s where s is wide; where it is not, the pixel's mean is taken over three by three Gauss points.
Levenberg and Marquardt's steps on (cx, cy, angle 1, angle 2, s, a, b, gx, gy).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Array: TypeAlias = NDArray[np.float64]
Normals: TypeAlias = tuple[float, float, float, float]

TERMS = 9
COLUMNS = 6
"""Of a result: x, y, variance of x, variance of y, blur s, outcome."""

FITTED, VOID, FLAT, ASTRAY = 0.0, 1.0, 2.0, 3.0
"""Outcomes: done; too few pixels; no contrast; no minimum near the start."""

START_BLUR_PX = 1.0
SMALLEST_BLUR_PX = 0.15
SHARP_PX = 0.55
"""Below this s an edge looks different by where it lies in its pixel: up to 0.01 px of bias."""

FAR = 6.0
"""An edge this many s away is 1 or -1 to 2e-9."""

MOST_STEPS = 40
SMALLEST_STEP_PX = 1e-4
LEAST_SHARE = 0.6
"""Of the window's pixels that must be there."""

LEAST_CONTRAST = 2.0
"""Of b over the scatter of the residuals; the corner would be known to a pixel at best."""

LARGEST_MOVE = 0.2
"""Squares, from the start."""

BLUR_WEIGHT = 1e-3
"""Keeps s in place where the image says nothing about it: edges along the pixels, without blur."""

GAUSS_PX = np.array([-0.5 * math.sqrt(0.6), 0.0, 0.5 * math.sqrt(0.6)])
GAUSS_SHARE = np.array([5 / 18, 8 / 18, 5 / 18])


@kernel
def edge(u: float, s: float) -> tuple[float, float]:
    """``erf(u / (sqrt2 s))`` and its derivative by u."""
    if abs(u) > FAR * s:
        return (1.0 if u > 0 else -1.0), 0.0
    slope = math.sqrt(2 / math.pi) / s * math.exp(-u * u / (2 * s * s))
    return math.erf(u / (math.sqrt(2.0) * s)), slope


@kernel
def add_point(p: Array, normals: Normals, x: float, y: float, share: float, row: Array) -> None:
    """Add a point's derivatives and its model to `row`, times `share`; (x, y) from the corner."""
    n1x, n1y, n2x, n2y = normals
    u1, u2 = n1x * x + n1y * y, n2x * x + n2y * y
    e1, slope1 = edge(u1, p[4])
    e2, slope2 = edge(u2, p[4])
    light, ink = share * (1 + p[7] * x + p[8] * y), p[5] + p[6] * e1 * e2
    d1, d2 = light * p[6] * slope1 * e2, light * p[6] * slope2 * e1
    row[0] -= share * p[7] * ink + d1 * n1x + d2 * n2x
    row[1] -= share * p[8] * ink + d1 * n1y + d2 * n2y
    row[2] += d1 * (n1x * y - n1y * x)
    row[3] += d2 * (n2x * y - n2y * x)
    row[4] -= (d1 * u1 + d2 * u2) / p[4]
    row[5] += light
    row[6] += light * e1 * e2
    row[7] += share * x * ink
    row[8] += share * y * ink
    row[9] += light * ink


@kernel
def fill_rows(p: Array, pixels: Array, fine: bool, rows: Array) -> None:
    """Derivatives of each pixel's model and, last, what it leaves of the grey level."""
    normals = (math.cos(p[2]), math.sin(p[2]), math.cos(p[3]), math.sin(p[3]))
    rows[:] = 0.0
    for k in range(len(pixels)):
        x, y = pixels[k, 0] - p[0], pixels[k, 1] - p[1]
        u1, u2 = normals[0] * x + normals[1] * y, normals[2] * x + normals[3] * y
        if fine and min(abs(u1), abs(u2)) < FAR * p[4] + 1:
            for i in range(3):
                for j in range(3):
                    share = GAUSS_SHARE[i] * GAUSS_SHARE[j]
                    add_point(p, normals, x + GAUSS_PX[j], y + GAUSS_PX[i], share, rows[k])
        else:
            add_point(p, normals, x, y, 1.0, rows[k])
        rows[k, TERMS] = pixels[k, 2] - rows[k, TERMS]


@kernel
def gather(image: Array, corner: Array, reach: float, arm: float, pixels: Array) -> int:
    """Fill ``(m, 4)``: x, y from the corner and grey level of the window's pixels, and a sign.

    The window is the parallelogram of `reach` local squares to either side, of that what is
    within `arm` squares of an edge; the sign tells the quadrants. 0 where too few are there.
    """
    height, width = image.shape
    cx, cy, ax, ay, bx, by = corner
    area = ax * by - ay * bx
    half_x, half_y = reach * (abs(ax) + abs(bx)), reach * (abs(ay) + abs(by))
    wanted, found = 0, 0
    for row in range(math.ceil(cy - half_y), math.floor(cy + half_y) + 1):
        for column in range(math.ceil(cx - half_x), math.floor(cx + half_x) + 1):
            x, y = column - cx, row - cy
            along, down = (x * by - y * bx) / area, (ax * y - ay * x) / area
            near, far = min(abs(along), abs(down)), max(abs(along), abs(down))
            if far > reach or near > arm:
                continue
            wanted += 1
            if not (0 <= row < height and 0 <= column < width) or found == len(pixels):
                continue
            if not math.isnan(image[row, column]):
                pixels[found] = (x, y, image[row, column], 1.0 if along * down > 0 else -1.0)
                found += 1
    return found if found >= max(LEAST_SHARE * wanted, 3 * TERMS) else 0


@kernel
def begin(corner: Array, pixels: Array, p: Array) -> bool:
    """Parameters from the window's frame and its quadrants' means; False without contrast."""
    _, _, ax, ay, bx, by = corner
    side = 1.0 if ax * by > ay * bx else -1.0
    count, same, other = 0, 0.0, 0.0
    for k in range(len(pixels)):
        if pixels[k, 3] > 0:
            count += 1
            same += pixels[k, 2]
        else:
            other += pixels[k, 2]
    if count == 0 or count == len(pixels):
        return False
    same, other = same / count, other / (len(pixels) - count)
    p[:] = 0.0
    p[2], p[3] = math.atan2(-side * bx, side * by), math.atan2(side * ax, -side * ay)
    p[4], p[5], p[6] = START_BLUR_PX, (same + other) / 2, (same - other) / 2
    return bool(abs(p[6]) > 1e-6 * abs(p[5]))


@kernel
def normal_equations(p: Array, pixels: Array, fine: bool, rows: Array) -> Array:
    """``(10, 10)``: J'J, bordered by J'r and r'r."""
    fill_rows(p, pixels, fine, rows)
    matrix = rows.T @ rows
    matrix[4, 4] += BLUR_WEIGHT * p[6] * p[6]
    return matrix


@kernel
def solve_positive(matrix: Array, right: Array, out: Array) -> bool:
    """Solve a symmetric system by Cholesky; False where it is not positive definite."""
    n = len(right)
    factor = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j] - np.dot(factor[i, :j], factor[j, :j])
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total > 1e-14 * matrix[i, i]:
                factor[i, i] = math.sqrt(total)
            else:
                return False
    for i in range(n):
        out[i] = (right[i] - np.dot(factor[i, :i], out[:i])) / factor[i, i]
    for i in range(n - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, n):
            total -= factor[k, i] * out[k]
        out[i] = total / factor[i, i]
    return True


@kernel
def descend(p: Array, pixels: Array, fine: bool, rows: Array) -> bool:
    """Move `p` to the minimum, `rows` those of it; False where there is none near."""
    matrix, damping = normal_equations(p, pixels, fine, rows), 1e-3
    step = np.empty(TERMS)
    for _ in range(MOST_STEPS):
        damped = matrix[:TERMS, :TERMS] * (1 + damping * np.eye(TERMS))
        if not solve_positive(damped, matrix[:TERMS, TERMS], step):
            return False
        trial = p + step
        trial[4] = max(min(max(trial[4], p[4] / 2), p[4] * 2), SMALLEST_BLUR_PX)
        new = normal_equations(trial, pixels, fine, rows)
        if new[TERMS, TERMS] <= matrix[TERMS, TERMS]:
            p[:], matrix = trial, new
            damping *= 0.1
        else:
            damping *= 10
        if abs(step[0]) + abs(step[1]) < SMALLEST_STEP_PX:
            fill_rows(p, pixels, fine, rows)
            return True
    return False


@kernel
def variances(p: Array, rows: Array) -> tuple[float, float]:
    """Of x and y, from each pixel's own residual (White 1980): noise need not be even."""
    matrix = rows.T @ rows
    matrix[4, 4] += BLUR_WEIGHT * p[6] * p[6]
    inverse, unit = np.empty((2, TERMS)), np.eye(TERMS)
    for axis in range(2):
        if not solve_positive(matrix[:TERMS, :TERMS], unit[axis], inverse[axis]):
            return math.nan, math.nan
    x, y = 0.0, 0.0
    for k in range(len(rows)):
        pull_x, pull_y = 0.0, 0.0
        for i in range(TERMS):
            pull_x += inverse[0, i] * rows[k, i]
            pull_y += inverse[1, i] * rows[k, i]
        x += (pull_x * rows[k, TERMS]) ** 2
        y += (pull_y * rows[k, TERMS]) ** 2
    spare = len(rows) / (len(rows) - TERMS)
    return x * spare, y * spare


@kernel
def fit_one(corner: Array, pixels: Array, rows: Array, result: Array) -> float:
    """Fill one result from its window's pixels; the outcome."""
    p = np.empty(TERMS)
    if len(pixels) == 0:
        return VOID
    if not begin(corner, pixels, p):
        return FLAT
    found = descend(p, pixels, False, rows)
    if found and p[4] < SHARP_PX:
        p[4] = math.sqrt(max(p[4] ** 2 - 1 / 12, SMALLEST_BLUR_PX**2))
        found = descend(p, pixels, True, rows)
    if not found:
        return ASTRAY
    if abs(p[6]) < LEAST_CONTRAST * math.sqrt(np.mean(rows[:, TERMS] ** 2)):
        return FLAT
    side = min(math.hypot(corner[2], corner[3]), math.hypot(corner[4], corner[5]))
    if math.hypot(p[0], p[1]) > LARGEST_MOVE * side:
        return ASTRAY
    result[2], result[3] = variances(p, rows)
    if math.isnan(result[2]):
        return ASTRAY
    result[0], result[1], result[4] = corner[0] + p[0], corner[1] + p[1], p[4]
    return FITTED


@kernel
def fit_saddles(image: Array, corners: Array, windows: Array, results: Array) -> None:
    """Fit all corners of an image ``(H, W)``, NaN where void.

    `corners` ``(n, 6)`` are x, y and the steps to the next corner along the board's x and its y,
    px; `windows` ``(n, 2)`` `reach` and `arm` in such steps; `results` ``(n, COLUMNS)``, whose
    first five are NaN where nothing was fitted.
    """
    room = 16
    for i in range(len(corners)):
        half_x = windows[i, 0] * (abs(corners[i, 2]) + abs(corners[i, 4]))
        half_y = windows[i, 0] * (abs(corners[i, 3]) + abs(corners[i, 5]))
        room = max(room, int(2 * half_x + 2) * int(2 * half_y + 2))
    pixels, rows = np.empty((room, 4)), np.empty((room, TERMS + 1))
    for i in range(len(corners)):
        results[i] = math.nan
        count = gather(image, corners[i], windows[i, 0], windows[i, 1], pixels)
        results[i, 5] = fit_one(corners[i], pixels[:count], rows[:count], results[i])
