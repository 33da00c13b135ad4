"""The nearest point of a mesh, against a search of all triangles written another way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.kernels.closest import build_tree, find_nearest

Array = NDArray[np.float64]


def brute_force(points: Array, corners: Array) -> Array:
    """Distances by projection: inside the triangle the plane's, else the nearest edge's."""
    best = np.full(len(points), np.inf)
    for a, b, c in corners:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        height = (points - a) @ normal
        foot = points - height[:, None] * normal
        sides = [
            np.cross(end - start, foot - start) @ normal for start, end in ((a, b), (b, c), (c, a))
        ]
        inside = np.all(np.array(sides) >= 0, axis=0)
        edges = [on_edge(points, s, e) for s, e in ((a, b), (b, c), (c, a))]
        best = np.minimum(best, np.where(inside, np.abs(height), np.min(edges, axis=0)))
    return best


def on_edge(points: Array, start: Array, end: Array) -> Array:
    along = end - start
    share = np.clip((points - start) @ along / (along @ along), 0, 1)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * along, axis=1))


@pytest.mark.parametrize("count", [1, 7, 8, 9, 100, 257])
def test_it_is_the_nearest_of_all(count: int) -> None:
    rng = np.random.default_rng(count)
    corners = rng.normal(0, 10, (count, 1, 3)) + rng.normal(0, 2, (count, 3, 3))
    levels = max(0, int(np.ceil(np.log2(count / 8))))
    points = rng.normal(0, 12, (300, 3))
    found, triangles, _ = find_nearest(points, corners, build_tree(corners, levels), np.inf)
    distance = np.linalg.norm(found - points, axis=1)
    np.testing.assert_allclose(distance, brute_force(points, corners), atol=1e-11)
    for n in range(0, 300, 29):  # and the point does lie on the triangle that is named
        own = brute_force(found[n : n + 1], corners[triangles[n]][None])
        assert own[0] < 1e-11


def test_nothing_within_reach() -> None:
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    points = np.array([[0.2, 0.2, 0.9], [0.2, 0.2, 1.1]])
    found, triangles, _ = find_nearest(points, corners, build_tree(corners, 0), 1.0)
    assert triangles.tolist() == [0, -1]
    np.testing.assert_allclose(found[0], [0.2, 0.2, 0])
    assert np.isnan(found[1]).all()
