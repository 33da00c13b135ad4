"""E57 (ASTM E2807), the surveyors' format, by pye57 (the extra `e57`); in the file are metres."""

from __future__ import annotations

import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError, MissingExtraError
from fringeworks.files.atomic import replacing
from fringeworks.files.cloud_points import MAX_POINTS, eight_bit, float32, points_cloud
from fringeworks.files.validation import clip
from fringeworks.model import Cloud

MM_PER_M = 1000.0
SPARSEST = 1000
"""Pixels per point: a file that claims more is read as a list of points."""

_COLOURS = ("colorRed", "colorGreen", "colorBlue")
_XYZ = ("cartesianX", "cartesianY", "cartesianZ")


def write_e57_cloud(path: Path, cloud: Cloud) -> None:
    """The valid points with rows and columns of their pixels, intensity and colour; no sigma.

    Raises
    ------
    MissingExtraError
        pye57 is not installed.
    FormatError
        The file cannot be written.
    """
    pye57 = _library(path)
    valid = cloud.valid
    # Through single precision, in which the file keeps them: its bounds are checked to the bit.
    metres = float32(cloud.xyz[valid].astype(np.float64) / MM_PER_M).astype(np.float64)
    data: dict[str, NDArray[Any]] = dict(zip(_XYZ, metres.T.copy(), strict=True))
    intensity = cloud.intensity[valid]
    if np.isfinite(intensity).all():
        data["intensity"] = intensity.astype(np.float64)
    data |= zip(_COLOURS, eight_bit(cloud).T.copy(), strict=True)
    data["rowIndex"], data["columnIndex"] = (part.astype(np.int32) for part in np.nonzero(valid))
    data["cartesianInvalidState"] = np.zeros(len(metres), np.int8)  # readers ask for it
    with replacing(path) as temporary:
        try:
            file = pye57.E57(str(temporary), mode="w")
            try:
                file.write_scan_raw(data, name=cloud.frame)
            finally:
                file.close()
        except pye57.libe57.E57Exception as error:
            raise FormatError(f"{path}: cannot be written ({_first_line(error)})") from None


def read_e57_cloud(path: Path) -> Cloud:
    """All scans of a file as points, mm: on the grid of the pixels where there is one scan with it.

    Raises
    ------
    MissingExtraError
        pye57 is not installed.
    FormatError
        Damaged, not an E57, or without points.
    """
    pye57 = _library(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = pye57.E57(str(path))
            scans = [_read_scan(file, number) for number in range(file.scan_count)]
            file.close()
    except Exception as error:
        raise FormatError(f"{path}: not a readable E57 ({_first_line(error)})") from None
    scans = [scan for scan in scans if len(scan["xyz"])]
    if not scans:
        raise FormatError(f"{path}: holds no points")
    if len(scans) == 1 and _has_grid(scans[0]):
        return _on_grid(path, scans[0])
    return points_cloud(path, np.concatenate([scan["xyz"] for scan in scans])[None])


def _read_scan(file: Any, number: int) -> dict[str, NDArray[Any]]:
    header = file.get_header(number)
    if header.point_count > MAX_POINTS:  # the library allocates as many
        raise ValueError(f"{header.point_count} points, more than {MAX_POINTS}")
    known = header.point_fields
    grid = {"rowIndex", "columnIndex"} <= set(known)
    scan = file.read_scan(
        number,
        intensity="intensity" in known,
        colors=set(_COLOURS) <= set(known),
        row_column=grid,
        ignore_missing_fields=True,
    )
    found = {"xyz": np.stack([scan[name] for name in _XYZ], axis=-1) * MM_PER_M}
    if "intensity" in scan:
        found["intensity"] = scan["intensity"]
    if set(_COLOURS) <= set(scan):
        found["rgb"] = np.stack([scan[name] for name in _COLOURS], axis=-1).astype(np.uint8)
    if grid:
        found["pixels"] = np.stack([scan["rowIndex"], scan["columnIndex"]], axis=-1)
    return found


def _has_grid(scan: dict[str, NDArray[Any]]) -> bool:
    """Whether pixels are told, on a grid that is not all but empty."""
    if "pixels" not in scan or scan["pixels"].min() < 0:
        return False
    rows, columns = (int(most) + 1 for most in scan["pixels"].max(axis=0))
    return rows * columns <= SPARSEST * len(scan["xyz"])


def _on_grid(path: Path, scan: dict[str, NDArray[Any]]) -> Cloud:
    pixels = scan["pixels"].astype(np.int64)
    rows, columns = pixels.max(axis=0) + 1
    place = tuple(pixels.T)

    def spread(values: NDArray[Any], void: Any) -> NDArray[Any]:
        whole = np.full((rows, columns, *values.shape[1:]), void, values.dtype)
        whole[place] = values
        return whole

    return points_cloud(
        path,
        spread(scan["xyz"], np.nan),
        intensity=spread(scan["intensity"], np.nan) if "intensity" in scan else None,
        rgb=spread(scan["rgb"], 0) if "rgb" in scan else None,
    )


def _first_line(error: Exception) -> str:
    """What the library says, without where in its sources."""
    return clip(next(iter(str(error).splitlines()), type(error).__name__))


def _library(path: Path) -> Any:
    try:
        return import_module("pye57")
    except ImportError:
        raise MissingExtraError(
            f"{path}: the E57 format takes pye57: pip install fringeworks[e57]"
        ) from None
