"""The board's surface in its own frame: a plane, or a paraboloid of two parameters.

``z = bow_x (u^2 - 1) + bow_y (v^2 - 1)`` with u and v from -1 to 1 over the corners, along the
board's x and y: bow_x is how far, mm, the middle of the board stands out towards -z, which is
where the camera is, from its edges left and right. Both zero is a plane. Twist and folds are
beyond it. Boards bend so under their weight and when they are clamped; mrcal has the same two.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEWTON_STEPS = 4
"""From the plane's cut; each squares an error that starts at bow / distance, some 1e-4."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardFrame:
    """Where u = v = 0 and how far it is to 1, along x and y: ``(2,)`` each, mm."""

    middle: Array
    half: Array

    @classmethod
    def of(cls, boards_mm: Iterable[Array]) -> BoardFrame:
        """Around all corners ``(n, 3)`` of all views."""
        corners = np.concatenate([board[:, :2] for board in boards_mm])
        low, high = corners.min(axis=0), corners.max(axis=0)
        return cls((low + high) / 2, (high - low) / 2)

    def height(self, points: Array, shape: Array) -> tuple[Array, Array, Array]:
        """``(n,)`` z of the surface, mm, over points ``(n, 2+)``, and its derivatives.

        These are ``(n, 2)`` by x and y, and ``(n, 2)`` by the shape.
        """
        scaled = (points[:, :2] - self.middle) / self.half
        by_shape = scaled**2 - 1
        return by_shape @ shape, 2 * shape * scaled / self.half, by_shape


def cut_rays(rays: Array, pose: Array, surface: tuple[BoardFrame, Array]) -> tuple[Array, Array]:
    """Depths ``(n,)``, mm, at which rays meet the board, and the normals ``(n, 3)`` there.

    Rays ``(n, 3)`` have z = 1, in the camera's frame; `pose` is the board's rotation and
    translation as ``(4, 3)``: rows of R, then t. Normals are in the camera's frame, not of unit
    length: the gradient of z - surface.
    """
    frame, shape = surface
    turn, shift = pose[:3], pose[3]
    depth = (turn[:, 2] @ shift) / (rays @ turn[:, 2])
    normals = np.broadcast_to(turn[:, 2], rays.shape)
    if not shape.any():
        return depth, normals
    for _ in range(NEWTON_STEPS):
        on_board = (rays * depth[:, None] - shift) @ turn
        height, slope, _ = frame.height(on_board, shape)
        normals = np.column_stack([-slope, np.ones(len(rays))]) @ turn.T
        depth = depth - (on_board[:, 2] - height) / np.einsum("ij,ij->i", normals, rays)
    return depth, normals
