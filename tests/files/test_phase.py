from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import npz, read_phase, write_phase
from fringeworks.model import (
    AbsolutePhase,
    Axis,
    CodedAxis,
    Fringe,
    Noise,
    WrappedPhase,
)
from fringeworks.phase.decode import Decoding

SHAPE = (4, 5)


def ramp(start: float) -> Any:
    values = np.arange(20, dtype=np.float32).reshape(SHAPE) + np.float32(start)
    values[0, 0] = np.nan
    return values


def coded(axis: Axis, *, fringes: bool) -> CodedAxis:
    start = 100.0 if axis == "x" else 500.0
    order = np.arange(20, dtype=np.int32).reshape(SHAPE) - 1
    wrapped = WrappedPhase(
        Fringe(axis, 32.0, (0.0, 2.0, 4.0)),
        phase=ramp(start),
        offset=ramp(start + 1),
        modulation=ramp(start + 2),
        residual=ramp(start + 3),
        sigma=ramp(start + 4),
        noise=Noise(1.0, 0.0, 0.0, "camera"),
        void=np.zeros(SHAPE, np.uint8),
    )
    return CodedAxis(
        axis=axis,
        coordinate=ramp(start + 10),
        sigma=ramp(start + 11),
        offset=ramp(start + 12),
        modulation=ramp(start + 13),
        phase=AbsolutePhase(wrapped, order, ramp(start + 14)) if fringes else None,
        void=np.zeros(SHAPE, np.uint8),
        route=("by hand",),
    )


def test_both_axes(tmp_path: Path) -> None:
    column, row = coded("x", fringes=True), coded("y", fringes=True)
    write_phase(tmp_path / "phase.npz", Decoding((column, row), ()))
    maps = read_phase(tmp_path / "phase.npz")
    assert column.phase is not None
    expected = {
        "column": column.coordinate,
        "row": row.coordinate,
        "sigma_px_x": column.sigma,
        "sigma_px_y": row.sigma,
        "modulation_x": column.modulation,
        "modulation_y": row.modulation,
        "offset": column.offset,
        "wrapped_x": column.phase.wrapped.phase,
        "order_x": column.phase.order,
        "margin_x": column.phase.margin,
    }
    for name, array in expected.items():
        np.testing.assert_array_equal(maps[name], array)
    assert set(maps) - set(expected) == {"wrapped_y", "order_y", "margin_y"}
    assert maps["order_x"].dtype == np.int32
    assert maps["order_x"][0, 0] == -1


def test_a_gray_code_alone_has_no_phase(tmp_path: Path) -> None:
    row = coded("y", fringes=False)
    write_phase(tmp_path / "phase.npz", Decoding((row,), ()))
    maps = read_phase(tmp_path / "phase.npz")
    assert set(maps) == {"row", "sigma_px_y", "modulation_y", "offset"}
    np.testing.assert_array_equal(maps["offset"], row.offset)


def test_suffix(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"written as \.npz, got 'phase\.mat'"):
        write_phase(tmp_path / "phase.mat", Decoding((coded("x", fringes=False),), ()))


def save(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def test_what_is_no_phase(tmp_path: Path) -> None:
    path = tmp_path / "phase.npz"
    with pytest.raises(FormatError, match=r"phase\.npz: no such file"):
        read_phase(path)
    path.write_bytes(b"not a zip")
    with pytest.raises(FormatError, match=r"not a readable \.npz archive \(File is not a zip"):
        read_phase(path)
    with pytest.raises(FormatError, match=r"holds neither column nor row; is it a file of"):
        read_phase(save(path, depth=np.zeros(SHAPE)))
    with pytest.raises(FormatError, match=r"offset must be a map of shape \(4, 5\), got \(3,\)"):
        read_phase(save(path, column=np.zeros(SHAPE), offset=np.zeros(3)))
    with pytest.raises(FormatError, match=r"column must be \(H, W\), got shape \(3,\)"):
        read_phase(save(path, column=np.zeros(3)))


def test_nothing_in_an_archive_is_executed(tmp_path: Path) -> None:
    path = save(tmp_path / "phase.npz", column=np.array([[{}]], dtype=object))
    with pytest.raises(FormatError, match=r"'column\.npy' is not an array of numbers"):
        read_phase(path)


def test_a_header_that_promises_too_much_is_not_believed(tmp_path: Path) -> None:
    """Half a terabyte would be allocated before the data turn out to be missing."""
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (65536, 1048576), }"
    header = header.ljust(117) + b"\n"
    path = tmp_path / "phase.npz"
    with zipfile.ZipFile(path, "w") as archive:
        magic = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little")
        archive.writestr("column.npy", magic + header + bytes(80))
    with pytest.raises(FormatError, match=r"'column\.npy' is not an array of numbers of its leng"):
        read_phase(path)


def test_an_archive_larger_than_the_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(npz, "MAX_ARCHIVE_BYTES", 100)
    with pytest.raises(FormatError, match="GiB of arrays are more than is read"):
        read_phase(save(tmp_path / "phase.npz", column=np.zeros(SHAPE)))


def test_a_member_larger_than_the_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(npz, "MAX_ARRAY_BYTES", 100)
    with pytest.raises(FormatError, match=r"'column\.npy' must be at most .* GiB, got 0\.0 GiB"):
        read_phase(save(tmp_path / "phase.npz", column=np.zeros(SHAPE)))


def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "phase.npz"
    np.savez_compressed(path, column=np.zeros((400, 400)))
    with pytest.raises(
        FormatError, match=r"'column\.npy' must be packed at most 100 times, got 12"
    ):
        read_phase(path)


def test_only_what_is_asked_for_is_read(tmp_path: Path) -> None:
    path = save(tmp_path / "phase.npz", column=np.zeros(SHAPE), other=np.array([{}], dtype=object))
    assert set(read_phase(path)) == {"column"}


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_spoilt_archives_are_refused_or_read(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "phase.npz"
    write_phase(path, Decoding((coded("x", fringes=False),), ()))
    spoilt = bytearray(path.read_bytes())
    if data.draw(st.booleans()):
        del spoilt[data.draw(st.integers(0, len(spoilt) - 1)) :]
    else:
        for _ in range(data.draw(st.integers(1, 4))):
            spoilt[data.draw(st.integers(0, len(spoilt) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(spoilt)
    try:
        read_phase(path)
    except FormatError as error:
        message = str(error)
    else:
        return
    assert "phase.npz" in message
