"""Starting values: the camera by Zhang's method, the projector by direct linear transformation.

A projector's principal point often lies outside its image, where `cv2.calibrateCamera` refuses to
start and needs hundreds of steps to arrive. Once the camera is known, the corners are points in
space with projector pixels: twelve linear equations give the projector's matrix, wherever its
principal point is.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import rq

from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.observe import View, refuse_mirrored
from fringeworks.calibrate.settings import ImageSize
from fringeworks.errors import CalibrationError
from fringeworks.geometry.lens import project
from fringeworks.geometry.pose import rotation_matrix, rotation_vector

Array = NDArray[np.float64]

LARGEST_RMS_PX = 5.0
POSSIBLE_MM = (10.0, 50_000.0)
"""Distances of a board; with its pitch in m or in micrometres it comes out beyond them."""

USUAL_MM = (100.0, 20_000.0)
"""Those that need no question."""

UNITS_MM = {"m": 1000.0, "inches": 25.4, "cm": 10.0, "um": 1e-3}

LEAST_TILT_DEG = 10.0
"""Largest angle between two boards' normals below which focal length and distance are one."""

PROJECTOR_CAUSES = (
    "candidates: Gray bits out of order in capture.toml, a wrong projector width or height there, "
    "a projector image that is scaled (not its native resolution) or keystoned, or a board or rig "
    "that moved during a capture"
)


def start_state(views: Sequence[View], camera_size: ImageSize) -> RigState:
    """Start for `bundle.refine`, without tangential distortion.

    Raises
    ------
    CalibrationError
        A view is mirrored, the camera's corners fix no lens or do not fit a board, the board is
        impossibly near or far or has nearly the same orientation in all views, or no projector
        explains its coordinates.
    """
    for view in views:
        refuse_mirrored(view)
    camera, boards = _camera_start(views, camera_size)
    _refuse_camera(camera, boards, views)
    _refuse_distance(boards)
    tilt = largest_tilt_deg(boards)
    if tilt < LEAST_TILT_DEG:
        raise CalibrationError(
            f"the board has nearly the same orientation in all {len(views)} views (at most "
            f"{tilt:.1f} degrees between two, {LEAST_TILT_DEG:g} are needed): focal length and "
            "distance cannot be told apart; add views tilted by 20 to 40 degrees about both axes"
        )
    points = np.concatenate(
        [view.kept_in_camera(pose) for view, pose in zip(views, boards, strict=True)]
    )
    pixels = np.concatenate([view.projector_px[view.kept] for view in views])
    projector, relation = _resect(points, pixels)
    return RigState(camera, projector, relation, boards)


def _refuse_camera(camera: Array, boards: Array, views: Sequence[View]) -> None:
    """Raise where the camera alone does not fit the board, naming the worst view."""
    rms = []
    for view, pose in zip(views, boards, strict=True):
        error = view.camera_px[view.kept] - project(view.kept_in_camera(pose), camera)
        rms.append(float(np.sqrt(np.mean(np.sum(error**2, axis=1)))))
    worst = int(np.argmax(np.nan_to_num(rms, nan=np.inf)))
    if not rms[worst] <= LARGEST_RMS_PX:
        raise CalibrationError(
            f"the camera's corners do not fit a board, worst in {views[worst].name} "
            f"({rms[worst]:.1f} px rms): are the board's counts and pitches right, is it flat, "
            "and is every capture from the same camera at the same focus?"
        )


def _refuse_distance(boards: Array) -> None:
    """Raise where the board stands where none can."""
    distance = float(np.median(boards[:, 5]))
    if POSSIBLE_MM[0] <= distance <= POSSIBLE_MM[1]:
        return
    raise CalibrationError(
        f"the board comes out {distance:.3g} mm from the camera: the pitch in board.toml must be "
        f"in mm{other_units(distance)}"
    )


def other_units(distance_mm: float) -> str:
    """By which units of the pitch a board's distance would be a usual one."""
    usual = [
        f" (were it in {unit}, {distance_mm * size:.0f} mm)"
        for unit, size in UNITS_MM.items()
        if USUAL_MM[0] <= distance_mm * size <= USUAL_MM[1]
    ]
    return "".join(usual)


def largest_tilt_deg(camera_from_board: Array) -> float:
    """Largest angle, degrees, between the normals of any two of ``(views, 6)`` board poses."""
    normals = np.array([rotation_matrix(pose[:3])[:, 2] for pose in camera_from_board])
    cosine = np.clip(normals @ normals.T, -1, 1)
    return float(np.degrees(np.arccos(cosine.min())))


def _camera_start(views: Sequence[View], size: ImageSize) -> tuple[Array, Array]:
    """Lens ``(9,)`` and board poses ``(views, 6)``."""
    board = [view.board_mm[view.kept].astype(np.float32) for view in views]
    pixels = [view.camera_px[view.kept].astype(np.float32) for view in views]
    try:
        _, matrix, distortion, rotations, translations = cv2.calibrateCamera(
            board,
            pixels,
            (size.width, size.height),
            np.eye(3),
            np.zeros(5),
            flags=cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3,
        )
    except cv2.error as error:
        names = ", ".join(view.name for view in views if _is_thin(view)) or "some view"
        raise CalibrationError(
            f"the camera's corners fix no lens ({error.err}); those kept in {names} are fewer than "
            "four, or lie on one line or in one point: leave these captures out"
        ) from error
    principal = (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    lens = np.array([*principal, *np.ravel(distortion)[:5]], dtype=np.float64)
    poses = [
        np.concatenate([np.ravel(turn), np.ravel(shift)])
        for turn, shift in zip(rotations, translations, strict=True)
    ]
    return lens, np.array(poses, dtype=np.float64)


def _is_thin(view: View) -> bool:
    """Whether the kept corners, on the board or in the camera's image, span no plane."""
    parts = (view.board_mm[view.kept, :2], view.camera_px[view.kept])
    return len(parts[0]) < 4 or any(np.linalg.matrix_rank(np.cov(part.T)) < 2 for part in parts)


def _resect(points: Array, pixels: Array) -> tuple[Array, Array]:
    """Projector lens ``(9,)`` and projector_from_camera ``(6,)`` of points ``(n, 3)``."""
    if not np.ptp(pixels, axis=0).all():
        raise CalibrationError(f"all projector coordinates are the same; {PROJECTOR_CAUSES}")
    to_unit, scaled = _normalise(pixels)
    from_unit, body = _normalise(points)
    homogeneous = np.column_stack([body, np.ones(len(body))])
    zero = np.zeros_like(homogeneous)
    across = np.hstack([homogeneous, zero, -scaled[:, :1] * homogeneous])
    down = np.hstack([zero, homogeneous, -scaled[:, 1:] * homogeneous])
    _, _, right = np.linalg.svd(np.concatenate([across, down]), full_matrices=False)
    matrix = np.linalg.inv(to_unit) @ right[-1].reshape(3, 4) @ from_unit
    return _decompose(matrix, points)


def _normalise(values: Array) -> tuple[Array, Array]:
    """Similarity that brings points to mean zero and spread one, and the points so moved."""
    centre = values.mean(axis=0)
    spread = float(np.sqrt(np.mean((values - centre) ** 2)))
    size = values.shape[1]
    matrix = np.eye(size + 1)
    matrix[:size, :size] /= spread
    matrix[:size, size] = -centre / spread
    return matrix, (values - centre) / spread


def _decompose(matrix: Array, points: Array) -> tuple[Array, Array]:
    """Lens and pose of a projection matrix ``(3, 4)`` that sees the points in front of it."""
    depth = np.column_stack([points, np.ones(len(points))]) @ matrix[2]
    if np.median(depth) < 0:
        matrix = -matrix
    upper, rotation = rq(matrix[:, :3])
    signs = np.diag(np.sign(np.diag(upper)))
    upper, rotation = upper @ signs, signs @ rotation
    upper_scaled = upper / upper[2, 2]
    if np.linalg.det(rotation) < 0 or not np.isfinite(upper_scaled).all():
        raise CalibrationError(f"no projector explains the decoded coordinates; {PROJECTOR_CAUSES}")
    translation = np.linalg.solve(upper, matrix[:, 3])
    lens = np.zeros(9)
    lens[:4] = upper_scaled[0, 0], upper_scaled[1, 1], upper_scaled[0, 2], upper_scaled[1, 2]
    return lens, np.concatenate(
        [rotation_vector(np.asarray(rotation, dtype=np.float64)), translation]
    )
