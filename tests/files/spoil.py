"""Descriptions spoilt at random: values changed, added, taken away; bytes replaced."""

from __future__ import annotations

import copy
from typing import Any

import tomlkit
from hypothesis import strategies as st

Document = dict[str, Any]

NUMBERS = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.integers(-3, 70000),
    st.floats(),
    st.sampled_from([0.5, 1.5, 1e-9, 1e308, -0.0, 7.0, 65536, 2.0000001]),
)


def values(names: list[str]) -> st.SearchStrategy[Any]:
    """Anything that TOML may hold, these names among it."""
    return st.recursive(
        NUMBERS | st.booleans() | st.sampled_from(names) | st.text(max_size=8),
        lambda inner: (
            st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
        ),
        max_leaves=6,
    )


def spoil(whole: Document, names: list[str], data: st.DataObject) -> bytes | None:
    """A description with one to three changes, as TOML; None where TOML cannot hold it."""
    spots = find_spots(whole)
    description = copy.deepcopy(whole)
    for _ in range(data.draw(st.integers(1, 3))):
        _edit(description, spots, values(names), data)
    try:
        return tomlkit.dumps(description).encode(errors="replace")
    except (TypeError, ValueError):
        return None


def find_spots(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all keys and items of a description."""
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    found = []
    for key, item in inner:
        found.append((*path, key))
        if isinstance(item, dict | list):
            found += find_spots(item, (*path, key))
    return found


def _edit(
    description: Document,
    spots: list[tuple[Any, ...]],
    anything: st.SearchStrategy[Any],
    data: st.DataObject,
) -> None:
    keys = sorted({str(spot[-1]) for spot in spots if isinstance(spot[-1], str)})
    *way, last = data.draw(st.sampled_from(spots))
    holder: Any = description
    try:
        for key in way:
            holder = holder[key]
        action = data.draw(st.sampled_from(["change", "take", "add"]))
        if action == "take":
            del holder[last]
        elif action == "add" and isinstance(holder, dict):
            holder[data.draw(st.sampled_from(keys) | st.text(max_size=6))] = data.draw(anything)
        else:
            holder[last] = data.draw(anything)
    except (KeyError, IndexError, TypeError):  # an earlier edit took it away
        return


def spoil_bytes(whole: Document, data: st.DataObject) -> bytes:
    """The TOML of a description with one to four stretches of bytes replaced."""
    text = bytearray(tomlkit.dumps(whole).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text) - 1))
        length = data.draw(st.integers(0, 9))
        text[start : start + length] = data.draw(st.binary(max_size=6))
        if not text:
            break
    return bytes(text)
