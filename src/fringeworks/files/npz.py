"""Archives of arrays: nothing in them is executed, and no header is believed unchecked."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.files.atomic import replacing

MAX_ARCHIVE_BYTES = 8 * 2**30
"""Largest sum of unpacked arrays that is read."""

Arrays = dict[str, NDArray[Any]]


def write_npz(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays under their names, not compressed; atomic."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def read_npz(path: Path) -> Arrays:
    """All arrays of an archive by name.

    Raises
    ------
    FormatError
        Missing, not an archive of arrays, damaged, or larger than `MAX_ARCHIVE_BYTES`.
    """
    if not path.is_file():
        raise FormatError(f"{path}: no such file")
    # zipfile, zlib and numpy raise a dozen types on damaged files; all mean the same.
    try:
        with zipfile.ZipFile(path) as archive:
            _check_sizes(path, archive)
            return {
                entry.filename.removesuffix(".npy"): _read_array(path, archive, entry)
                for entry in archive.infolist()
            }
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{path}: not a readable .npz archive ({error})") from error


def _check_sizes(path: Path, archive: zipfile.ZipFile) -> None:
    total = sum(entry.file_size for entry in archive.infolist())
    if total > MAX_ARCHIVE_BYTES:
        raise FormatError(f"{path}: {total / 2**30:.1f} GiB of arrays are more than is read")


def _read_array(path: Path, archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(entry) as file:
        shape, dtype = _read_header(file)
    if dtype.hasobject or math.prod(shape) * dtype.itemsize > entry.file_size:
        raise FormatError(f"{path}: '{entry.filename}' is not an array of numbers of its length")
    with archive.open(entry) as file:
        return np.asarray(np.lib.format.read_array(file, allow_pickle=False))


def _read_header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    else:
        shape, _, dtype = np.lib.format.read_array_header_2_0(file)
    return shape, dtype
