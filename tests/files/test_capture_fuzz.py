"""No description, however spoilt, gives anything but a capture or a clear refusal."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_capture
from fringeworks.model import Capture
from tests.files.folders import Document, document, make_capture
from tests.files.spoil import spoil, spoil_bytes


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    description = _full()
    return make_capture(tmp_path_factory.mktemp("fuzz"), description)


def _full() -> Document:
    description = document()
    description["camera"] = {"full_scale": 255.0, "gain": 0.02, "read_noise": 0.8}
    description["set"][1].update(inverted=["h0.png", "h1.png"], complementary="half.png")
    description["set"].append(
        {
            "kind": "staircase",
            "axis": "y",
            "period_px": 8.0,
            "levels": 4,
            "shifts_deg": [0.0, 90.0, 180.0],
            "repeats": 1,
            "group": "a",
            "images": ["s0.png", "s1.png", "s2.png"],
        }
    )
    return description


def read_or_refuse(folder: Path, group: str | None = None) -> Capture | None:
    try:
        return read_capture(folder, group=group)
    except (FormatError, UsageError) as error:
        message = str(error)
    assert message
    return None


NAMES = ["f0.png", "../f0.png", ".", "..", "/", "a/b.png", "f0.png/", "x" * 300]
NAMES += ["gray", "x", "y", "a"]


@settings(max_examples=250)
@given(data=st.data())
def test_values_changed_added_and_taken_away(folder: Path, data: st.DataObject) -> None:
    text = spoil(_full(), NAMES, data)
    if text is None:
        return
    (folder / "capture.toml").write_bytes(text)
    read_or_refuse(folder, data.draw(st.sampled_from([None, "a"])))


@settings(max_examples=250)
@given(data=st.data())
def test_bytes_changed(folder: Path, data: st.DataObject) -> None:
    (folder / "capture.toml").write_bytes(spoil_bytes(_full(), data))
    read_or_refuse(folder)
