"""Read and write clouds, the format by suffix: ``.npz``, ``.ply``, ``.xyz``."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.atomic import replacing
from fringeworks.files.npz import Arrays, read_npz, write_npz
from fringeworks.files.ply import VERTEX, read_ply, write_ply
from fringeworks.files.system import check_file
from fringeworks.geometry.grid import grid_normals
from fringeworks.model.cloud import Cloud, Reason, ReasonMap

PLANNED_SUFFIXES = (".pcd", ".e57", ".stl", ".glb", ".obj")
UNKNOWN_FRAME = "unknown"

WHITE_PERCENTILE = 99.5
"""Of deep grey levels, what becomes 255 in 8 bit: one glint does not darken the rest."""

Handler = TypeVar("Handler")

_FRAME = "frame "
_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601


def write_cloud(path: str | Path, cloud: Cloud) -> None:
    """Write a cloud, atomic; the suffix of `path` chooses the format.

    ``.npz`` keeps everything, organised. ``.ply`` (binary little endian) has the valid points
    with normals (0 0 0 where the grid gives none), 8 bit colour and sigma, and names its frame
    in a comment; deeper levels are scaled so that their 99.5 percentile is 255. ``.xyz`` is text,
    x y z in mm, one point a line.

    Raises
    ------
    UsageError
        Another suffix.
    FormatError
        The file cannot be written.
    """
    path = Path(path)
    _choose(path, _WRITERS)(path, cloud)


def read_cloud(path: str | Path) -> Cloud:
    """Read a cloud in mm: ``(H, W)`` from ``.npz``, ``(1, n)`` from ``.ply`` and ``.xyz``.

    What the file does not tell (sigma, intensity) is NaN, its frame ``unknown``.

    Raises
    ------
    UsageError
        A suffix that is not read.
    FormatError
        The file is missing, damaged, not of its suffix's format, or holds no points.
    """
    path = Path(path)
    reader = _choose(path, _READERS)
    check_file(path)
    return reader(path)


def _choose(path: Path, handlers: dict[str, Handler]) -> Handler:
    suffix = path.suffix.lower()
    if suffix in handlers:
        return handlers[suffix]
    planned = "is planned" if suffix in PLANNED_SUFFIXES else "is not known"
    raise UsageError(f"cloud format '{suffix}' {planned}; use one of {', '.join(handlers)}")


def _write_npz(path: Path, cloud: Cloud) -> None:
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
)


def _read_npz(path: Path) -> Cloud:
    arrays = read_npz(path, _ARRAYS)
    if "xyz" not in arrays:
        raise FormatError(f"{path}: holds no xyz; is it a cloud?")
    shape = arrays["xyz"].shape
    if len(shape) != 3 or shape[2] != 3 or 0 in shape:
        raise FormatError(f"{path}: xyz must be (H, W, 3), got {shape}")
    frame = arrays.get("frame", np.array(UNKNOWN_FRAME))
    return Cloud(
        xyz=_numbers(path, arrays, "xyz", shape=shape),
        sigma_mm=_numbers(path, arrays, "sigma_mm", shape=shape[:2]),
        intensity=_numbers(path, arrays, "intensity", shape=shape[:2]),
        epipolar_px=_numbers(path, arrays, "epipolar_px", shape=shape[:2]),
        colour=_colour(path, arrays, shape),
        frame=str(frame) if frame.dtype.kind == "U" and frame.ndim == 0 else UNKNOWN_FRAME,
        scale_sigma=_scale_sigma(path, arrays),
        systematic_mm=_numbers(path, arrays, "systematic_mm", shape=shape[:2])
        if "systematic_mm" in arrays
        else None,
        reason=_reason(path, arrays, shape),
    )


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
    return _float32(array)


def _float32(array: NDArray[Any]) -> NDArray[np.float32]:
    with np.errstate(over="ignore", invalid="ignore"):
        return array.astype(np.float32)


def _colour(path: Path, arrays: Arrays, shape: tuple[int, ...]) -> NDArray[Any] | None:
    colour = arrays.get("colour")
    if colour is not None and (colour.shape != shape or colour.dtype not in (np.uint8, np.uint16)):
        raise FormatError(
            f"{path}: colour must be uint8 or uint16 of shape {shape}, "
            f"got {colour.dtype} of {colour.shape}"
        )
    return colour


def _write_ply(path: Path, cloud: Cloud) -> None:
    valid = cloud.valid
    vertices = np.zeros(int(valid.sum()), dtype=VERTEX)
    normals = np.nan_to_num(grid_normals(cloud.xyz)[valid])
    colours = _eight_bit(cloud)
    for column, letter in enumerate("xyz"):
        vertices[letter] = cloud.xyz[valid][:, column]
        vertices["n" + letter] = normals[:, column]
    for column, name in enumerate(("red", "green", "blue")):
        vertices[name] = colours[:, column]
    vertices["sigma"] = cloud.sigma_mm[valid]
    units = "units mm; sigma: random part, one standard deviation along z"
    frame = " ".join(cloud.frame.split())
    write_ply(path, vertices, comments=(_FRAME + frame, units))


def _eight_bit(cloud: Cloud) -> NDArray[np.uint8]:
    """RGB ``(n, 3)`` of the valid points: the colour, else the grey of the intensity.

    Levels scale by 255 over their `WHITE_PERCENTILE` where that lies above 255; 8 bit stays as it
    is. So colours follow the levels steadily, whatever the sensor's depth.
    """
    if cloud.colour is not None:
        levels = cloud.colour[cloud.valid].astype(np.float32)
    else:
        levels = np.repeat(np.nan_to_num(cloud.intensity[cloud.valid])[:, None], 3, axis=-1)
    white = max(255.0, float(np.percentile(levels, WHITE_PERCENTILE)) if levels.size else 0.0)
    scaled: NDArray[np.uint8] = np.rint(np.clip(levels * (255 / white), 0, 255)).astype(np.uint8)
    return scaled


def _read_ply(path: Path) -> Cloud:
    points = read_ply(path)
    vertices = points.vertices
    names = vertices.dtype.names or ()
    xyz = _float32(np.stack([vertices[name] for name in "xyz"], axis=-1))[None]
    void = np.full(xyz.shape[:2], np.nan, dtype=np.float32)
    colour = None
    if all(name in names and vertices[name].dtype == np.uint8 for name in _RGB):
        colour = np.stack([vertices[name] for name in _RGB], axis=-1)[None]
    intensity = void if colour is None else (colour @ _LUMA).astype(np.float32)
    grey = colour is None or bool(np.all(colour == colour[..., :1]))
    frames = [line.removeprefix(_FRAME) for line in points.comments if line.startswith(_FRAME)]
    return Cloud(
        xyz=xyz,
        sigma_mm=_float32(vertices["sigma"])[None] if "sigma" in names else void,
        intensity=intensity,
        epipolar_px=void,
        colour=None if grey else colour,
        frame=frames[0] if frames else UNKNOWN_FRAME,
    )


_RGB = ("red", "green", "blue")


def _write_xyz(path: Path, cloud: Cloud) -> None:
    with replacing(path) as temporary:
        np.savetxt(temporary, cloud.xyz[cloud.valid], fmt="%.9g")


def _read_xyz(path: Path) -> Cloud:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty file: the shape tells
            points = np.loadtxt(path, usecols=(0, 1, 2), ndmin=2, encoding="utf-8")
    except (ValueError, OSError) as error:
        raise FormatError(f"{path}: not lines of x y z ({error})") from None
    if points.size == 0:
        raise FormatError(f"{path}: holds no points")
    void = np.full((1, len(points)), np.nan, dtype=np.float32)
    return Cloud(_float32(points)[None], void, void, void, frame=UNKNOWN_FRAME)


_WRITERS: dict[str, Callable[[Path, Cloud], None]] = {
    ".npz": _write_npz,
    ".ply": _write_ply,
    ".xyz": _write_xyz,
}
_READERS: dict[str, Callable[[Path], Cloud]] = {
    ".npz": _read_npz,
    ".ply": _read_ply,
    ".xyz": _read_xyz,
}
