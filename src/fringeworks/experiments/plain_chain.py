"""Calibration as every open peer does it, to hold ours against: OpenCV's functions one by one.

`cv2.cornerSubPix` finds the corners, the decoded maps are read at them, `cv2.calibrateCamera` is
run on camera and projector alone, `cv2.stereoCalibrate` with both lenses fixed relates the two.
Nothing is left out but corners whose neighbours are not decoded. Two things are done better than in
most peers, so that the comparison is with the method and not with a slip: the maps are read
between pixels, and the projector has a start, with which its principal point may leave the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate import View
from fringeworks.calibrate.boards.corners import to_8_bit
from fringeworks.errors import CalibrationError
from fringeworks.model import Camera, Capture, Lens, Pose, Projector, ProjectorMap, Quality, Rig

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

WINDOW = (5, 5)
"""Half the size, px, of the window of `cv2.cornerSubPix`; a square is three times as large."""

STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)


@dataclass(frozen=True, slots=True, eq=False)
class PlainView:
    """Corners whose place is decoded: ``(n, 3)`` mm on the board, ``(n, 2)`` px in each device."""

    board_mm: Floats
    camera_px: Floats
    projector_px: Floats
    offered: int


def observe_plainly(capture: Capture, projector_map: ProjectorMap, view: View) -> PlainView:
    """The corners of `view`, which tells them apart, found and read the plain way.

    Raises
    ------
    CalibrationError
        The capture has no white frame.
    """
    white = capture.white()
    if white is None:
        raise CalibrationError(f"{capture.name}: no white frame to look for corners in")
    start = np.rint(2 * view.camera_px) / 2  # what ours found between pixels is not handed over
    corners = start.astype(np.float32).reshape(-1, 1, 2)
    cv2.cornerSubPix(to_8_bit(white), corners, WINDOW, (-1, -1), STOP)  # in place
    found = corners.reshape(-1, 2)
    x, y = (np.ascontiguousarray(part) for part in found.T)
    read = [
        cv2.remap(axis.coordinate, x, y, cv2.INTER_LINEAR).ravel() for axis in projector_map.axes
    ]
    projector = np.stack(read, axis=1).astype(np.float32)
    known = np.flatnonzero(np.isfinite(projector).all(axis=1))
    board = view.board_mm.astype(np.float32)
    return PlainView(board[known], found[known], projector[known], offered=len(found))


def calibrate_plainly(views: Sequence[PlainView], like: Rig) -> Rig:
    """The rig that OpenCV makes of the views; its quality counts as `calibrate_rig` does.

    Parameters
    ----------
    like
        Its image sizes are taken over, and the shape of its projector's pixels, which a start
        needs and a data sheet tells.
    """
    board = [view.board_mm for view in views]
    seen = [view.camera_px for view in views]
    shown = [view.projector_px for view in views]
    size = (like.camera.width, like.camera.height)
    screen = (like.projector.width, like.projector.height)
    camera_rms, camera, bent = _lens_of(board, seen, size)
    start = _start(like.projector)
    projector_rms, projector, twisted = _lens_of(board, shown, screen, start)
    joint_rms, *_, rotation, shift, _, _ = cv2.stereoCalibrate(
        board, seen, shown, camera, bent, projector, twisted, size, flags=cv2.CALIB_FIX_INTRINSIC
    )
    return Rig(
        camera=Camera(*size, _lens(camera, bent)),
        projector=Projector(*screen, _lens(projector, twisted)),
        projector_from_camera=Pose(
            np.asarray(rotation, np.float64), np.asarray(shift, np.float64).ravel()
        ),
        quality=Quality(
            camera_rms_px=camera_rms,
            projector_rms_px=projector_rms,
            joint_rms_px=joint_rms,
            views_used=len(views),
            observations_used=sum(len(points) for points in board),
            observations_offered=sum(view.offered for view in views),
        ),
    )


def _lens_of(
    board: Sequence[Floats],
    seen: Sequence[Floats],
    size: tuple[int, int],
    start: Array | None = None,
) -> tuple[float, Array, Array]:
    """Root mean squared distance, px, camera matrix and five terms, k3 held at zero."""
    flags = cv2.CALIB_FIX_K3 | (0 if start is None else cv2.CALIB_USE_INTRINSIC_GUESS)
    guess = np.eye(3) if start is None else start
    rms, matrix, terms, *_ = cv2.calibrateCamera(board, seen, size, guess, np.zeros(5), flags=flags)
    return rms, np.asarray(matrix, np.float64), np.asarray(terms, np.float64)


def _start(projector: Projector) -> Array:
    """A camera matrix with the principal point inside the image: OpenCV refuses one outside."""
    focal = 1.5 * projector.width
    middle = (projector.width - 1) / 2, 0.9 * projector.height
    aspect = projector.lens.fy / projector.lens.fx
    return np.array([[focal, 0, middle[0]], [0, aspect * focal, middle[1]], [0, 0, 1.0]])


def _lens(matrix: Array, distortion: Array) -> Lens:
    pinhole = (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    return Lens(*map(float, pinhole), *map(float, distortion.ravel()[:5]))
