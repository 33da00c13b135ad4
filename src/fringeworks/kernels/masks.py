"""Which points lie on an edge, where a pixel sees both of its sides, or are seen or lit too flat.

Between neighbouring pixels a surface can rise only so much before it is seen at grazing incidence:
a link steeper than that joins two surfaces, and the pixels at its ends see both (or a run of such
links is one surface, seen too flat). At an edge with nothing lit behind it there is no link: there
the light falls off towards the void. The normal of the surface ``z(u, v)`` seen by a pinhole is
``(-fx p, -fy q, 1 + p (u - cx) + q (v - cy))`` with p, q the derivatives of ln z, and its product
with the pixel's ray is one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Floats = NDArray[np.float32]
Row = NDArray[np.float32]
Marks = NDArray[np.uint8]
Pinhole = tuple[np.float32, np.float32, np.float32, np.float32]
Place = tuple[np.float32, np.float32, np.float32]

STEEP, FADES, BESIDE = np.uint8(1), np.uint8(2), np.uint8(4)
"""Marks: the end of a steep link, a pixel that fades towards a void, one beside what is outside."""

VALID, OUTSIDE, MIXED, GRAZING = np.uint8(0), np.uint8(3), np.uint8(4), np.uint8(5)
"""Those of `model.cloud.Reason`; a kernel cannot take them from an enumeration."""

REACH = 2
"""Pixels to either side from which a normal is taken where none of them is marked."""


@kernel
def rises(
    depths: tuple[np.float32, np.float32],
    sigmas: tuple[np.float32, np.float32],
    rule: tuple[np.float32, np.float32],
) -> bool:
    """Whether a link is steeper than a surface can be: by ``rule[0] z`` and so many sigma.

    The sigmas are added as they are, so that the noise is overrated a little. NaN never is.
    """
    rise = abs(depths[0] - depths[1])
    return bool(rise > rule[0] * depths[0] + rule[1] * (sigmas[0] + sigmas[1]))


@kernel
def facing(p: np.float32, q: np.float32, ray: Place, point: tuple[Pinhole, Place]) -> bool:
    """Whether a surface faces both devices more than ``limit``, the cosine of the incidence.

    `p`, `q` are derivatives of ln z by the pixel, `ray` is (x, y, z) with the depth third, `point`
    the camera's (fx, fy, limit squared, 0) and the projector's centre, mm.
    """
    lens, centre = point
    x, y, z = ray
    a, b = -lens[0] * p, -lens[1] * q
    c = np.float32(1) - x * a - y * b
    normal = a * a + b * b + c * c
    across = x * x + y * y + np.float32(1)
    dx, dy, dz = x * z - centre[0], y * z - centre[1], z - centre[2]
    lit = a * dx + b * dy + c * dz
    limit = lens[2] * normal
    return bool(
        (limit * across < np.float32(1))
        & (lit > np.float32(0))
        & (lit * lit > limit * (dx * dx + dy * dy + dz * dz))
    )


@kernel
def _find_steep(
    depths: tuple[Row, Row],
    sigmas: tuple[Row, Row],
    rule: tuple[np.float32, np.float32],
    steep: Marks,
) -> None:
    """Which links between two rows of the same length are steep."""
    here, there = depths
    noise, other = sigmas
    for j in range(here.size):
        ends, spread = (here[j], there[j]), (noise[j], other[j])
        steep[j] = STEEP if rises(ends, spread, rule) else VALID


@kernel
def _add(marks: Marks, more: Marks) -> None:
    for j in range(marks.size):
        marks[j] |= more[j]


@kernel
def _mark_links(
    depths: tuple[Row, Row],
    sigmas: tuple[Row, Row],
    rule: tuple[np.float32, np.float32],
    marks: tuple[Marks, Marks, Marks],
) -> None:
    """Mark both ends of the steep links between two rows; the third of `marks` is scratch."""
    steep = marks[2][: depths[0].size]
    _find_steep(depths, sigmas, rule, steep)
    _add(marks[0], steep)
    _add(marks[1], steep)


@kernel
def _mark_fading(
    beyond: tuple[Row, Row], light: tuple[Row, Row, Row], share: np.float32, marks: Marks
) -> None:
    """Mark pixels between two others, one of them void, to which the light falls off.

    `beyond` are the depths on both sides, `light` the brightness there, with its own in between.
    """
    before, after = beyond
    left, own, right = light
    for j in range(own.size):
        falls = (before[j] != before[j]) & (own[j] < share * right[j])
        climbs = (after[j] != after[j]) & (own[j] < share * left[j])
        marks[j] |= FADES if falls | climbs else VALID


@kernel
def mark_edges(
    depth: Floats,
    sigma: Floats,
    light: Floats,
    rules: tuple[np.float32, np.float32, np.float32, np.float32],
    marks: Marks,
) -> None:
    """Mark the ends of steep links, and pixels that fade towards a void.

    Parameters
    ----------
    depth, sigma
        ``(H, W)`` mm; NaN where void.
    light
        ``(H, W)`` brightness, of void pixels too.
    rules
        Steepest rise along a row and along a column, share of the depth; how many sigma more;
        the share of the brightness of the pixel behind it below which a pixel fades.
    marks
        ``(H, W)``, overwritten.
    """
    height, width = depth.shape
    row, column = (rules[0], rules[2]), (rules[1], rules[2])
    corner = (np.float32(math.hypot(rules[0], rules[1])), rules[2])
    scratch = np.empty(width, np.uint8)
    marks[:] = VALID
    for i in range(height):
        z, s, m, lit = depth[i], sigma[i], marks[i], light[i]
        _mark_links((z[1:], z[:-1]), (s[1:], s[:-1]), row, (m[1:], m[:-1], scratch))
        _mark_fading((z[:-2], z[2:]), (lit[:-2], lit[1:-1], lit[2:]), rules[3], m[1:-1])
        if i == 0:
            continue
        y, t, n = depth[i - 1], sigma[i - 1], marks[i - 1]
        _mark_links((z, y), (s, t), column, (m, n, scratch))
        _mark_links((z[1:], y[:-1]), (s[1:], t[:-1]), corner, (m[1:], n[:-1], scratch))
        _mark_links((z[:-1], y[1:]), (s[:-1], t[1:]), corner, (m[:-1], n[1:], scratch))
        if i < height - 1:
            x, up, down = depth[i + 1], light[i - 1], light[i + 1]
            _mark_fading((y, x), (up, lit, down), rules[3], m)
            one = lit[1:-1]
            _mark_fading((y[:-2], x[2:]), (up[:-2], one, down[2:]), rules[3], m[1:-1])
            _mark_fading((y[2:], x[:-2]), (up[2:], one, down[:-2]), rules[3], m[1:-1])


@kernel
def mark_beside(reason: Marks, marks: Marks) -> None:
    """Mark the neighbours of pixels whose points lie outside the volume: what lies there is lit."""
    height, width = reason.shape
    for i in range(height):
        for j in range(width):
            if reason[i, j] == OUTSIDE:
                for k in range(max(i - 1, 0), min(i + 2, height)):
                    for m in range(max(j - 1, 0), min(j + 2, width)):
                        marks[k, m] |= BESIDE


@kernel
def _runs_on(line: Row, noise: Row, rule: tuple[np.float32, np.float32], j: int) -> bool:
    """Whether all four links of a line about `j` are steep, and all rise or all fall."""
    if j < REACH or j + REACH >= line.size:
        return False
    up = line[j] > line[j - 1]
    for k in range(j - REACH, j + REACH):
        ends, spread = (line[k + 1], line[k]), (noise[k + 1], noise[k])
        if not rises(ends, spread, rule) or (line[k + 1] > line[k]) != up:
            return False
    return True


@kernel
def judge_marks(
    depth: Floats,
    sigma: Floats,
    marks: Marks,
    rules: tuple[np.float32, np.float32, np.float32, np.float32],
    reason: Marks,
) -> None:
    """Turn marks of valid pixels into reasons.

    An edge is spread over three links at most. Where more of them are steep in one direction it
    is a surface, seen too flat. All arrays ``(H, W)`` as in `mark_edges`.
    """
    height, width = depth.shape
    row, column = (rules[0], rules[2]), (rules[1], rules[2])
    for i in range(height):
        for j in range(width):
            if marks[i, j] == VALID or reason[i, j] != VALID:
                continue
            reason[i, j] = MIXED
            if marks[i, j] == STEEP:
                along = _runs_on(depth[i], sigma[i], row, j)
                if along or _runs_on(depth[:, j], sigma[:, j], column, i):
                    reason[i, j] = GRAZING


@kernel
def _slopes(lines: tuple[Row, Row, Row, Row], out: Row) -> None:
    """Derivatives from the lines two and one before and one and two after; NaN at voids.

    From the outer two, which halve the noise, where the inner two are there as well.
    """
    before, left, right, after = lines
    for j in range(out.size):
        near = (right[j] - left[j]) * np.float32(0.5)
        far = (after[j] - before[j]) * np.float32(0.25)
        out[j] = far if (far == far) & (near == near) else near


@kernel
def judge_slopes(
    depth: Floats,
    lens: tuple[np.float32, np.float32, np.float32, np.float32],
    view: tuple[Pinhole, Place],
    reason: Marks,
) -> None:
    """Find the valid points that are seen or lit at grazing incidence.

    Parameters
    ----------
    depth
        ``(H, W)`` mm, NaN where not valid: nothing is differenced across an edge.
    lens
        The camera's fx, fy, cx, cy.
    view
        As `facing` takes it.
    reason
        ``(H, W)``, changed where a point does not face both devices.
    """
    height, width = depth.shape
    nothing = np.full(width, np.float32(math.nan), np.float32)
    padded = np.full(width + 2 * REACH, np.float32(math.nan), np.float32)
    p, q = np.empty(width, np.float32), np.empty(width, np.float32)
    for i in range(height):
        padded[REACH : width + REACH] = depth[i]
        _slopes((padded[:-4], padded[1:-3], padded[3:-1], padded[4:]), p)
        before = depth[i - 2] if i > 1 else nothing
        left = depth[i - 1] if i > 0 else nothing
        right = depth[i + 1] if i < height - 1 else nothing
        after = depth[i + 2] if i < height - 2 else nothing
        _slopes((before, left, right, after), q)
        _judge_row(depth[i], (p, q), (np.float32(i), lens, view), reason[i])


@kernel
def _judge_row(
    depth: Row,
    slopes: tuple[Row, Row],
    how: tuple[
        np.float32, tuple[np.float32, np.float32, np.float32, np.float32], tuple[Pinhole, Place]
    ],
    reason: Marks,
) -> None:
    down, lens, view = how
    p, q = slopes
    y, per_x = (down - lens[3]) / lens[1], np.float32(1) / lens[0]
    for j in range(depth.size):
        z, inverse = depth[j], np.float32(1) / depth[j]
        ray = ((np.float32(j) - lens[2]) * per_x, y, z)
        known = (p[j] == p[j]) & (q[j] == q[j]) & (z == z)
        flat = known & (not facing(p[j] * inverse, q[j] * inverse, ray, view))
        reason[j] = GRAZING if flat else reason[j]
