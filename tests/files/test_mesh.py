"""Meshes of a scene: read from files that may be anything, written beside the scene."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.errors import FormatError, MissingExtraError, UsageError
from fringeworks.files import mesh, read_scene, write_scene
from fringeworks.twin.scene import Mesh, Sphere
from tests.files.test_scene import document, read, scene_of


def pyramid() -> Mesh:
    """With digits that single precision does not have."""
    vertices = np.array([[0, 0, 0.1], [10, 0, 0], [0, 10 / 3, 0], [1, 1, 5]])
    return Mesh(vertices, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))


def test_meshes_are_written_beside_the_scene(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    write_scene(tmp_path / "a.toml", scene_of(Sphere(5.0), pyramid(), pyramid()))
    assert {path.name for path in tmp_path.iterdir()} == {"a.toml", "a_2.ply", "a_3.ply"}
    for item in read_scene(tmp_path / "a.toml").objects[1:]:
        assert isinstance(item.shape, Mesh)
        np.testing.assert_array_equal(item.shape.vertices, pyramid().vertices)
        np.testing.assert_array_equal(item.shape.faces, pyramid().faces)


def test_a_mesh_that_is_too_large_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = 4 * 24 + 4 * 13
    monkeypatch.setattr(mesh, "MAX_MESH_BYTES", size)
    write_scene(tmp_path / "a.toml", scene_of(pyramid()))
    monkeypatch.setattr(mesh, "MAX_MESH_BYTES", size - 1)
    with pytest.raises(UsageError, match="mesh is larger than a mesh file may be; decimate"):
        write_scene(tmp_path / "b.toml", scene_of(pyramid()))
    assert not (tmp_path / "b.toml").exists()


STL = """solid
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 2 0
endloop
endfacet
endsolid
"""
OBJ = "mtllib /etc/none.mtl\nusemtl x\nv 0 0 0\nv 1 0 0\nv 0 2 0\n"
PLY = """ply
format ascii 1.0
element vertex 3
property double x
property double y
property double z
element face {faces}
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 {y} 0
"""


def read_mesh_scene(folder: Path, name: str, content: str | bytes, **keys: Any) -> Mesh:
    data = content if isinstance(content, bytes) else content.encode()
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_bytes(data)
    part = {"name": "part", "shape": "mesh", "file": name, "position_mm": [0, 0, 600], **keys}
    shape = read(folder, document(part)).objects[0].shape
    assert isinstance(shape, Mesh)
    return shape


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("part.stl", STL),
        ("sub/PART.STL", STL),
        ("part.obj", OBJ + "f 1 2 3\n"),
        ("part.ply", PLY.format(faces=1, y=2) + "3 0 1 2\n"),
    ],
)
def test_meshes(tmp_path: Path, name: str, content: str) -> None:
    pytest.importorskip("trimesh")
    part = read_mesh_scene(tmp_path, name, content, scale=25.4)
    corners = part.vertices[part.faces]
    np.testing.assert_array_equal(corners, [[[0, 0, 0], [25.4, 0, 0], [0, 50.8, 0]]])
    assert part.source == Path(name).name


def test_squares_are_cut_into_triangles_and_parts_joined(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 2 2\no a\nf 1 2 3 4\no b\nf 1 2 5\n"
    part = read_mesh_scene(tmp_path, "part.obj", square)
    corners = part.vertices[part.faces]
    areas = np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1) / 2
    np.testing.assert_allclose(np.sort(areas), [0.5, 0.5, np.sqrt(2)])


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("part.step", "", r"part\.step: a mesh must be one of \.stl, \.ply, \.obj, got '\.step'"),
        ("part.stl", "", r"part\.stl: holds no faces; export a mesh of triangles, not points"),
        ("part.stl", b"\xff\xfe\x00 no mesh", r"part\.stl: not a readable STL mesh"),
        ("part.ply", "no mesh\n", r"part\.ply: not a readable PLY mesh \(Not a ply file"),
        (
            "part.stl",
            bytes(80) + b"\2\0\0\0" + bytes(50),
            r"part\.stl: not a readable STL mesh: the header says 2 triangles, 184 bytes, .* 134",
        ),
        (
            "part.ply",
            PLY.format(faces=3, y=1) + "3 0 1 2\n",
            r"part\.ply: cut off: the header says 3 faces, the file holds 1; export",
        ),
        ("part.obj", OBJ + "v 2e6 0 0\nf 1 3 4\n", r"coordinates of at most 1e\+06 mm, got 2e"),
        ("part.obj", OBJ, r"part\.obj: holds no faces"),
        ("part.obj", OBJ + "f 1 2 9\n", r"part\.obj: not a readable OBJ mesh \(index 8 is out of"),
        ("part.ply", PLY.format(faces=0, y=1), r"part\.ply: holds no faces"),
        ("part.ply", PLY.format(faces=1, y="nan") + "3 0 1 2\n", r"two\.toml: .*part\.ply.* 1 "),
        ("part.ply", PLY.format(faces=1, y=1) + "3 0 1 7\n", r"two\.toml: .*part\.ply"),
    ],
)
def test_what_is_no_mesh(tmp_path: Path, name: str, content: str | bytes, message: str) -> None:
    pytest.importorskip("trimesh")
    with pytest.raises(FormatError, match=message):
        read_mesh_scene(tmp_path, name, content)


@pytest.mark.skipif(os.name != "posix", reason="pipes have names there")
def test_a_folder_or_a_pipe_is_no_mesh(tmp_path: Path) -> None:
    (tmp_path / "a.stl").mkdir()
    os.mkfifo(tmp_path / "b.stl")
    for name in ("a.stl", "b.stl"):
        with pytest.raises(FormatError, match="not a regular file; is it a folder or a device"):
            mesh.read_mesh(tmp_path / name)


@pytest.mark.parametrize("name", ["../part.stl", "/etc/hostname.stl", "C:part.stl", "a\\b.stl", ""])
def test_a_mesh_stays_inside_the_folder(tmp_path: Path, name: str) -> None:
    part = {"name": "part", "shape": "mesh", "file": name, "position_mm": [0, 0, 600]}
    with pytest.raises(FormatError, match=r"mesh path .* (leaves the scene's folder|must be a na)"):
        read(tmp_path, document(part))


def test_a_mesh_that_is_not_there(tmp_path: Path) -> None:
    part = {"name": "part", "shape": "mesh", "file": "a.stl", "position_mm": [0, 0, 600]}
    with pytest.raises(FormatError, match=r"a\.stl: no such file"):
        read(tmp_path, document(part))


def test_large_meshes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("trimesh")
    monkeypatch.setattr(mesh, "MAX_FACES", 1)
    two = OBJ + "f 1 2 3\nf 3 2 1\n"
    with pytest.raises(FormatError, match="must have at most 1 faces, got 2; decimate the mesh"):
        read_mesh_scene(tmp_path, "part.obj", two)
    monkeypatch.setattr(mesh, "MAX_MESH_BYTES", len(two) - 1)
    message = rf"part\.obj: must have at most {len(two) - 1} bytes, got {len(two)}; decimate"
    with pytest.raises(FormatError, match=message):
        read_mesh_scene(tmp_path, "part.obj", two)


def test_without_trimesh_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MissingExtraError, match=r"pip install fringeworks\[mesh\]"):
        read_mesh_scene(tmp_path, "part.stl", STL)
