"""Clouds as archives of arrays: everything that is known of every pixel, as it is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.files.cloud_points import float32
from fringeworks.files.npz import Arrays, read_npz, write_npz
from fringeworks.files.poses import pose_matrix, pose_of_matrix
from fringeworks.model import Cloud, Pose, Reason
from fringeworks.model.cloud import ReasonMap
from fringeworks.model.frame import UNKNOWN_FRAME


def write_npz_cloud(path: Path, cloud: Cloud) -> None:
    """Every array of a cloud under its name; what is None is left out."""
    arrays: Arrays = {
        "xyz": cloud.xyz.astype(np.float32, copy=False),
        "sigma_mm": cloud.sigma_mm,
        "intensity": cloud.intensity,
        "epipolar_px": cloud.epipolar_px,
        "frame": np.array(cloud.frame),
    }
    if cloud.colour is not None:
        arrays["colour"] = cloud.colour
    if cloud.scale_sigma is not None:
        arrays["scale_sigma"] = np.array(cloud.scale_sigma)
    if cloud.systematic_mm is not None:
        arrays["systematic_mm"] = cloud.systematic_mm
    if cloud.reason is not None:
        arrays["reason"] = cloud.reason
    if cloud.frame_from_camera is not None:
        arrays["frame_from_camera"] = pose_matrix(cloud.frame_from_camera)
    write_npz(path, arrays)


_ARRAYS = (
    "xyz",
    "sigma_mm",
    "intensity",
    "epipolar_px",
    "frame",
    "colour",
    "scale_sigma",
    "systematic_mm",
    "reason",
    "frame_from_camera",
)


def read_npz_cloud(path: Path) -> Cloud:
    """The cloud, ``(H, W)``; arrays that are not there are NaN or None."""
    arrays = read_npz(path, _ARRAYS)
    if "xyz" not in arrays:
        raise FormatError(f"{path}: holds no xyz; is it a cloud?")
    shape = arrays["xyz"].shape
    if len(shape) != 3 or shape[2] != 3 or 0 in shape:
        raise FormatError(f"{path}: xyz must be (H, W, 3), got {shape}")
    return Cloud(
        xyz=_numbers(path, arrays, "xyz", shape=shape),
        sigma_mm=_numbers(path, arrays, "sigma_mm", shape=shape[:2]),
        intensity=_numbers(path, arrays, "intensity", shape=shape[:2]),
        epipolar_px=_numbers(path, arrays, "epipolar_px", shape=shape[:2]),
        colour=_colour(path, arrays, shape),
        frame=_frame(arrays.get("frame")),
        scale_sigma=_scale_sigma(path, arrays),
        systematic_mm=_numbers(path, arrays, "systematic_mm", shape=shape[:2])
        if "systematic_mm" in arrays
        else None,
        reason=_reason(path, arrays, shape),
        frame_from_camera=_pose(path, arrays),
    )


def _frame(name: NDArray[Any] | None) -> str:
    """A name that can be printed, or nobody's."""
    told = name is not None and name.dtype.kind == "U" and name.ndim == 0
    return str(name) if told and str(name).isprintable() else UNKNOWN_FRAME


def _pose(path: Path, arrays: Arrays) -> Pose | None:
    matrix = arrays.get("frame_from_camera")
    if matrix is None:
        return None
    if matrix.shape != (4, 4) or matrix.dtype.kind not in "fiu":
        raise FormatError(
            f"{path}: frame_from_camera must be numbers of shape (4, 4), "
            f"got {matrix.dtype} of {matrix.shape}"
        )
    return pose_of_matrix(matrix.astype(np.float64), name=f"{path}: frame_from_camera")


def _reason(path: Path, arrays: Arrays, shape: tuple[int, ...]) -> ReasonMap | None:
    reason = arrays.get("reason")
    if reason is not None and (
        reason.shape != shape[:2] or reason.dtype != np.uint8 or reason.max() >= len(Reason)
    ):
        raise FormatError(
            f"{path}: reason must be uint8 below {len(Reason)} of shape {shape[:2]}, "
            f"got {reason.dtype} of {reason.shape}"
        )
    return reason


def _scale_sigma(path: Path, arrays: Arrays) -> float | None:
    array = arrays.get("scale_sigma")
    if array is None:
        return None
    if array.ndim != 0 or array.dtype.kind not in "fiu" or not 0 <= array < math.inf:
        raise FormatError(f"{path}: scale_sigma must be one number, 0 or more, got {array}")
    return float(array)


def _numbers(
    path: Path, arrays: Arrays, name: str, *, shape: tuple[int, ...]
) -> NDArray[np.float32]:
    """An array of this shape as float32; NaN where the file has none of that name."""
    array = arrays.get(name)
    if array is None:
        return np.full(shape, np.nan, dtype=np.float32)
    if array.shape != shape or array.dtype.kind not in "fiu":
        raise FormatError(
            f"{path}: {name} must be numbers of shape {shape}, got {array.dtype} of {array.shape}"
        )
    return float32(array)


def _colour(path: Path, arrays: Arrays, shape: tuple[int, ...]) -> NDArray[Any] | None:
    colour = arrays.get("colour")
    if colour is not None and (colour.shape != shape or colour.dtype not in (np.uint8, np.uint16)):
        raise FormatError(
            f"{path}: colour must be uint8 or uint16 of shape {shape}, "
            f"got {colour.dtype} of {colour.shape}"
        )
    return colour
