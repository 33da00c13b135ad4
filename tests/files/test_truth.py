from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_truth, write_truth
from fringeworks.twin.truth import Truth

SHAPE = (4, 5)


def truth() -> Truth:
    rng = np.random.default_rng(5)
    surface = rng.integers(-1, 2, SHAPE).astype(np.int16)
    xyz = np.where(surface[..., None] < 0, np.nan, rng.normal(size=(*SHAPE, 3)))
    column, row = (np.where(surface < 1, np.nan, rng.normal(size=SHAPE)) for _ in range(2))
    return Truth(xyz, column, row, surface, names=("wall", "Zylinder, groß"))


def assert_same(one: Truth, other: Truth) -> None:
    assert one.names == other.names
    for item in fields(Truth):
        if item.name != "names":
            array, again = getattr(one, item.name), getattr(other, item.name)
            np.testing.assert_array_equal(array, again)
            assert array.dtype == again.dtype


def test_round_trip(tmp_path: Path) -> None:
    write_truth(tmp_path / "a" / "truth.npz", truth())
    assert_same(truth(), read_truth(tmp_path / "a" / "truth.npz"))


def test_nothing_in_view(tmp_path: Path) -> None:
    void = np.full(SHAPE, np.nan)
    nothing = Truth(np.full((*SHAPE, 3), np.nan), void, void, np.full(SHAPE, -1, np.int16), ())
    write_truth(tmp_path / "truth.npz", nothing)
    assert_same(nothing, read_truth(tmp_path / "truth.npz"))


def test_suffix(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"truths are written as \.npz, got 'truth\.mat'"):
        write_truth(tmp_path / "truth.mat", truth())


def save(path: Path, **changes: Any) -> Path:
    write_truth(path, truth())
    with np.load(path) as archive:
        arrays = {**archive, **changes}
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    return path


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"row": None, "names": None}, "holds no row, names; is it a truth of the twin"),
        ({"column": np.zeros(3)}, r"column must be \(H, W\), got shape \(3,\)"),
        ({"column": np.zeros((0, 5))}, r"column must be \(H, W\), got shape \(0, 5\)"),
        ({"row": np.zeros((5, 4))}, r"row must be float64 of \(4, 5\), got float64 of \(5, 4\)"),
        ({"row": np.zeros(SHAPE, int)}, r"row must be float64 of \(4, 5\), got int64 of \(4, 5\)"),
        ({"xyz": np.zeros(SHAPE)}, r"xyz must be float64 of \(4, 5, 3\), got float64 of \(4, 5\)"),
        ({"surface": np.zeros(SHAPE)}, r"surface must be int16 of \(4, 5\), got float64 of"),
        ({"surface": np.full(SHAPE, 2, np.int16)}, r"-1 \(none\) to 1, .* got 2 to 2"),
        ({"surface": np.full(SHAPE, -2, np.int16)}, r"-1 \(none\) to 1, .* got -2 to -2"),
        ({"names": np.array(3)}, r"names must be a list of texts, got int64 of \(\)"),
        ({"names": np.array([{}], dtype=object)}, r"'names\.npy' is not an array of numbers"),
        ({"surface": np.array([[{}]], dtype=object)}, r"'surface\.npy' is not an array of num"),
    ],
)
def test_refusals(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    path = save(tmp_path / "truth.npz", **changes)
    with pytest.raises(FormatError, match=message) as caught:
        read_truth(path)
    assert str(path) in str(caught.value)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"truth\.npz: no such file"):
        read_truth(tmp_path / "truth.npz")


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_spoilt_archives_are_refused_or_read(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "truth.npz"
    write_truth(path, replace(truth(), names=("a", "b")))
    spoilt = bytearray(path.read_bytes())
    if data.draw(st.booleans()):
        del spoilt[data.draw(st.integers(0, len(spoilt) - 1)) :]
    else:
        for _ in range(data.draw(st.integers(1, 4))):
            spoilt[data.draw(st.integers(0, len(spoilt) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(spoilt)
    try:
        read_truth(path)
    except FormatError as error:
        message = str(error)
    else:
        return
    assert "truth.npz" in message
