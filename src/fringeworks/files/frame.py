"""Read and write ``frame.json``: a named frame and its place before the camera."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fringeworks.errors import UsageError
from fringeworks.files.atomic import write_text
from fringeworks.files.poses import pose_matrix, pose_of_matrix
from fringeworks.files.rig import write_rig
from fringeworks.files.rig_schema import PoseTable
from fringeworks.files.validation import Table, check_format, read_json, refusing, validated
from fringeworks.model import Pose, Rig
from fringeworks.model.frame import CAMERA_FRAME, Frame

FRAME_FORMAT = "fringeworks-frame/1"
STATION_KEY = "station_from_camera"


class FrameFile(Table):
    """The whole ``frame.json``."""

    format: str
    name: str
    frame_from_camera: PoseTable


def write_frame(path: str | Path, frame: Frame) -> None:
    """Write ``frame.json``, atomic.

    Raises
    ------
    UsageError
        The frame is called as the camera's own.
    FormatError
        The file cannot be written.
    """
    _check_own(frame)
    document = {
        "format": FRAME_FORMAT,
        "name": frame.name,
        "frame_from_camera": describe_pose(frame.frame_from_camera),
    }
    write_text(Path(path), json.dumps(document, indent=1) + "\n")


def read_frame(path: str | Path) -> Frame:
    """The frame of a ``frame.json``.

    Raises
    ------
    FormatError
        Not JSON, a key missing or unknown, a rotation that is none, a name that is none or the
        camera's own.
    """
    path = Path(path)
    document = read_json(path)
    check_format(document, FRAME_FORMAT, path)
    file = validated(FrameFile, document, path)
    pose = _pose(file.frame_from_camera, f"{path}: frame_from_camera")
    with refusing(path):
        frame = Frame(file.name, pose)
        _check_own(frame)
    return frame


def _check_own(frame: Frame) -> None:
    if frame.name == CAMERA_FRAME:
        raise UsageError(f"a frame of its own must not be called '{CAMERA_FRAME}'")


def station_of(rig: Rig, path: Path) -> Frame:
    """The frame "station" of a rig's `station_from_camera`; `path` is for messages.

    Raises
    ------
    UsageError
        The rig has none.
    FormatError
        It is not a pose.
    """
    if rig.further.get(STATION_KEY) is None:
        raise UsageError(
            f"{path} has no {STATION_KEY}: `fringeworks frame board` or `datum` with --keep "
            "writes one"
        )
    table = validated(PoseTable, rig.further[STATION_KEY], path)
    return Frame("station", _pose(table, f"{path}: {STATION_KEY}"))


def keep_station(path: Path, rig: Rig, frame: Frame) -> None:
    """Write a rig again with a frame as its `station_from_camera`; fails as `write_rig`."""
    pose = describe_pose(frame.frame_from_camera)
    write_rig(path, replace(rig, further={**rig.further, STATION_KEY: pose}))


def describe_pose(pose: Pose) -> dict[str, Any]:
    """A pose as tables have it."""
    return {
        "rotation": pose.rotation.tolist(),
        "translation_mm": pose.translation_mm.tolist(),
    }


def _pose(table: PoseTable, name: str) -> Pose:
    claimed = Pose(np.array(table.rotation, float), np.array(table.translation_mm, float))
    return pose_of_matrix(pose_matrix(claimed), name=name)
