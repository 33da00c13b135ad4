"""PCD 0.7, the Point Cloud Library's format, organised: one point per camera pixel.

https://pointclouds.org/documentation/tutorials/pcd_file_format.html. Written binary; read binary
and ascii, not `binary_compressed`.
"""

from __future__ import annotations

import math
import os
import warnings
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.files.atomic import replacing
from fringeworks.files.cloud_points import MAX_POINTS, eight_bit, points_cloud
from fringeworks.files.poses import quaternion
from fringeworks.files.validation import clip, shorten
from fringeworks.measure.grid_mesh import cloud_normals
from fringeworks.model import Cloud, Pose

MAX_HEADER_LINES = 64

_FLOATS = ("x", "y", "z", "normal_x", "normal_y", "normal_z", "intensity", "sigma_mm")
POINT = np.dtype([*((name, "<f4") for name in _FLOATS), ("rgb", "<u4")])

LEAST_LINE = 5
"""Bytes of the shortest line of x y z; the last may have no end."""

_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS")
_USED = frozenset(POINT.names or ())

_KINDS = {"F": "f", "U": "u", "I": "i"}
_SIZES = {"F": (4, 8), "U": (1, 2, 4, 8), "I": (1, 2, 4, 8)}


def write_pcd_cloud(path: Path, cloud: Cloud) -> None:
    """Every pixel, NaN where void; the viewpoint is where the camera stood."""
    points = np.zeros(cloud.valid.shape, POINT)
    for column, letter in enumerate("xyz"):
        points[letter] = cloud.xyz[..., column]
    normals = cloud_normals(cloud)
    for column, letter in enumerate("xyz"):
        points[f"normal_{letter}"] = normals[..., column]
    points["intensity"], points["sigma_mm"] = cloud.intensity, cloud.sigma_mm
    red, green, blue = eight_bit(cloud).astype(np.uint32).T
    points["rgb"][cloud.valid] = red << 16 | green << 8 | blue
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(_header(cloud).encode())
        file.write(points.tobytes())


def _header(cloud: Cloud) -> str:
    rows, columns = cloud.valid.shape
    pose = cloud.frame_from_camera or Pose.identity()
    place = (*pose.translation_mm, *quaternion(pose))
    names = POINT.names or ()
    frame = " ".join(cloud.frame.split())
    lines = (
        f"# .PCD v0.7 - Point Cloud Data; mm, frame {frame}",
        "VERSION 0.7",
        "FIELDS " + " ".join(names),
        "SIZE" + " 4" * len(names),
        "TYPE " + " ".join("U" if name == "rgb" else "F" for name in names),
        "COUNT" + " 1" * len(names),
        f"WIDTH {columns}",
        f"HEIGHT {rows}",
        "VIEWPOINT " + " ".join(f"{value:.9g}" for value in place),
        f"POINTS {rows * columns}",
        "DATA binary",
    )
    return "\n".join(lines) + "\n"


def read_pcd_cloud(path: Path) -> Cloud:
    """Points on the grid that the header tells, mm; fields beyond those of `POINT` are skipped.

    Raises
    ------
    FormatError
        Not a PCD, packed, without x y z, without points, or shorter than its header says.
    """
    try:
        with path.open("rb") as file:
            header = _read_header(path, file)
            dtype, shape = _type_of(path, header), _shape_of(path, header)
            points = _read_points(path, file, header["DATA"], (dtype, shape))
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: not a readable PCD ({error})") from None
    names = dtype.names or ()
    rgb = None
    if "rgb" in names and dtype["rgb"].itemsize == 4:
        packed = np.ascontiguousarray(points["rgb"]).view(np.uint32)
        rgb = np.stack([packed >> 16 & 255, packed >> 8 & 255, packed & 255], -1).astype(np.uint8)
    return points_cloud(
        path,
        np.stack([points[letter] for letter in "xyz"], axis=-1),
        sigma_mm=points["sigma_mm"] if "sigma_mm" in names else None,
        intensity=points["intensity"] if "intensity" in names else None,
        rgb=rgb,
    )


def _read_header(path: Path, file: IO[bytes]) -> dict[str, str]:
    found: dict[str, str] = {}
    for _ in range(MAX_HEADER_LINES):
        line = file.readline(4096).decode("ascii", errors="replace").strip()
        if line.startswith("#") or not line:
            continue
        key, _, value = line.partition(" ")
        if key in found and key in _KEYS:
            raise FormatError(f"{path}: {shorten(key)} stands twice in the PCD header")
        found[key] = value
        if key == "DATA":
            return found
    raise FormatError(f"{path}: not a PCD file, or its header has no end")


def _type_of(path: Path, header: dict[str, str]) -> np.dtype[Any]:
    names = header.get("FIELDS", "").split()
    sizes, kinds = header.get("SIZE", "").split(), header.get("TYPE", "").split()
    counts = header.get("COUNT", " ".join("1" * len(names))).split()
    if not len(names) == len(sizes) == len(kinds) == len(counts):
        raise FormatError(f"{path}: FIELDS, SIZE, TYPE and COUNT must be of one length")
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for name, size, kind, count in zip(names, sizes, kinds, counts, strict=True):
        if kind not in _KINDS or size not in map(str, _SIZES[kind]) or not count.isdecimal():
            raise FormatError(f"{path}: field {shorten(name)} is not understood")
        if name in _USED and count != "1":
            raise FormatError(f"{path}: field {name} must have COUNT 1, got {shorten(count)}")
        shape = () if count == "1" else (min(int(count), 4096),)
        name = f"_{len(fields)}" if name == "_" else name  # padding, as often as they like
        fields.append((name, f"<{_KINDS[kind]}{size}", shape))
    try:
        dtype = np.dtype(fields)
    except ValueError as error:
        raise FormatError(f"{path}: FIELDS: {clip(error)}") from None
    missing = [letter for letter in "xyz" if letter not in names]
    if missing:
        raise FormatError(f"{path}: FIELDS lack {', '.join(missing)}")
    return dtype


def _shape_of(path: Path, header: dict[str, str]) -> tuple[int, int]:
    try:
        rows, columns = int(header["HEIGHT"]), int(header["WIDTH"])
    except (KeyError, ValueError):
        raise FormatError(f"{path}: the PCD header has no WIDTH or HEIGHT") from None
    if not 0 < rows * columns <= MAX_POINTS or rows < 0:
        raise FormatError(f"{path}: must hold 1 to {MAX_POINTS} points, got {rows * columns}")
    if header.get("POINTS", str(rows * columns)) != str(rows * columns):
        raise FormatError(f"{path}: POINTS must be WIDTH times HEIGHT, {rows * columns}")
    return rows, columns


def _read_points(
    path: Path, file: IO[bytes], kind: str, layout: tuple[np.dtype[Any], tuple[int, int]]
) -> NDArray[Any]:
    dtype, shape = layout
    count = math.prod(shape)
    if kind not in ("binary", "ascii"):
        raise FormatError(f"{path}: DATA must be binary or ascii, got {shorten(kind)}")
    least = count * (dtype.itemsize if kind == "binary" else LEAST_LINE)
    if least > os.fstat(file.fileno()).st_size - file.tell():  # before anything is allocated
        raise FormatError(f"{path}: cut off: the header says {count} points, there are fewer")
    if kind == "binary":
        return np.frombuffer(file.read(least), dtype).reshape(shape)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # nothing but comments: the length tells
            points = np.loadtxt(file, dtype=dtype, max_rows=count, ndmin=1, encoding="ascii")
    except ValueError as error:
        raise FormatError(f"{path}: not a readable PCD ({clip(error)})") from None
    if len(points) < count:
        raise FormatError(f"{path}: cut off: the header says {count} points, got {len(points)}")
    return points.reshape(shape)
