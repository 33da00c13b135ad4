"""Binary little endian PLY: points with normals, colour and sigma, and triangles between them.

https://paulbourke.net/dataformats/ply/ (Turk 1994). A header's counts are checked against the
file's size before anything is allocated.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.files.atomic import replacing
from fringeworks.files.validation import clip, shorten

MAX_HEADER_BYTES = 2**16

_TYPES = {
    **dict.fromkeys(("char", "int8"), "<i1"),
    **dict.fromkeys(("uchar", "uint8"), "<u1"),
    **dict.fromkeys(("short", "int16"), "<i2"),
    **dict.fromkeys(("ushort", "uint16"), "<u2"),
    **dict.fromkeys(("int", "int32"), "<i4"),
    **dict.fromkeys(("uint", "uint32"), "<u4"),
    **dict.fromkeys(("float", "float32"), "<f4"),
    **dict.fromkeys(("double", "float64"), "<f8"),
}
_NAMES = {"<u1": "uchar", "<f4": "float"}

VERTEX = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")]
    + [(name, "<u1") for name in ("red", "green", "blue")]
    + [("sigma", "<f4")]
)
"""One point as `write_ply` writes it."""

FACE = np.dtype([("count", "<u1"), ("corners", "<i4", 3)])
FACES = "property list uchar int vertex_indices"


@dataclass(frozen=True, slots=True)
class PlyPoints:
    """Vertices of a PLY file, a structured array ``(n,)``, and the comments of its header."""

    vertices: NDArray[Any]
    comments: tuple[str, ...]


def write_ply(
    path: Path,
    vertices: NDArray[Any],
    *,
    comments: tuple[str, ...] = (),
    triangles: NDArray[np.integer] | None = None,
) -> None:
    """Write a structured array ``(n,)`` of type `VERTEX`, and triangles ``(m, 3)``; atomic."""
    names = VERTEX.names or ()
    faces = np.zeros(0 if triangles is None else len(triangles), FACE)
    if triangles is not None:
        faces["count"], faces["corners"] = 3, triangles
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {comment}" for comment in comments),
        f"element vertex {len(vertices)}",
        *(f"property {_NAMES[VERTEX[name].str.replace('|', '<')]} {name}" for name in names),
        *(() if triangles is None else (f"element face {len(faces)}", FACES)),
        "end_header",
    ]
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(("\n".join(lines) + "\n").encode())
        file.write(vertices.astype(VERTEX, copy=False).tobytes())
        file.write(faces.tobytes())


def read_ply(path: Path) -> PlyPoints:
    """Vertices of a binary little endian PLY, with all their properties; faces are skipped.

    Raises
    ------
    FormatError
        Not a PLY, ascii or big endian, without x y z, shorter than its header says.
    """
    lines, start = _read_header(path)
    if lines[1:2] != ["format binary_little_endian 1.0"]:
        given = shorten(lines[1] if len(lines) > 1 else "")
        raise FormatError(f"{path}: PLY must be binary_little_endian 1.0, got {given}")
    comments = tuple(line.removeprefix("comment ") for line in lines if line.startswith("comment "))
    skipped, count, dtype = _find_vertices(path, lines)
    offset = start + skipped
    if offset + count * dtype.itemsize > path.stat().st_size:
        raise FormatError(f"{path}: cut off: the header says {count} points, the file is shorter")
    vertices = np.fromfile(path, dtype=dtype, count=count, offset=offset)
    return PlyPoints(vertices, comments)


def count_elements(path: Path) -> dict[str, int]:
    """How many of each element the header of any PLY names; fails as `read_ply`."""
    return {name: count for name, count, _ in _elements(path, _read_header(path)[0])}


def _read_header(path: Path) -> tuple[list[str], int]:
    """Lines of the header, and where the data start."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_HEADER_BYTES)
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror or error})") from error
    if not re.match(rb"ply\r?\n", data):
        raise FormatError(f"{path}: not a PLY file")
    end = re.search(rb"\nend_header\r?\n", data)
    if end is None:
        raise FormatError(f"{path}: the PLY header has no end; the file is cut off or damaged")
    text = data[: end.start()].decode(errors="replace")
    return [line.strip() for line in text.splitlines()], end.end()


def _find_vertices(path: Path, lines: list[str]) -> tuple[int, int, np.dtype[Any]]:
    """Bytes of the elements before the vertices, their number and type."""
    skipped = 0
    for name, count, properties in _elements(path, lines):
        dtype = _element_type(path, name, properties)
        if name == "vertex":
            _check_vertex(path, count, dtype)
            return skipped, count, dtype
        skipped += count * dtype.itemsize
    raise FormatError(f"{path}: the PLY has no vertices")


def _elements(path: Path, lines: list[str]) -> list[tuple[str, int, list[list[str]]]]:
    """Name, count and property lines (as words) of each element of the header."""
    elements: list[tuple[str, int, list[list[str]]]] = []
    for line in lines:
        words = line.split()
        if words[:1] == ["element"]:
            if len(words) != 3 or not re.fullmatch(r"[0-9]{1,15}", words[2]):
                raise FormatError(f"{path}: PLY header line {shorten(line)} is not understood")
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"] and elements:
            elements[-1][2].append(words[1:])
    return elements


def _element_type(path: Path, name: str, properties: list[list[str]]) -> np.dtype[Any]:
    fields = []
    for words in properties:
        if len(words) != 2 or words[0] not in _TYPES:
            raise FormatError(
                f"{path}: property {shorten(' '.join(words))} of {clip(name)} is not "
                "understood; vertices of plain numbers must come first"
            )
        fields.append((words[1], _TYPES[words[0]]))
    try:
        return np.dtype(fields)
    except ValueError as error:  # a name twice
        raise FormatError(f"{path}: properties of {clip(name)}: {clip(error)}") from None


def _check_vertex(path: Path, count: int, dtype: np.dtype[Any]) -> None:
    if count == 0:
        raise FormatError(f"{path}: the PLY has no points")
    missing = [name for name in "xyz" if name not in (dtype.names or ())]
    if missing:
        raise FormatError(f"{path}: vertices lack the property {missing[0]}")
