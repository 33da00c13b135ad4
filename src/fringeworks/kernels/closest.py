"""The nearest point of a mesh: a tree of boxes over its triangles, searched for many points.

The point of a triangle nearest to another: Ericson, Real-Time Collision Detection (2005), 5.1.5,
which also tells the feature that it lies on. The tree halves the triangles at the median of their
middles along the longest side, level by level, so that it needs no pointers: node j of level l
holds the triangles ``j n >> l`` to ``(j + 1) n >> l``.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import inlined, kernel

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]
Vector: TypeAlias = tuple[float, float, float]

LEAF = 8
"""Triangles that a leaf holds at most."""

FACE, EDGE_AB, EDGE_BC, EDGE_CA, CORNER_A, CORNER_B, CORNER_C = range(7)
"""What of a triangle the nearest point lies on."""


@kernel
def split_at_median(order: Indices, keys: Array, span: tuple[int, int], middle: int) -> None:
    """Partly sort a span of `order` so that `middle` and all before it have the smaller keys."""
    low, high = span[0], span[1] - 1
    while low < high:
        pivot = keys[order[(low + high) // 2]]
        i, j = low, high
        while i <= j:
            while keys[order[i]] < pivot:
                i += 1
            while keys[order[j]] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@kernel
def build_tree(corners: Array, levels: int) -> tuple[Indices, Array]:
    """Order of the triangles ``(m,)``, and the boxes ``(2^(levels + 1) - 1, 2, 3)`` of all nodes.

    `corners` are ``(m, 3, 3)``.
    """
    count = len(corners)
    order = np.arange(count)
    keys = np.empty(count)
    boxes = np.empty((2 ** (levels + 1) - 1, 2, 3))
    for level in range(levels + 1):
        for j in range(2**level):
            start, end = (j * count) >> level, ((j + 1) * count) >> level
            box = boxes[2**level - 1 + j]
            box[0], box[1] = math.inf, -math.inf
            for place in range(start, end):
                for corner in range(3):
                    for axis in range(3):
                        value = corners[order[place], corner, axis]
                        box[0, axis] = min(box[0, axis], value)
                        box[1, axis] = max(box[1, axis], value)
            if level == levels:
                continue
            longest = np.argmax(box[1] - box[0])
            for place in range(start, end):
                triangle = order[place]
                keys[triangle] = (
                    corners[triangle, 0, longest]
                    + corners[triangle, 1, longest]
                    + corners[triangle, 2, longest]
                )
            split_at_median(order, keys, (start, end), ((2 * j + 1) * count) >> (level + 1))
    return order, boxes


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def along(a: Vector, b: Vector, share: float) -> Vector:
    """``a + share b``."""
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


@kernel
def nearest_on_triangle(p: Vector, triangle: Array) -> tuple[Vector, int]:
    """Point of a triangle ``(3, 3)`` that is nearest to p, and the feature it lies on."""
    a = (triangle[0, 0], triangle[0, 1], triangle[0, 2])
    b = (triangle[1, 0], triangle[1, 1], triangle[1, 2])
    c = (triangle[2, 0], triangle[2, 1], triangle[2, 2])
    ab, ac, ap = along(b, a, -1.0), along(c, a, -1.0), along(p, a, -1.0)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0 and d2 <= 0:
        return a, CORNER_A
    bp = along(p, b, -1.0)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0 and d4 <= d3:
        return b, CORNER_B
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        return along(a, ab, d1 / (d1 - d3)), EDGE_AB
    cp = along(p, c, -1.0)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0 and d5 <= d6:
        return c, CORNER_C
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        return along(a, ac, d2 / (d2 - d6)), EDGE_CA
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        return along(b, along(c, b, -1.0), (d4 - d3) / ((d4 - d3) + (d5 - d6))), EDGE_BC
    whole = va + vb + vc
    return along(along(a, ab, vb / whole), ac, vc / whole), FACE


@kernel
def box_distance(p: Vector, box: Array) -> float:
    """Square of the distance from p to a box ``(2, 3)``; 0 inside."""
    total = 0.0
    for axis in range(3):
        off = max(box[0, axis] - p[axis], 0.0, p[axis] - box[1, axis])
        total += off * off
    return total


@kernel
def find_nearest(
    points: Array, corners: Array, tree: tuple[Indices, Array], within: float
) -> tuple[Array, Indices, NDArray[np.int8]]:
    """For points ``(n, 3)`` the nearest point of a mesh, its triangle, and the feature of that.

    Where no triangle is nearer than `within` the triangle is -1 and the point NaN.
    """
    order, boxes = tree
    count, nodes = len(corners), len(boxes)
    first_leaf = nodes // 2
    levels = round(math.log2(first_leaf + 1))
    found = np.full(points.shape, math.nan)
    triangles = np.full(len(points), -1)
    features = np.zeros(len(points), np.int8)
    waiting = np.empty(levels + 2, np.int64)
    for n in range(len(points)):
        p = (points[n, 0], points[n, 1], points[n, 2])
        best = within * within
        waiting[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            node = waiting[depth]
            if not box_distance(p, boxes[node]) < best:
                continue
            if node < first_leaf:
                left, right = 2 * node + 1, 2 * node + 2
                if box_distance(p, boxes[left]) < box_distance(p, boxes[right]):
                    left, right = right, left
                waiting[depth], waiting[depth + 1] = left, right  # the nearer one is next
                depth += 2
                continue
            j = node - first_leaf
            for place in range((j * count) >> levels, ((j + 1) * count) >> levels):
                point, feature = nearest_on_triangle(p, corners[order[place]])
                off = along(p, point, -1.0)
                if dot(off, off) < best:
                    best = dot(off, off)
                    triangles[n], features[n] = order[place], feature
                    for axis in range(3):
                        found[n, axis] = point[axis]
    return found, triangles, features
