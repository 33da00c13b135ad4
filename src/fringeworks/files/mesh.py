"""Read meshes, STL, PLY and OBJ, by trimesh (the extra `mesh`); write them as PLY."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError, MissingExtraError, UsageError
from fringeworks.files.atomic import replacing
from fringeworks.files.ply import count_elements
from fringeworks.files.system import check_file
from fringeworks.files.validation import clip
from fringeworks.twin.scene import Mesh

SUFFIXES = (".stl", ".ply", ".obj")

MAX_MESH_BYTES = 512 * 2**20
"""Largest mesh file that is read or written."""

MAX_FACES = 20_000_000

_STL_HEAD, _STL_TRIANGLE = 84, 50
"""Bytes of a binary STL's header, whose last four count the triangles, and of each of these."""

_HEADER = """ply
format binary_little_endian 1.0
comment units mm
element vertex {vertices}
property double x
property double y
property double z
element face {faces}
property list uchar int vertex_indices
end_header
"""


def read_mesh(path: Path, *, scale: float = 1.0) -> Mesh:
    """The triangles of a file, its coordinates times `scale`: mm per unit of the file.

    Several parts in one file become one mesh; larger faces than triangles are cut. Materials
    and other files that it names are not looked at. What the numbers are is `twin.check`'s.

    Raises
    ------
    MissingExtraError
        trimesh is not installed.
    FormatError
        Missing, another suffix, larger than `MAX_MESH_BYTES` or `MAX_FACES`, damaged, or without
        any triangle.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise FormatError(f"{path}: a mesh must be one of {', '.join(SUFFIXES)}, got '{suffix}'")
    _check_size(path)
    if suffix == ".stl":
        _check_stl(path)
    vertices, faces = _load(path)
    claimed = count_elements(path).get("face", 0) if suffix == ".ply" else 0
    if len(faces) < claimed:  # larger faces than triangles are cut into several
        raise FormatError(
            f"{path}: cut off: the header says {claimed} faces, the file holds {len(faces)}; "
            "export the mesh again"
        )
    if len(faces) == 0:
        raise FormatError(f"{path}: holds no faces; export a mesh of triangles, not points")
    if len(faces) > MAX_FACES:
        raise FormatError(
            f"{path}: must have at most {MAX_FACES} faces, got {len(faces)}; decimate the mesh"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        return Mesh(scale * vertices, faces, source=path.name)


def write_mesh(path: Path, mesh: Mesh) -> None:
    """Write binary PLY, atomic: vertices as doubles, so that they read back as they are.

    Raises
    ------
    UsageError
        More than `MAX_MESH_BYTES`.
    FormatError
        The file cannot be written.
    """
    triangles = np.zeros(len(mesh.faces), dtype=[("count", "<u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, mesh.faces
    vertices = np.ascontiguousarray(mesh.vertices, dtype="<f8")
    if vertices.nbytes + triangles.nbytes > MAX_MESH_BYTES:
        raise UsageError(f"{mesh.source} is larger than a mesh file may be; decimate the mesh")
    header = _HEADER.format(vertices=len(vertices), faces=len(triangles))
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode() + vertices.tobytes() + triangles.tobytes())


def _check_size(path: Path) -> None:
    check_file(path)
    size = path.stat().st_size
    if size > MAX_MESH_BYTES:
        raise FormatError(
            f"{path}: must have at most {MAX_MESH_BYTES} bytes, got {size}; decimate the mesh"
        )


def _check_stl(path: Path) -> None:
    """A binary STL is as long as its count says; a text begins with the word solid."""
    with path.open("rb") as file:
        head = file.read(_STL_HEAD)
    if head.startswith(b"solid") or len(head) < _STL_HEAD:
        return
    count, size = int.from_bytes(head[-4:], "little"), path.stat().st_size
    if size != _STL_HEAD + count * _STL_TRIANGLE:
        raise FormatError(
            f"{path}: not a readable STL mesh: the header says {count} triangles, "
            f"{_STL_HEAD + count * _STL_TRIANGLE} bytes, the file has {size}; export it again"
        )


def _load(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    try:
        import trimesh
    except ImportError:
        raise MissingExtraError(
            f"{path}: reading meshes takes trimesh: pip install fringeworks[mesh]"
        ) from None
    # An open file instead of its path: trimesh then finds no folder to follow names into.
    # What it raises on damaged files is of a dozen types, missing modules among them.
    kind = path.suffix.lower().removeprefix(".")
    try:
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what is not finite: the check tells
            mesh = trimesh.load_mesh(file, file_type=kind, process=False)
            return np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64)
    except (Exception, MemoryError) as error:
        reason = "" if isinstance(error, ImportError) else f" ({clip(error)})"
        raise FormatError(f"{path}: not a readable {kind.upper()} mesh{reason}") from error
