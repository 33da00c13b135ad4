from __future__ import annotations

import json
from pathlib import Path

import numba
import pytest

from fringeworks.cli.compiling import MESSAGE, announced_compiling
from fringeworks.cli.output import Output, percent, print_note, progress_bars, to_json


def test_json_has_no_nan() -> None:
    values = {"a": float("nan"), "b": [1.5, float("inf")], "c": (Path("x") / "y", None, True, 2)}
    assert to_json(values) == {"a": None, "b": [1.5, None], "c": ["x/y", None, True, 2]}


def test_with_json_only_the_object_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output(as_json=True)
    output.line("for a reader")
    output.table(("a", "b"), [("1", "2")])
    output.facts([("a", "b")])
    output.written([Path("x")])
    output.result({"value": float("nan")})
    assert json.loads(capsys.readouterr().out) == {"value": None}


def test_a_table_aligns_numbers_to_the_right(capsys: pytest.CaptureFixture[str]) -> None:
    Output().table(("name", "px"), [("a", "1.5"), ("longer", "22.5")], numbers=(1,))
    assert capsys.readouterr().out.splitlines() == [
        "  name      px",
        "  a        1.5",
        "  longer  22.5",
    ]


def test_a_share_that_is_not_zero_does_not_read_so() -> None:
    assert [percent(share) for share in (0, 1, 0.5004, 0.0005, 3e-6)] == [
        "0.0%",
        "100.0%",
        "50.0%",
        "0.1%",
        "0.0003%",
    ]


def test_compiling_is_announced_once(capsys: pytest.CaptureFixture[str]) -> None:
    first, second = numba.njit(lambda x: x + 1), numba.njit(lambda x: x + 2)
    with announced_compiling(print_note):
        assert (first(1), second(1)) == (2, 3)
    assert capsys.readouterr().err == MESSAGE + "\n"
    with announced_compiling(print_note):
        assert (first(1), second(1)) == (2, 3)
    assert capsys.readouterr().err == ""


def test_no_bar_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bars() as progress:
        assert list(progress([1, 2], "counting")) == [1, 2]
    captured = capsys.readouterr()
    assert captured.out + captured.err == ""
