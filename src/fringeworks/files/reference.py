"""Read what a cloud is held against: a mesh, or another cloud."""

from __future__ import annotations

import math
from pathlib import Path

from fringeworks.errors import MeasurementError, UsageError
from fringeworks.files.cloud import read_cloud
from fringeworks.files.mesh import SUFFIXES, read_mesh
from fringeworks.files.ply import count_elements
from fringeworks.files.system import check_file
from fringeworks.measure.reference import Reference, cloud_reference, mesh_reference


def read_reference(path: str | Path, *, scale: float = 1.0) -> Reference:
    """The surface of an STL, OBJ or PLY with faces, or of a cloud on its camera's grid, mm.

    Parameters
    ----------
    scale
        mm per unit of a mesh's file.

    Raises
    ------
    UsageError
        A scale for a cloud, which is in mm, or one that is not positive.
    FormatError, MissingExtraError
        As `read_mesh` and `read_cloud`.
    MeasurementError
        A cloud without a grid, or a mesh without area.
    """
    path = Path(path)
    if not 0 < scale < math.inf:
        raise UsageError(f"scale must be positive, got {scale:g}")
    try:
        if _is_mesh(path):
            mesh = read_mesh(path, scale=scale)
            return mesh_reference(mesh.vertices, mesh.faces)
        if scale != 1.0:
            raise UsageError(f"{path}: a cloud is in mm; --scale belongs to meshes")
        return cloud_reference(read_cloud(path))
    except MeasurementError as error:
        raise MeasurementError(f"{path}: {error}") from None


def _is_mesh(path: Path) -> bool:
    """PLY may be either: what it holds tells."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        check_file(path)
        return count_elements(path).get("face", 0) > 0
    return suffix in SUFFIXES
