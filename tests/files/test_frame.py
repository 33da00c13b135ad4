"""``frame.json`` and ``targets.toml``: what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.frame import read_frame, write_frame
from fringeworks.files.targets import read_targets
from fringeworks.model import Pose
from fringeworks.model.frame import Frame

UNIT = np.eye(3).tolist()
GOOD: dict[str, Any] = {
    "format": "fringeworks-frame/1",
    "name": "table",
    "frame_from_camera": {"rotation": UNIT, "translation_mm": [1, 2, 3]},
}


def pose(rotation: object, shift: object) -> dict[str, Any]:
    return {"frame_from_camera": {"rotation": rotation, "translation_mm": shift}}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "camera"}, "must not be called 'camera'"),
        ({"name": ""}, "must be 1 to 100 printable characters"),
        ({"name": "a\nb"}, "must be 1 to 100 printable characters"),
        ({"name": "\ud800"}, "must be 1 to 100 printable characters"),
        ({"name": "x" * 101}, "must be 1 to 100 printable characters"),
        (pose(UNIT, [1e300, 0, 0]), "must be a rotation and a translation"),
        (pose([[1e300] * 3] * 3, [0, 0, 0]), "must be a rotation and a translation"),
    ],
)
def test_what_is_no_frame(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    path = tmp_path / "frame.json"
    path.write_text(json.dumps(GOOD))
    assert read_frame(path).name == "table"
    path.write_text(json.dumps({**GOOD, **change}))
    with pytest.raises(FormatError, match=rf"frame\.json: .*{message}"):
        read_frame(path)


def test_a_key_stands_once(tmp_path: Path) -> None:
    path = tmp_path / "frame.json"
    path.write_text(json.dumps(GOOD)[:-1] + ', "name": "other"}')
    with pytest.raises(FormatError, match="the key 'name' stands twice in one object"):
        read_frame(path)


def test_the_camera_keeps_its_name(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="must not be called 'camera'"):
        write_frame(tmp_path / "frame.json", Frame("camera", Pose.identity()))
    with pytest.raises(UsageError, match="printable"):
        Frame("", Pose.identity())


VIEW = '[[view]]\ncloud = "{}"\ntargets = {{ a = [0.0, 0.0, 0.0] }}\n'
HEAD = 'format = "fringeworks-targets/1"\n'


def test_targets_of_one_view_stand_once(tmp_path: Path) -> None:
    path = tmp_path / "targets.toml"
    path.write_text(HEAD + VIEW.format("a.npz") + VIEW.format("a.npz"))
    with pytest.raises(FormatError, match=r"two \[\[view\]\]s are called 'a\.npz'"):
        read_targets(path, [Path("a.npz")])
    path.write_text(HEAD + VIEW.format("a.npz"))
    with pytest.raises(FormatError, match=r"two of the clouds to merge are called 'a\.npz'"):
        read_targets(path, [Path("one/a.npz"), Path("two/a.npz")])
