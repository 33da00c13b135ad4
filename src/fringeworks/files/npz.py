"""Archives of arrays: nothing in them is executed, and no header is believed unchecked."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.files.atomic import replacing
from fringeworks.files.system import check_file
from fringeworks.files.validation import clip

MAX_ARCHIVE_BYTES = 8 * 2**30
"""Largest sum of unpacked arrays that is read."""

MAX_ARRAY_BYTES = 4 * 2**30
"""Largest single array, unpacked."""

MAX_RATIO = 100
"""Strongest compression that is unpacked; our own arrays are stored as they are."""

Arrays = dict[str, NDArray[Any]]


def write_npz(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays under their names, not compressed; atomic."""
    whole = {name: np.asarray(array, order="C") for name, array in arrays.items()}
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **whole)  # views would go out in small pieces


def read_npz(path: Path, names: Collection[str]) -> Arrays:
    """The arrays of these names that an archive has; others are not looked at.

    Raises
    ------
    FormatError
        Missing, not an archive of arrays, damaged, or more is asked for than `MAX_ARCHIVE_BYTES`
        in all, `MAX_ARRAY_BYTES` in one array, or packed more tightly than `MAX_RATIO`.
    """
    check_file(path)
    # zipfile, zlib and numpy raise a dozen types on damaged files; all mean the same.
    try:
        with zipfile.ZipFile(path) as archive:
            entries = {
                name: entry
                for entry in archive.infolist()
                if (name := entry.filename.removesuffix(".npy")) in names
            }
            _check_sizes(path, entries.values())
            return {name: _read_array(path, archive, entry) for name, entry in entries.items()}
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{path}: not a readable .npz archive ({clip(error)})") from error


def _check_sizes(path: Path, entries: Collection[zipfile.ZipInfo]) -> None:
    for entry in entries:
        if entry.file_size > MAX_ARRAY_BYTES:
            size = f"{entry.file_size / 2**30:.1f} GiB"
            limit = f"{MAX_ARRAY_BYTES / 2**30:g} GiB"
            raise FormatError(f"{path}: '{entry.filename}' must be at most {limit}, got {size}")
        if entry.file_size > MAX_RATIO * entry.compress_size:
            raise FormatError(
                f"{path}: '{entry.filename}' must be packed at most {MAX_RATIO} times, got "
                f"{entry.file_size} bytes in {entry.compress_size}"
            )
    total = sum(entry.file_size for entry in entries)
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
