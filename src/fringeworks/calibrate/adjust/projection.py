"""Where the devices see corners and sites of the board, with the derivatives.

A corner is a point of the board. A site is a camera pixel, known, at which the decoded maps say
where in the projector its light comes from: its ray is cut with the board's surface, and the point
is projected. Nothing about a corner's place enters a site.

Derivatives have the shared parameters and the view's own pose as columns, ``SHARED + 6``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.board_shape import BoardFrame, cut_rays
from fringeworks.calibrate.adjust.state import (
    CAMERA,
    POSE,
    PROJECTOR,
    RELATION,
    SHAPE,
    SHARED,
    RigState,
)
from fringeworks.geometry.lens import project_jacobian, unproject_jacobian
from fringeworks.geometry.pose import left_jacobian, move_jacobian, rotation_matrix

Array = NDArray[np.float64]


def project_corners(
    state: RigState, pose: Array, corners: tuple[Array, BoardFrame]
) -> tuple[Array, Array]:
    """``(n, 2)`` camera px of corners ``(n, 3)`` on the board, and ``(n, 2, SHARED + 6)``."""
    in_camera, by_pose, by_shape = _corners_in_camera(state, pose, corners)
    pixels, by_point, by_lens = project_jacobian(in_camera, state.camera)
    jacobian = np.zeros((len(pixels), 2, SHARED + POSE))
    jacobian[..., CAMERA] = by_lens
    jacobian[..., SHAPE] = by_point @ by_shape
    jacobian[..., SHARED:] = by_point @ by_pose
    return pixels, jacobian


def corners_in_projector(state: RigState, pose: Array, corners: tuple[Array, BoardFrame]) -> Array:
    """``(n, 2)`` projector px of corners ``(n, 3)`` on the board."""
    in_camera, _, _ = _corners_in_camera(state, pose, corners)
    in_projector, _ = move_jacobian(state.projector_from_camera, in_camera)
    return project_jacobian(in_projector, state.projector)[0]


def _corners_in_camera(
    state: RigState, pose: Array, corners: tuple[Array, BoardFrame]
) -> tuple[Array, Array, Array]:
    """``(n, 3)`` mm, by the pose ``(n, 3, 6)`` and by the board's shape ``(n, 3, 2)``."""
    board, frame = corners
    height, _, by_shape = frame.height(board, state.board_shape)
    raised = board + np.outer(height, [0.0, 0.0, 1.0])
    in_camera, by_pose = move_jacobian(pose, raised)
    normal = rotation_matrix(pose[:3])[:, 2]
    return in_camera, by_pose, normal[:, None] * by_shape[:, None, :]


def project_sites(
    state: RigState, pose: Array, sites: tuple[Array, BoardFrame]
) -> tuple[Array, Array]:
    """``(m, 2)`` projector px that camera pixels ``(m, 2)`` see, and ``(m, 2, SHARED + 6)``."""
    points, by_lens, by_shape, by_pose = _points_of(state, pose, sites)
    in_projector, by_relation = move_jacobian(state.projector_from_camera, points)
    pixels, by_point, by_projector = project_jacobian(in_projector, state.projector)
    by_place = by_point @ rotation_matrix(state.projector_from_camera[:3])
    jacobian = np.empty((len(pixels), 2, SHARED + POSE))
    jacobian[..., CAMERA] = by_place @ by_lens
    jacobian[..., PROJECTOR] = by_projector
    jacobian[..., RELATION] = by_point @ by_relation
    jacobian[..., SHAPE] = by_place @ by_shape
    jacobian[..., SHARED:] = by_place @ by_pose
    return pixels, jacobian


def _points_of(
    state: RigState, pose: Array, sites: tuple[Array, BoardFrame]
) -> tuple[Array, Array, Array, Array]:
    """``(m, 3)`` mm on the board, camera frame; by the camera's lens, the shape and the pose.

    With X = s d (d the ray, z = 1) on the surface G(X) = 0 of gradient n,
    ``dX = s dd - d (n . s dd + dG) / (n . d)``, dG at fixed X.
    """
    pixels, frame = sites
    ideal, ideal_by_lens = unproject_jacobian(pixels, state.camera)
    rays = np.column_stack([ideal, np.ones(len(ideal))])
    turn, shift = rotation_matrix(pose[:3]), pose[3:]
    surface = (frame, state.board_shape)
    depth, normals = cut_rays(rays, np.vstack([turn, shift]), surface)
    points = rays * depth[:, None]
    along = rays / np.einsum("ij,ij->i", normals, rays)[:, None]
    slide = np.eye(3) - along[:, :, None] * normals[:, None, :]
    by_lens = slide[:, :, :2] @ (depth[:, None, None] * ideal_by_lens)
    arm = points - shift
    by_rotation = -np.cross(arm, normals) @ left_jacobian(pose[:3])
    by_pose = -along[:, :, None] * np.concatenate([by_rotation, -normals], axis=1)[:, None, :]
    _, _, height_by_shape = frame.height(arm @ turn, state.board_shape)
    return points, by_lens, along[:, :, None] * height_by_shape[:, None, :], by_pose
