"""``[camera]`` put into a capture.toml that is there: all else stays as it was."""

from __future__ import annotations

from pathlib import Path

import pytest

from fringeworks.errors import FormatError, UsageError
from fringeworks.files.camera import lay_out_camera, write_camera

FIGURES = {"black_level": 6.25, "gain": 0.02125, "read_noise": 0.425}

HEAD = """\
format = "fringeworks-capture/1"  # what this is

[projector]
width = 8
height = 6
"""
SETS = """
[[set]]
kind = "uniform"
level = 1.0        # white
images = ["white.png"]
"""
TABLE = """
[camera]
# by the data sheet
full_scale = 255
gain = 0.5         # old
temperature_c = 31.5
"""


def put(folder: Path, text: str) -> str:
    path = folder / "capture.toml"
    path.write_bytes(text.encode())
    assert write_camera(folder, FIGURES) == path
    return path.read_bytes().decode()


def test_a_table_is_changed_where_it_stands(tmp_path: Path) -> None:
    text = put(tmp_path, HEAD + TABLE + SETS)
    changed = TABLE.replace("gain = 0.5 ", "gain = 0.02125 ")
    assert text.replace("black_level = 6.25\n", "").replace("read_noise = 0.425\n", "") == (
        HEAD + changed + SETS
    )
    again = tmp_path / "capture.toml"
    write_camera(again, FIGURES)
    assert again.read_text() == text


def test_a_table_is_made(tmp_path: Path) -> None:
    text = put(tmp_path, HEAD + SETS)
    assert text.startswith(HEAD + SETS)
    assert text.endswith(lay_out_camera(FIGURES) + "\n")


def test_line_ends_stay(tmp_path: Path) -> None:
    text = put(tmp_path, (HEAD + TABLE + SETS).replace("\n", "\r\n"))
    assert "gain = 0.02125         # old\r\n" in text


@pytest.mark.parametrize("text", [None, "format = 1", HEAD + "[camera]\nlens = 1\n" + SETS])
def test_no_capture_to_write_into(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "capture.toml").write_text(text)
    with pytest.raises(FormatError):
        write_camera(tmp_path, FIGURES)
    assert [path.read_text() for path in tmp_path.iterdir()] == ([] if text is None else [text])


def test_a_figure_that_cannot_be_read_again(tmp_path: Path) -> None:
    put(tmp_path, HEAD + SETS)
    before = (tmp_path / "capture.toml").read_bytes()
    with pytest.raises(UsageError, match=r"camera\.gain must be >= 0"):
        write_camera(tmp_path, {"gain": -1.0})
    assert (tmp_path / "capture.toml").read_bytes() == before
