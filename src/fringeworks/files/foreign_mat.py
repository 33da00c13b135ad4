"""MATLAB's stereo calibrations: a struct of plain fields, as `toStruct` of stereoParams gives.

MATLAB counts pixels from one and writes vectors as rows: its intrinsic matrix and its rotation are
the transposed ones of OpenCV. ``K``, which later versions write, is not transposed.
"""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.files.mat5 import MatError, parse_mat
from fringeworks.files.system import told
from fringeworks.files.validation import clip
from fringeworks.model import Camera, Projector, Rig

Array = NDArray[np.float64]

MAX_BYTES = 4 * 2**20
"""A stereo calibration has some kB, with the points of its views a megabyte."""

FIRST_PIXEL = 1.0
"""Where MATLAB has the centre of the first pixel; here it is 0."""

DEVICES = {"camera": "CameraParameters1", "projector": "CameraParameters2"}
NAME = "stereoParams"


def read_mat(path: Path) -> dict[str, Any]:
    """Matrices in OpenCV's conventions, by `exchange.NAMES`; others as they are, by their names.

    Raises
    ------
    FormatError
        Not a .mat of version 5 to 7, too large, or a struct without a field that is needed.
    """
    values = _load(path)
    found = next((item for item in values.values() if _has(item, DEVICES["projector"])), None)
    if found is None:
        return {name: value for name, value in values.items() if not _is_struct(value)}
    out: dict[str, Any] = {}
    for device, field in DEVICES.items():
        out |= _device(_field(found, field, path), device, path)
    out["rotation"] = _numbers(found, "RotationOfCamera2", path).T
    out["translation"] = _numbers(found, "TranslationOfCamera2", path)
    return out


def write_mat(path: Path, rig: Rig) -> None:
    """Write `stereoParams`: what `read_mat` reads, in MATLAB's conventions."""
    from scipy.io import savemat

    pose = rig.projector_from_camera
    content = {
        DEVICES["camera"]: _describe(rig.camera),
        DEVICES["projector"]: _describe(rig.projector),
        "RotationOfCamera2": pose.rotation.T,
        "TranslationOfCamera2": pose.translation_mm[None],
    }
    savemat(path, {NAME: content}, do_compression=True)


def _load(path: Path) -> dict[str, Any]:
    with told(path, "read"):
        if not stat.S_ISREG(path.stat().st_mode) or path.stat().st_size > MAX_BYTES:
            raise FormatError(f"{path}: not a file of at most {MAX_BYTES} bytes")
        content = path.read_bytes()
    try:
        values = parse_mat(content)
    except MatError as error:
        raise FormatError(f"{path}: not a .mat file: {clip(error)}") from None
    return {name: value for name, value in values.items() if value is not None}


def _is_struct(value: Any) -> bool:
    return isinstance(value, dict)


def _has(value: Any, field: str) -> bool:
    return _is_struct(value) and field in value


def _field(table: Any, name: str, path: Path) -> Any:
    if not _has(table, name):
        listed = ", ".join(table if _is_struct(table) else ()) or "no fields"
        raise FormatError(f"{path}: {name} is missing, the struct has {clip(listed)}")
    return table[name]


def _numbers(table: Any, name: str, path: Path) -> Array:
    """A copy of a field, without sides of one."""
    value = _field(table, name, path)
    if not isinstance(value, np.ndarray):
        raise FormatError(f"{path}: {name} must hold numbers")
    return np.array(value, dtype=np.float64).squeeze()


def _device(table: Any, device: str, path: Path) -> dict[str, Array]:
    if _has(table, "K"):
        matrix = _numbers(table, "K", path)
    else:
        matrix = _numbers(table, "IntrinsicMatrix", path).T
    if matrix.shape != (3, 3):
        raise FormatError(f"{path}: the {device}'s intrinsic matrix must be 3x3")
    matrix[:2, 2] -= FIRST_PIXEL
    radial = np.ravel(_numbers(table, "RadialDistortion", path))
    tangential = np.ravel(_numbers(table, "TangentialDistortion", path))
    out = {
        f"{device}_matrix": matrix,
        f"{device}_distortion": np.concatenate([radial[:2], tangential, radial[2:]]),
    }
    if _has(table, "ImageSize"):
        out[f"{device}_size"] = np.ravel(_numbers(table, "ImageSize", path))[::-1]
    return out


def _describe(device: Camera | Projector) -> dict[str, Any]:
    lens = device.lens
    x, y = lens.cx + FIRST_PIXEL, lens.cy + FIRST_PIXEL
    return {
        "IntrinsicMatrix": np.array([[lens.fx, 0, 0], [0, lens.fy, 0], [x, y, 1]]),
        "RadialDistortion": np.array([[lens.k1, lens.k2, lens.k3]]),
        "TangentialDistortion": np.array([[lens.p1, lens.p2]]),
        "ImageSize": np.array([[device.height, device.width]], dtype=np.float64),
    }
