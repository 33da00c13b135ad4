"""Clouds as meshes: STL, OBJ and GLB, open where the depth jumps.

STL and OBJ are mm in the cloud's frame. glTF is metres, y up: a GLB has the same mm and the frame's
own axes in its mesh, and a node that makes metres of them and turns y up and z to the viewer.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks import __version__
from fringeworks.files.atomic import replacing
from fringeworks.files.cloud_points import eight_bit
from fringeworks.measure.grid_mesh import GridMesh, mesh_cloud
from fringeworks.model import Cloud

STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
STL_HEAD_BYTES = 80

GLTF_FROM_MM = (0.001, -0.001, -0.001)
"""Of x, y and z: metres, y up, z towards the viewer; half a turn about x."""

_FLOAT, _UINT, _USHORT = 5126, 5125, 5123
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963

_PRIMITIVE = {
    "attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2},
    "indices": 3,
    "material": 0,
}
_MATERIAL = {
    "doubleSided": True,
    "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1},
}


def write_stl_cloud(path: Path, cloud: Cloud) -> None:
    """Binary STL; no colour, for the format has none.

    Raises
    ------
    MeasurementError
        The cloud has no grid (as for all meshes).
    """
    mesh = mesh_cloud(cloud)
    corners = mesh.vertices[mesh.faces].astype(np.float32)
    triangles = np.zeros(len(corners), STL_TRIANGLE)
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.maximum(np.linalg.norm(areas, axis=1, keepdims=True), np.finfo(np.float32).tiny)
    triangles["normal"], triangles["corners"] = areas / length, corners
    head = f"fringeworks, mm, frame {cloud.frame}".encode("ascii", "replace")
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(head[:STL_HEAD_BYTES].ljust(STL_HEAD_BYTES))
        file.write(len(triangles).to_bytes(4, "little"))
        file.write(triangles.tobytes())


def write_obj_cloud(path: Path, cloud: Cloud) -> None:
    """Text: corners with their colours, 0 to 1, behind x y z; normals; triangles."""
    mesh = mesh_cloud(cloud)
    colours = _colours(cloud, mesh) / 255
    corners = np.repeat(mesh.faces + 1, 2, axis=1)
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as file:
        file.write("# mm\n")
        np.savetxt(file, np.hstack([mesh.vertices, colours]), fmt="v %.9g %.9g %.9g %.4g %.4g %.4g")
        np.savetxt(file, mesh.normals, fmt="vn %.6f %.6f %.6f")
        np.savetxt(file, corners, fmt="f %d//%d %d//%d %d//%d")


def write_glb_cloud(path: Path, cloud: Cloud) -> None:
    """Binary glTF 2.0 with normals and colours (linear light, 16 bit)."""
    mesh = mesh_cloud(cloud)
    light = np.full((len(mesh.vertices), 4), 65535, "<u2")
    light[:, :3] = np.rint(65535 * _linear(_colours(cloud, mesh)))
    parts = (
        mesh.vertices.astype("<f4"),
        mesh.normals.astype("<f4"),
        light,
        mesh.faces.astype("<u4"),
    )
    document = _pad(json.dumps(_describe(parts)).encode(), b" ")
    binary = b"".join(part.tobytes() for part in parts)  # each a multiple of four bytes
    chunks = ((b"JSON", document), (b"BIN\0", binary))
    total = 12 + sum(8 + len(chunk) for _, chunk in chunks)
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(b"glTF" + (2).to_bytes(4, "little") + total.to_bytes(4, "little"))
        for kind, chunk in chunks:
            file.write(len(chunk).to_bytes(4, "little") + kind + chunk)


def _colours(cloud: Cloud, mesh: GridMesh) -> NDArray[np.uint8]:
    """RGB ``(n, 3)`` of the mesh's vertices."""
    whole = np.zeros((cloud.valid.size, 3), np.uint8)
    whole[cloud.valid.ravel()] = eight_bit(cloud)
    return np.asarray(whole[mesh.pixels])


def _linear(levels: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Light, 0 to 1, of levels as screens take them (IEC 61966-2-1)."""
    share = levels / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def _pad(data: bytes, filler: bytes) -> bytes:
    return data + filler * (-len(data) % 4)


def _describe(parts: tuple[NDArray[Any], ...]) -> dict[str, Any]:
    """The JSON of a glTF whose buffer has vertices, normals, colours and faces, in this order."""
    starts = np.cumsum([0, *(part.nbytes for part in parts)])
    vertices, normals, light, faces = parts
    x, y, z = GLTF_FROM_MM
    return {
        "asset": {"version": "2.0", "generator": f"fringeworks {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1]}],
        "meshes": [{"primitives": [_PRIMITIVE]}],
        "materials": [_MATERIAL],
        "accessors": [
            {
                **_accessor(0, _FLOAT, (len(vertices), "VEC3")),
                "min": vertices.min(axis=0).tolist(),
                "max": vertices.max(axis=0).tolist(),
            },
            _accessor(1, _FLOAT, (len(normals), "VEC3")),
            {**_accessor(2, _USHORT, (len(light), "VEC4")), "normalized": True},
            _accessor(3, _UINT, (faces.size, "SCALAR")),
        ],
        "bufferViews": [
            {
                "buffer": 0,
                "byteOffset": int(start),
                "byteLength": part.nbytes,
                "target": _ELEMENT_BUFFER if part is faces else _ARRAY_BUFFER,
            }
            for start, part in zip(starts, parts, strict=False)
        ],
        "buffers": [{"byteLength": int(starts[-1])}],
    }


def _accessor(view: int, kind: int, items: tuple[int, str]) -> dict[str, Any]:
    count, shape = items
    return {"bufferView": view, "componentType": kind, "count": count, "type": shape}
