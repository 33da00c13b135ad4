"""Poses in files: as a matrix of four by four, checked to be rigid, and as a quaternion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.model import Pose

FURTHEST_MM = 1e9
"""Largest shift: beyond it single precision has lost the thing."""

RIGID_TOLERANCE = 1e-6
"""Largest deviation of any element of R R^T from the unit matrix."""


def pose_matrix(pose: Pose) -> NDArray[np.float64]:
    """``(4, 4)``: rotation and translation over a row of 0 0 0 1."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.translation_mm
    return matrix


def pose_of_matrix(matrix: NDArray[np.float64], *, name: str) -> Pose:
    """The pose of a ``(4, 4)`` matrix.

    Raises
    ------
    FormatError
        It is not a rigid motion; `name` says in the message where it stands.
    """
    rotation = matrix[:3, :3]
    sane = bool((np.abs(matrix) <= FURTHEST_MM).all())  # and so finite
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max()) if sane else np.inf
    rigid = off <= RIGID_TOLERANCE and np.linalg.det(rotation) > 0
    if not (rigid and (matrix[3] == [0, 0, 0, 1]).all()):
        raise FormatError(
            f"{name} must be a rotation and a translation, at most {FURTHEST_MM:g} mm, over 0 0 0 1"
        )
    return Pose(rotation, matrix[:3, 3])


def quaternion(pose: Pose) -> tuple[float, float, float, float]:
    """w, x, y, z of the pose's rotation, w not negative."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = (float(part) for part in Rotation.from_matrix(pose.rotation).as_quat(True))
    return w, x, y, z
