"""Rigs, poses and rays that the geometry tests share; nothing of the twin's kernels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Lens, Pose
from fringeworks.twin.optics import Optics

Array = NDArray[np.float64]

CAMERA = Optics(752, 480, Lens(1974.0, 1970.0, 376.0, 240.0, -0.1, 0.05, 2e-4, -3e-4, 0.01))


def pose(turn: tuple[float, float, float], place: tuple[float, float, float]) -> Pose:
    """A pose from a rotation vector, rad, by OpenCV, and a translation, mm."""
    return Pose(cv2.Rodrigues(np.array(turn, float))[0].astype(float), np.array(place, float))


PROJECTOR = Optics(
    608,
    684,
    Lens(1013.0, 2026.0, 300.0, 720.0, -0.05, 0.03, 1e-3, 0.0),
    device_from_camera=pose((0.02, 0.28, -0.01), (-180.0, 5.0, 20.0)),
)
PROJECTOR_MM = (
    -PROJECTOR.device_from_camera.rotation.T @ PROJECTOR.device_from_camera.translation_mm
)


def every_pixel(optics: Optics, step: float = 1.0) -> Array:
    """``(n, 2)`` pixels of the image, row by row."""
    rows, columns = np.mgrid[: optics.height : step, : optics.width : step]
    return np.stack([columns.ravel(), rows.ravel()], axis=-1).astype(np.float64)


def rays_by_opencv(optics: Optics, pixels: Array) -> Array:
    """``(n, 3)`` unit directions of a five-term camera's rays, undistorted by OpenCV."""
    lens = optics.lens
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    terms = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    eye = np.eye(3)
    ideal = np.asarray(cv2.undistortPointsIter(pixels[:, None], matrix, terms, eye, eye, stop))
    rays = np.column_stack([ideal.reshape(-1, 2), np.ones(len(ideal))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True), dtype=np.float64)
