"""Clouds as PLY: points, or with `faces` the surface between them too."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from fringeworks.files.cloud_points import RGB, eight_bit, points_cloud
from fringeworks.files.ply import VERTEX, read_ply, write_ply
from fringeworks.measure.grid_mesh import cloud_normals, mesh_cloud
from fringeworks.model import Cloud
from fringeworks.model.frame import UNKNOWN_FRAME

_FRAME, _SCALE = "frame ", "scale_sigma "


def write_ply_cloud(path: Path, cloud: Cloud, *, faces: bool = False) -> None:
    """All valid points with normals, colour and sigma; `faces` joins them where nothing jumps.

    Raises
    ------
    MeasurementError
        Faces are asked for and the cloud has no grid.
    """
    valid = cloud.valid
    vertices = np.zeros(int(valid.sum()), dtype=VERTEX)
    columns = ((cloud.xyz[valid], "xyz"), (cloud_normals(cloud)[valid], ("nx", "ny", "nz")))
    for values, names in (*columns, (eight_bit(cloud), RGB)):
        for column, name in enumerate(names):
            vertices[name] = values[:, column]
    vertices["sigma"] = cloud.sigma_mm[valid]
    comments = [
        _FRAME + " ".join(cloud.frame.split()),
        "units mm; sigma: random part, one standard deviation along z",
    ]
    if cloud.scale_sigma is not None:
        comments.append(f"{_SCALE}{cloud.scale_sigma!r}")
    triangles = None
    if faces:
        mesh = mesh_cloud(cloud)
        rank = np.cumsum(valid.ravel()) - 1  # of each pixel among the valid points
        triangles = rank[mesh.pixels][mesh.faces]
    write_ply(path, vertices, comments=tuple(comments), triangles=triangles)


def read_ply_cloud(path: Path) -> Cloud:
    """Points ``(1, n)``; faces are skipped."""
    points = read_ply(path)
    vertices = points.vertices
    names = vertices.dtype.names or ()
    coloured = all(name in names and vertices[name].dtype == np.uint8 for name in RGB)
    return points_cloud(
        path,
        np.stack([vertices[name] for name in "xyz"], axis=-1)[None],
        sigma_mm=vertices["sigma"][None] if "sigma" in names else None,
        rgb=np.stack([vertices[name] for name in RGB], axis=-1)[None] if coloured else None,
        frame=_comment(points.comments, _FRAME) or UNKNOWN_FRAME,
        scale_sigma=_scale_sigma(_comment(points.comments, _SCALE)),
    )


def _comment(comments: tuple[str, ...], head: str) -> str | None:
    """What follows `head` in the first comment that begins with it."""
    found = (line.removeprefix(head) for line in comments if line.startswith(head))
    return next(found, None)


def _scale_sigma(text: str | None) -> float | None:
    """A comment is nobody's format: one that is no such number says nothing."""
    if text is None or not re.fullmatch(r"[0-9.]{1,30}(e[+-]?[0-9]{1,3})?", text.strip()):
        return None
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
