"""The axis of a turntable, from one board that was scanned at several of its angles.

Every corner runs on a circle about the axis. Its direction is the one along which no corner moves
(least squares, closed form); in the plane square to it all circles have one centre, which Kasa's
equations (IEEE Trans. Instrum. Meas. 25, 1976) give for all corners together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Pose
from fringeworks.model.frame import Frame

Array = NDArray[np.float64]

LEAST_VIEWS = 3
LEAST_CORNERS = 4
FLATTEST = 1e-4
"""Second over first eigenvalue of how the corners move: below it the views hardly turn."""

UP = np.array([0.0, -1.0, -0.01])
"""Which end of the axis is called its top: upwards in the image, else towards the camera."""


@dataclass(frozen=True, slots=True, eq=False)
class TurntableAxis:
    """A turntable before its camera.

    Attributes
    ----------
    table
        A frame that is fixed to the table as it stood in the first view: z the axis, upwards, x
        towards the camera, the origin at the corners' mean height.
    angles_rad
        ``(v,)`` of each view, right-handed about z, the first 0, in (-pi, pi].
    rms_mm
        What is left of each corner's place, root mean square of the distances.
    corners
        Corners that were used: those that all views have.
    """

    table: Frame
    angles_rad: Array
    rms_mm: float
    corners: int


def find_axis(corners_mm: Array, *, name: str = "table") -> TurntableAxis:
    """The axis from a board's corners ``(views, n, 3)``, mm, camera frame; NaN where not seen.

    Raises
    ------
    ShapeError
        Another shape.
    MeasurementError
        Fewer than three views or four corners that all views have, or views that hardly turn.
    """
    if corners_mm.ndim != 3 or corners_mm.shape[2] != 3:
        raise ShapeError(f"corners_mm must be (views, n, 3), got {corners_mm.shape}")
    common = np.isfinite(corners_mm).all(axis=(0, 2))
    points = corners_mm[:, common]
    if len(points) < LEAST_VIEWS or points.shape[1] < LEAST_CORNERS:
        raise MeasurementError(
            f"a turntable's axis needs {LEAST_VIEWS} views with {LEAST_CORNERS} corners that all "
            f"of them have, got {len(points)} with {points.shape[1]}"
        )
    z = _direction(points)
    middle = points.mean(axis=(0, 1))
    x = -middle + (middle @ z) * z
    x /= np.linalg.norm(x)
    rough = np.stack([x, np.cross(z, x), z])
    flat = (points - middle) @ rough.T
    centre = middle + rough[:2].T @ _centre(flat[..., :2])
    table = _table(centre, z, name)
    turned = table.frame_from_camera.apply(points)
    angles = _angles(turned[..., :2])
    return TurntableAxis(table, angles, _rms_left(turned, angles), points.shape[1])


def turn_frame(table: Frame, angle_rad: float) -> Frame:
    """The table's frame after it has turned by an angle, right-handed about its z."""
    back = rotation_matrix(np.array([0.0, 0.0, -angle_rad]))
    pose = table.frame_from_camera
    return Frame(table.name, Pose(back @ pose.rotation, back @ pose.translation_mm))


def _direction(points: Array) -> Array:
    moves = (points - points.mean(axis=0)).reshape(-1, 3)
    spread, axes = np.linalg.eigh(moves.T @ moves)
    if not spread[1] > FLATTEST * spread[2]:
        raise MeasurementError(
            "the board hardly turns between the views: turn the table further, over a right "
            "angle in all"
        )
    axis = axes[:, 0]
    return np.asarray(axis if axis @ UP >= 0 else -axis)


def _centre(flat: Array) -> Array:
    """``(2,)`` common centre of the circles that points ``(views, n, 2)`` run on."""
    squares = np.sum(flat**2, axis=-1)
    design = 2 * (flat - flat.mean(axis=0)).reshape(-1, 2)
    return np.asarray(np.linalg.lstsq(design, (squares - squares.mean(axis=0)).ravel())[0])


def _table(centre: Array, z: Array, name: str) -> Frame:
    x = -centre + (centre @ z) * z
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    return Frame(name, Pose(rotation, -rotation @ centre))


def _angles(flat: Array) -> Array:
    first = flat[0]
    cross = first[:, 0] * flat[..., 1] - first[:, 1] * flat[..., 0]
    return np.asarray(np.arctan2(cross.sum(axis=1), np.sum(first * flat, axis=(1, 2))))


def _rms_left(turned: Array, angles: Array) -> float:
    """Turned back to the first view, how far each corner lies from its mean over the views."""
    back = np.stack([rotation_matrix(np.array([0.0, 0.0, -angle])) for angle in angles])
    points = np.einsum("vij,vnj->vni", back, turned)
    left = points - points.mean(axis=0)
    return float(np.sqrt(np.mean(np.sum(left**2, axis=-1))))
