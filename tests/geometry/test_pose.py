"""Rigid motions against hand-written ones, OpenCV's Rodrigues, and finite differences."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.geometry.pose import (
    compose_poses,
    invert_pose,
    left_jacobian,
    rotate_jacobian,
    rotation_matrix,
    rotation_vector,
    skew,
)

Array = NDArray[np.float64]

vectors = st.tuples(*[st.floats(-1.8, 1.8)] * 3).map(np.array)
"""Rotation vectors shorter than pi (1.8 sqrt 3 = 3.12)."""

moves = st.tuples(*[st.floats(-1000, 1000)] * 3).map(np.array)


def test_quarter_turn_by_hand() -> None:
    turn = rotation_matrix(np.array([0.0, 0.0, np.pi / 2]))
    np.testing.assert_allclose(turn, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(rotation_vector(turn), [0, 0, np.pi / 2], atol=1e-15)


@given(vectors)
def test_equals_opencv(vector: Array) -> None:
    theirs, _ = cv2.Rodrigues(vector)
    # OpenCV takes angles below 2e-16 for none.
    np.testing.assert_allclose(rotation_matrix(vector), theirs, atol=1e-14)


@given(vectors)
def test_vector_of_matrix(vector: Array) -> None:
    # Near pi the vector follows from the matrix with an error of ulps / (pi - angle), here 50.
    np.testing.assert_allclose(rotation_vector(rotation_matrix(vector)), vector, atol=1e-13)


@given(vectors, moves, moves)
def test_inverse(vector: Array, translation: Array, point: Array) -> None:
    pose = (rotation_matrix(vector), translation)
    back = invert_pose(*pose)
    there = pose[0] @ point + pose[1]
    np.testing.assert_allclose(back[0] @ there + back[1], point, atol=1e-11)


@given(vectors, moves, vectors, moves, moves)
def test_composition(v1: Array, t1: Array, v2: Array, t2: Array, point: Array) -> None:
    outer, inner = (rotation_matrix(v1), t1), (rotation_matrix(v2), t2)
    both = compose_poses(outer, inner)
    stepwise = outer[0] @ (inner[0] @ point + inner[1]) + outer[1]
    np.testing.assert_allclose(both[0] @ point + both[1], stepwise, atol=1e-11)


def test_skew_by_hand() -> None:
    expected = [[0, -3, 2], [3, 0, -1], [-2, 1, 0]]
    assert skew(np.array([1.0, 2.0, 3.0])).tolist() == expected
    assert skew(np.ones((4, 5, 3))).shape == (4, 5, 3, 3)


@given(moves, moves)
def test_skew_is_the_cross_product(a: Array, b: Array) -> None:
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-9)


def numerical_left_jacobian(vector: Array, step: float = 1e-6) -> Array:
    """Columns: the small rotation that leads from ``exp(w - dw)`` to ``exp(w + dw)``."""
    columns = []
    for move in step * np.eye(3):
        ahead, behind = rotation_matrix(vector + move), rotation_matrix(vector - move)
        columns.append(rotation_vector(ahead @ behind.T) / (2 * step))
    return np.stack(columns, axis=1)


@given(vectors)
def test_left_jacobian(vector: Array) -> None:
    # Rounding of a rotation, 2e-16, over the step.
    np.testing.assert_allclose(left_jacobian(vector), numerical_left_jacobian(vector), atol=2e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.99e-4, 1.01e-4, 1e-3])
def test_left_jacobian_of_small_angles(angle: float) -> None:
    # By its series 1 + W / 2 + W^2 / 6 + W^3 / 24; the next term is angle^4 / 120 < 1e-14. The
    # closed form loses ulps / angle of its first factor, 1e-12 at 1e-4.
    vector = angle * np.array([2.0, -1.0, 2.0]) / 3
    W = skew(vector)
    series = np.eye(3) + W / 2 + W @ W / 6 + W @ W @ W / 24
    np.testing.assert_allclose(left_jacobian(vector), series, rtol=0, atol=3e-12)


def test_left_jacobian_is_continuous() -> None:
    # Both sides of the switch of formulas: 2e-8 apart by the slope 1/2 of their distance 2e-8.
    below, above = (left_jacobian(np.array([a, 0, 0])) for a in (1e-4 - 1e-8, 1e-4 + 1e-8))
    assert np.abs(above - below).max() < 1.1e-8


@given(vectors, st.integers(1, 5))
def test_rotate_jacobian(vector: Array, count: int) -> None:
    assume(np.linalg.norm(vector) > 0)
    points = np.random.default_rng(count).uniform(-300, 300, (count, 3))
    rotated, slope = rotate_jacobian(vector, points)
    np.testing.assert_allclose(rotated, points @ rotation_matrix(vector).T, atol=1e-12)
    step = 1e-5  # third derivatives below 600 mm: 600 step^2 / 6; rounding 1e-13 / step
    for axis, move in enumerate(step * np.eye(3)):
        ahead, behind = (points @ rotation_matrix(vector + s * move).T for s in (1, -1))
        np.testing.assert_allclose(slope[:, :, axis], (ahead - behind) / (2 * step), atol=5e-8)
