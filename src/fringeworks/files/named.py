"""Scenes and rigs by name or by file: what a command line or another file may say."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from fringeworks.files.rig import read_rig
from fringeworks.files.scene import files_read, read_scene
from fringeworks.model import Rig
from fringeworks.twin.scene import Scene
from fringeworks.twin.scenes import named_rig, named_scene

Named = TypeVar("Named")


def find_scene(name: str, *, beside: Path | None = None) -> Scene:
    """The scene of this name, or of a ``.toml`` file, relative to `beside`.

    Raises
    ------
    UsageError
        No scene has this name.
    FormatError
        The file cannot be read.
    """
    return _find(name, beside, suffix=".toml", read=read_scene, named=named_scene)


def find_rig(name: str, *, beside: Path | None = None) -> Rig:
    """The rig of this name, or of a ``.json`` file, relative to `beside`; fails as `find_scene`."""
    return _find(name, beside, suffix=".json", read=read_rig, named=named_rig)


def files_of(name: str, *, beside: Path | None = None) -> list[Path]:
    """The files that the scene or rig of this name is read from, a scene's meshes too; or none."""
    path = (beside or Path()) / name
    match path.suffix.lower():
        case ".toml":
            return files_read(path)
        case ".json":
            return [path]
        case _:
            return []


def _find(
    name: str,
    beside: Path | None,
    *,
    suffix: str,
    read: Callable[[Path], Named],
    named: Callable[[str], Named],
) -> Named:
    """A name has no suffix: a file or folder that is called like a scene is not meant by it."""
    if Path(name).suffix.lower() == suffix:
        return read((beside or Path()) / name)
    return named(name)
