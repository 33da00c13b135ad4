"""No scene or sensor file, however spoilt, gives anything but a noun or a clear refusal."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError
from fringeworks.files import read_scene, read_sensor, write_scene, write_sensor
from fringeworks.twin.effects import Effects, ProjectorEffects
from fringeworks.twin.scene import Scene
from tests.files.spoil import Document, spoil, spoil_bytes
from tests.files.test_mesh import pyramid
from tests.files.test_scene import SHAPES, posed, scene_of

Reader = Callable[[Path], object]

NAMES = ["../a.ply", "/", "scene_3.ply", "scene_3.ply/", "x" * 300, "object 0", "sphere", "none"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("trimesh")
    folder = tmp_path_factory.mktemp("twin")
    write_scene(folder / "scene.toml", _scene())
    write_sensor(folder / "sensor.toml", Effects(projector=ProjectorEffects(response=CURVE)))
    return folder


CURVE = ((0.0, 0.0), (0.5, 0.25), (1.0, 1.0))


def _scene() -> Scene:
    objects = scene_of(SHAPES[1], SHAPES[6], pyramid(), SHAPES[-1]).objects
    return Scene("spoilt", objects, objects[-1].name, (posed(1.0), posed(2.0)))


FILES: list[tuple[str, Reader]] = [("scene.toml", read_scene), ("sensor.toml", read_sensor)]


def read_or_refuse(path: Path, text: bytes, reader: Reader) -> None:
    spoilt = path.with_name("spoilt.toml")
    spoilt.write_bytes(text)
    try:
        reader(spoilt)
    except FormatError as error:
        message = str(error)
        assert str(path.parent) in message


@pytest.mark.parametrize(("name", "reader"), FILES)
@settings(max_examples=200)
@given(data=st.data())
def test_values_changed_added_and_taken_away(
    folder: Path, name: str, reader: Reader, data: st.DataObject
) -> None:
    whole: Document = tomllib.loads((folder / name).read_text())
    text = spoil(whole, NAMES, data)
    if text is not None:
        read_or_refuse(folder / name, text, reader)


@pytest.mark.parametrize(("name", "reader"), FILES)
@settings(max_examples=150)
@given(data=st.data())
def test_bytes_changed(folder: Path, name: str, reader: Reader, data: st.DataObject) -> None:
    whole: Document = tomllib.loads((folder / name).read_text())
    read_or_refuse(folder / name, spoil_bytes(whole, data), reader)


@pytest.mark.parametrize("suffix", ["stl", "ply", "obj"])
@settings(max_examples=100)
@given(data=st.data())
def test_meshes_with_bytes_changed(folder: Path, suffix: str, data: st.DataObject) -> None:
    trimesh = pytest.importorskip("trimesh")
    shape = pyramid()
    exported = trimesh.Trimesh(shape.vertices, shape.faces, process=False).export(file_type=suffix)
    content = bytearray(exported if isinstance(exported, bytes) else exported.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(content) - 1))
        content[start : start + data.draw(st.integers(0, 9))] = data.draw(st.binary(max_size=6))
        if not content:
            break
    (folder / f"part.{suffix}").write_bytes(content)
    text = PART.replace("SUFFIX", suffix)
    read_or_refuse(folder / "scene.toml", text.encode(), read_scene)


PART = """format = "fringeworks-scene/1"
[[object]]
name = "part"
shape = "mesh"
file = "part.SUFFIX"
position_mm = [0.0, 0.0, 600.0]
"""
