"""Read and write clouds, the format by suffix: points, meshes, arrays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.atomic import replacing
from fringeworks.files.cloud_mesh import write_glb_cloud, write_obj_cloud, write_stl_cloud
from fringeworks.files.cloud_npz import read_npz_cloud, write_npz_cloud
from fringeworks.files.cloud_ply import read_ply_cloud, write_ply_cloud
from fringeworks.files.cloud_text import read_xyz_cloud, write_xyz_cloud
from fringeworks.files.e57 import read_e57_cloud, write_e57_cloud
from fringeworks.files.pcd import read_pcd_cloud, write_pcd_cloud
from fringeworks.files.poses import pose_matrix
from fringeworks.files.system import check_file
from fringeworks.model import Cloud

Handler = TypeVar("Handler")


def write_cloud(path: str | Path, cloud: Cloud, *, faces: bool = False) -> None:
    """Write a cloud, atomic; the suffix of `path` chooses the format.

    ``.npz`` keeps everything, organised, and ``.mat`` nearly so. ``.ply`` (binary little endian)
    has the valid points with normals (0 0 0 where the grid gives none), 8 bit colour and sigma, and
    names its frame in a comment; with `faces` its triangles too. Deeper levels are scaled so that
    their 99.5 percentile is 255. ``.pcd`` is organised and binary, ``.e57`` in metres, ``.xyz``
    text, x y z in mm, one point a line. ``.stl``, ``.obj`` and ``.glb`` are meshes.

    Raises
    ------
    UsageError
        Another suffix, or faces asked of a format that has none.
    MeasurementError
        A mesh of a cloud without a grid.
    MissingExtraError
        ``.e57`` without pye57.
    FormatError
        The file cannot be written, or it would hold points and there are none.
    """
    path = Path(path)
    check_cloud_suffix(path)
    write = _WRITERS[path.suffix.lower()]
    if path.suffix.lower() in POINT_SUFFIXES and not cloud.valid.any():
        raise FormatError(f"{path}: the cloud has no points to write; .npz keeps why it has none")
    if not faces or path.suffix.lower() in MESH_SUFFIXES:
        write(path, cloud)
    elif write is write_ply_cloud:
        write_ply_cloud(path, cloud, faces=True)
    else:
        raise UsageError(f"a mesh must be .ply, .stl, .obj or .glb, got '{path.suffix}'")


def read_cloud(path: str | Path) -> Cloud:
    """Read a cloud in mm: ``(H, W)`` from ``.npz`` and organised files, ``(1, n)`` from others.

    What the file does not tell (sigma, intensity) is NaN, its frame ``unknown``.

    Raises
    ------
    UsageError
        A suffix that is not read.
    MissingExtraError
        ``.e57`` without pye57.
    FormatError
        The file is missing, damaged, not of its suffix's format, or holds no points.
    """
    path = Path(path)
    reader = _choose(path, _READERS)
    check_file(path)
    return reader(path)


def check_cloud_suffix(path: Path) -> None:
    """Refuse a file that `write_cloud` has no format for with a UsageError, before the work."""
    _choose(path, _WRITERS)


def check_points_suffix(path: Path) -> None:
    """The same for a cloud without a grid, of which there is no mesh."""
    check_cloud_suffix(path)
    if path.suffix.lower() in MESH_SUFFIXES:
        raise UsageError(f"{path}: a mesh needs one cloud's grid; use .ply, .npz or another")


def _choose(path: Path, handlers: dict[str, Handler]) -> Handler:
    suffix = path.suffix.lower()
    if suffix in handlers:
        return handlers[suffix]
    other = "is written but not read" if suffix in _WRITERS else "is not known"
    raise UsageError(f"cloud format '{suffix}' {other}; use one of {', '.join(handlers)}")


def _write_mat_cloud(path: Path, cloud: Cloud) -> None:
    """MATLAB 5 file, packed: the arrays of the ``.npz`` that MATLAB has a use for."""
    from scipy.io import savemat

    arrays = {
        "xyz_mm": cloud.xyz,
        "sigma_mm": cloud.sigma_mm,
        "intensity": cloud.intensity,
        "frame": cloud.frame,
    }
    if cloud.colour is not None:
        arrays["colour"] = cloud.colour
    if cloud.systematic_mm is not None:
        arrays["systematic_mm"] = cloud.systematic_mm
    if cloud.scale_sigma is not None:
        arrays["scale_sigma"] = np.array(cloud.scale_sigma)
    if cloud.frame_from_camera is not None:
        arrays["frame_from_camera"] = pose_matrix(cloud.frame_from_camera)
    with replacing(path) as temporary:
        savemat(temporary, arrays, do_compression=True)


MESH_SUFFIXES = (".stl", ".obj", ".glb")
POINT_SUFFIXES = (".ply", ".pcd", ".xyz", ".e57")

_WRITERS: dict[str, Callable[[Path, Cloud], None]] = {
    ".npz": write_npz_cloud,
    ".ply": write_ply_cloud,
    ".pcd": write_pcd_cloud,
    ".xyz": write_xyz_cloud,
    ".e57": write_e57_cloud,
    ".mat": _write_mat_cloud,
    ".stl": write_stl_cloud,
    ".obj": write_obj_cloud,
    ".glb": write_glb_cloud,
}
_READERS: dict[str, Callable[[Path], Cloud]] = {
    ".npz": read_npz_cloud,
    ".ply": read_ply_cloud,
    ".pcd": read_pcd_cloud,
    ".xyz": read_xyz_cloud,
    ".e57": read_e57_cloud,
}
