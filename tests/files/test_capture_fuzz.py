"""No description, however spoilt, gives anything but a capture or a clear refusal."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest
import tomlkit
from hypothesis import given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_capture
from fringeworks.model import Capture
from tests.files.folders import Document, document, make_capture


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


NUMBERS = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.integers(-3, 70000),
    st.floats(),
    st.sampled_from([0.5, 1.5, 1e-9, 1e308, -0.0, 7.0, 65536, 2.0000001]),
)
NAMES = st.sampled_from(
    ["f0.png", "../f0.png", ".", "..", "/", "a/b.png", "f0.png/", "x" * 300, "gray", "x", "y", "a"]
)
VALUES = st.recursive(
    NUMBERS | st.booleans() | NAMES | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)


def _spots(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all keys and items of a description."""
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    found = []
    for key, item in inner:
        found.append((*path, key))
        if isinstance(item, dict | list):
            found += _spots(item, (*path, key))
    return found


SPOTS = _spots(_full())
KEYS = sorted({str(spot[-1]) for spot in SPOTS if isinstance(spot[-1], str)})


@settings(max_examples=250)
@given(data=st.data())
def test_values_changed_added_and_taken_away(folder: Path, data: st.DataObject) -> None:
    description = copy.deepcopy(_full())
    for _ in range(data.draw(st.integers(1, 3))):
        _edit(description, data)
    try:
        text = tomlkit.dumps(description)
    except (TypeError, ValueError):  # what TOML itself cannot hold
        return
    (folder / "capture.toml").write_bytes(text.encode(errors="replace"))
    read_or_refuse(folder, data.draw(st.sampled_from([None, "a"])))


def _edit(description: Document, data: st.DataObject) -> None:
    *way, last = data.draw(st.sampled_from(SPOTS))
    holder: Any = description
    try:
        for key in way:
            holder = holder[key]
        action = data.draw(st.sampled_from(["change", "take", "add"]))
        if action == "take":
            del holder[last]
        elif action == "add" and isinstance(holder, dict):
            holder[data.draw(st.sampled_from(KEYS) | st.text(max_size=6))] = data.draw(VALUES)
        else:
            holder[last] = data.draw(VALUES)
    except (KeyError, IndexError, TypeError):  # an earlier edit took it away
        return


@settings(max_examples=250)
@given(data=st.data())
def test_bytes_changed(folder: Path, data: st.DataObject) -> None:
    text = bytearray(tomlkit.dumps(_full()).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text) - 1))
        length = data.draw(st.integers(0, 9))
        text[start : start + length] = data.draw(st.binary(max_size=6))
        if not text:
            break
    (folder / "capture.toml").write_bytes(text)
    read_or_refuse(folder)
