"""Rigid motions: rotation vectors, composition, inverse, and the derivative of a rotation.

A pose ``a_from_b`` is (R, t) with ``X_a = R X_b + t``; adjacent names cancel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rotation_matrix(vector: Array) -> Array:
    """``(3, 3)`` rotation of a rotation vector, rad."""
    from scipy.spatial.transform import Rotation  # takes longer to import than all the rest

    return Rotation.from_rotvec(vector).as_matrix()


def rotation_vector(matrix: Array) -> Array:
    """``(3,)`` rotation vector, rad, of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrix).as_rotvec()


def invert_pose(rotation: Array, translation: Array) -> tuple[Array, Array]:
    """``b_from_a`` of ``a_from_b``."""
    return rotation.T, -rotation.T @ translation


def compose_poses(outer: tuple[Array, Array], inner: tuple[Array, Array]) -> tuple[Array, Array]:
    """``a_from_c`` of ``a_from_b`` (outer) and ``b_from_c`` (inner)."""
    return outer[0] @ inner[0], outer[0] @ inner[1] + outer[1]


def skew(vectors: Array) -> Array:
    """``(..., 3, 3)`` cross-product matrices of ``(..., 3)`` vectors: ``skew(a) @ b = a x b``."""
    out = np.zeros((*vectors.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -vectors[..., 2], vectors[..., 1]
    out[..., 1, 0], out[..., 1, 2] = vectors[..., 2], -vectors[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -vectors[..., 1], vectors[..., 0]
    return out


def left_jacobian(vector: Array) -> Array:
    """``(3, 3)`` J with ``exp(w + dw) = exp(J dw) exp(w)``: the rotation vector's derivative."""
    angle = float(np.linalg.norm(vector))
    cross = skew(vector)
    if angle < 1e-4:
        return np.asarray(np.eye(3) + cross / 2 + cross @ cross / 6)
    first = (1 - np.cos(angle)) / angle**2
    second = (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def rotate_jacobian(vector: Array, points: Array) -> tuple[Array, Array]:
    """``exp(w) X`` of points ``(n, 3)`` and its derivative ``(n, 3, 3)`` by the rotation vector."""
    rotated = points @ rotation_matrix(vector).T
    return rotated, -skew(rotated) @ left_jacobian(vector)


def move_jacobian(pose: Array, points: Array) -> tuple[Array, Array]:
    """Points ``(n, 3)`` moved by a pose ``(6,)``, and the derivative ``(n, 3, 6)`` by it.

    A pose as a vector is its rotation vector, rad, and its translation, mm.
    """
    rotated, by_rotation = rotate_jacobian(pose[:3], points)
    by_translation = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return rotated + pose[3:], np.concatenate([by_rotation, by_translation], axis=2)
