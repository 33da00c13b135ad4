"""Read and write ``scene.toml``: what stands before the twin's rig."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
import tomlkit.items

from fringeworks.errors import FormatError
from fringeworks.files.atomic import write_text
from fringeworks.files.inside import locate_inside
from fringeworks.files.mesh import read_mesh, write_mesh
from fringeworks.files.nouns import describe_noun, make_noun
from fringeworks.files.scene_schema import (
    SCENE_FORMAT,
    AnyObject,
    MeshTable,
    SceneFile,
)
from fringeworks.files.toml import lay_out_toml
from fringeworks.files.validation import (
    check_format,
    read_toml,
    refusing,
    shorten,
    suggest,
    validated,
)
from fringeworks.geometry.pose import rotation_vector
from fringeworks.model import Pose
from fringeworks.twin.scene import (
    Blend,
    Board,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Material,
    Mesh,
    Object,
    Plane,
    Scene,
    Shape,
    Sphere,
)

SHAPES: dict[type[Shape], str] = {
    Plane: "plane",
    Sphere: "sphere",
    Cylinder: "cylinder",
    Cone: "cone",
    Box: "box",
}
"""Shapes whose fields are keys of the same names."""

ANGLE_DIGITS = 12
"""Decimals of degrees that are written: less than the rounding of a rotation matrix."""


def read_scene(path: str | Path) -> Scene:
    """The scene of a ``scene.toml``, the files of its meshes included; lengths mm.

    Its name is the file's stem unless the file says one. Meshes lie in the folder of the file
    or below it.

    Raises
    ------
    FormatError
        Not TOML, a key missing, unknown or of the wrong type, a value that makes no scene, poses
        of several objects, or a mesh that cannot be used.
    MissingExtraError
        There is a mesh, and trimesh is not installed.
    """
    path = Path(path)
    return _build(_parse(read_toml(path), path), path)


def write_scene(path: str | Path, scene: Scene) -> None:
    """Write ``scene.toml``, atomic; it reads back as it is, rotations to 1e-13 rad.

    Meshes are written beside it first: that of the second object of ``scene.toml`` as
    ``scene_2.ply``.

    Raises
    ------
    UsageError
        A scene that `read_scene` would refuse.
    FormatError
        A file cannot be written.
    """
    from fringeworks.twin.check import check_scene

    path = Path(path)
    check_scene(scene)
    text = lay_out_toml(_describe(scene, path), lambda again: _parse(again, path), what="scene")
    for number, mesh in _meshes(scene):
        write_mesh(path.with_name(_mesh_name(path, number)), mesh)
    write_text(path, text)


def files_read(path: str | Path) -> list[Path]:
    """``scene.toml`` and the files of its meshes; fails as `read_scene` does on its text."""
    path = Path(path)
    items = _parse(read_toml(path), path).object
    return [path, *(_mesh_path(item, path.parent) for item in items if isinstance(item, MeshTable))]


def files_written(path: str | Path, scene: Scene) -> list[Path]:
    """What `write_scene` writes: ``scene.toml`` and a file for each mesh."""
    path = Path(path)
    return [path, *(path.with_name(_mesh_name(path, number)) for number, _ in _meshes(scene))]


def _meshes(scene: Scene) -> list[tuple[int, Mesh]]:
    """The meshes of a scene with their objects' numbers, from 1."""
    shapes = enumerate((item.shape for item in scene.objects), start=1)
    return [(number, shape) for number, shape in shapes if isinstance(shape, Mesh)]


def _mesh_path(item: MeshTable, folder: Path) -> Path:
    return locate_inside(folder, item.file, what="mesh", whose="scene")


def _parse(document: dict[str, Any], path: Path) -> SceneFile:
    check_format(document, SCENE_FORMAT, path)
    file = validated(SceneFile, document, path)
    _check_posed(file, path)
    return file


def _build(file: SceneFile, path: Path) -> Scene:
    from fringeworks.twin.check import check_scene  # brings numba

    scene = Scene(
        name=file.name or path.stem,
        objects=tuple(_object(item, path.parent) for item in file.object),
        posed=file.pose[0].object if file.pose else None,
        poses=tuple(item.pose() for item in file.pose),
    )
    with refusing(path):
        check_scene(scene)
    return scene


def _object(item: AnyObject, folder: Path) -> Object:
    return make_noun(
        Object,
        item,
        shape=_shape(item, folder),
        camera_from_object=item.pose(),
        material=make_noun(Material, item),
    )


def _shape(item: AnyObject, folder: Path) -> Shape:
    if not isinstance(item, MeshTable):
        return item.noun()
    return read_mesh(_mesh_path(item, folder), scale=item.scale)


def _check_posed(file: SceneFile, path: Path) -> None:
    known = [item.name for item in file.object]
    for number, item in enumerate(file.pose, start=1):
        start = f"{path}: pose {number}: object must be"
        if item.object not in known:
            near = suggest(item.object, known)
            raise FormatError(f"{start} the name of one, got {shorten(item.object)}{near}")
        if item.object != file.pose[0].object:
            raise FormatError(
                f"{start} {shorten(file.pose[0].object)} as in pose 1, got "
                f"{shorten(item.object)}; write a scene file for each object that is posed"
            )


def _describe(scene: Scene, path: Path) -> dict[str, Any]:
    objects = (
        _describe_object(item, mesh=_mesh_name(path, number))
        for number, item in enumerate(scene.objects, start=1)
    )
    document = {"format": SCENE_FORMAT, "name": scene.name, "object": list(objects)}
    if scene.poses:
        document["pose"] = [{"object": scene.posed, **_describe_pose(pose)} for pose in scene.poses]
    return document


def _mesh_name(path: Path, number: int) -> str:
    return f"{path.stem}_{number}.ply"


def _describe_object(item: Object, *, mesh: str) -> dict[str, Any]:
    table = {
        "name": item.name,
        **_describe_shape(item.shape, mesh=mesh),
        **_describe_pose(item.camera_from_object),
        **describe_noun(item.material),
    }
    return {**table, "velocity_mm_s": list(item.velocity_mm_s)} if item.moves else table


def _describe_shape(shape: Shape, *, mesh: str) -> dict[str, Any]:
    match shape:
        case Mesh():
            return {"shape": "mesh", "file": mesh}
        case Board():
            keys = describe_noun(shape)
            return {"shape": keys.pop("kind"), **keys}
        case Blend():
            ends = [_describe_capsule(capsule) for capsule in shape.capsules]
            return {"shape": "blend", "smooth_mm": shape.smooth_mm, "capsules": _lines(ends)}
        case _:
            return {"shape": SHAPES[type(shape)], **describe_noun(shape)}


def _describe_capsule(capsule: Capsule) -> list[float]:
    start, end = capsule.start_mm, capsule.end_mm
    return [*start, capsule.start_radius_mm, *end, capsule.end_radius_mm]


def _lines(rows: Iterable[list[float]]) -> tomlkit.items.Array:
    """A list of lists with one of them a line."""
    array = tomlkit.array()
    array.extend(rows)
    return array.multiline(multiline=True)


def _describe_pose(pose: Pose) -> dict[str, Any]:
    place = {"position_mm": (pose.translation_mm + 0.0).tolist()}
    turn = np.round(np.degrees(rotation_vector(pose.rotation)), ANGLE_DIGITS)
    return {**place, "rotation_deg": turn.tolist()} if turn.any() else place
