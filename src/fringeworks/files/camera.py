"""The ``[camera]`` table of a capture that is there already: what was measured is put into it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import tomlkit

from fringeworks.files.atomic import write_text
from fringeworks.files.capture import find_description, parse_capture
from fringeworks.files.toml import lay_out_toml
from fringeworks.files.validation import read_text, read_toml


def write_camera(folder_or_toml: str | Path, figures: Mapping[str, float]) -> Path:
    """Put keys of ``[camera]`` into a ``capture.toml``; comments and all other keys stay.

    Returns the path of the file, which is replaced whole or not at all.

    Raises
    ------
    FormatError
        There is no capture, it is a bad one, or it cannot be written.
    UsageError
        A figure that `read_capture` would refuse.
    """
    path = find_description(Path(folder_or_toml))
    parse_capture(read_toml(path), path)
    document = tomlkit.parse(read_text(path))
    table = document.setdefault("camera", tomlkit.table())
    for key, value in figures.items():
        table[key] = value
    text = lay_out_toml(document, lambda again: parse_capture(again, path), what="capture")
    write_text(path, text)
    return path


def lay_out_camera(figures: Mapping[str, float]) -> str:
    """The table as text, to be pasted."""
    return "\n".join(["[camera]", *(f"{key} = {value}" for key, value in figures.items())])
