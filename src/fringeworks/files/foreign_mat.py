"""MATLAB's stereo calibrations: a struct of plain fields, as `toStruct` of stereoParams gives.

MATLAB counts pixels from one and writes vectors as rows: its intrinsic matrix and its rotation are
the transposed ones of OpenCV. ``K``, which later versions write, is not transposed.
"""

from __future__ import annotations

import stat
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.model import Camera, Projector, Rig

Array = NDArray[np.float64]

MAX_BYTES = 4 * 2**20
"""A stereo calibration has some kB, with the points of its views a megabyte."""

HEADER_BYTES = 128
PACKED = 15
"""The kind of a part that zlib packed."""

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
        return values
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
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        if not stat.S_ISREG(path.stat().st_mode) or path.stat().st_size > MAX_BYTES:
            raise FormatError(f"{path}: not a file of at most {MAX_BYTES} bytes")
        _refuse_unpacked(path)
        values = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise FormatError(f"{path}: version 7.3 is not read: save it again with -v7") from None
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (MatReadError, ValueError, TypeError, KeyError, IndexError, zlib.error) as error:
        raise FormatError(f"{path}: not a .mat file: {error}") from None
    return {
        name: value
        for name, value in values.items()
        if not name.startswith("__")
        and (np.asarray(value).dtype.kind in "fiu" or _is_struct(value))
    }


def _refuse_unpacked(path: Path) -> None:
    """Packed parts have a checksum; a damaged one without can bring the reader down for good."""
    data = path.read_bytes()
    order = "<" if data[HEADER_BYTES - 2 : HEADER_BYTES] == b"IM" else ">"
    place = HEADER_BYTES
    while place + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, place)
        if kind != PACKED:
            raise FormatError(
                f"{path}: not a .mat file whose parts are packed: save it again with -v7 "
                "(scipy: do_compression=True)"
            )
        place += 8 + size


def _is_struct(value: Any) -> bool:
    return hasattr(value, "_fieldnames")


def _has(value: Any, field: str) -> bool:
    return _is_struct(value) and hasattr(value, field)


def _field(table: Any, name: str, path: Path) -> Any:
    if not _has(table, name):
        listed = ", ".join(getattr(table, "_fieldnames", [])) or "no fields"
        raise FormatError(f"{path}: {name} is missing, the struct has {listed}")
    return getattr(table, name)


def _numbers(table: Any, name: str, path: Path) -> Array:
    """A copy of a field, whatever its shape."""
    try:
        return np.array(_field(table, name, path), dtype=np.float64)
    except (TypeError, ValueError):
        raise FormatError(f"{path}: {name} must hold numbers") from None


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
