from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fringeworks.errors import FormatError, UsageError
from fringeworks.files import read_board, write_board
from fringeworks.model import CheckerboardTarget

GOOD = 'kind = "checkerboard"\ncolumns = 11\nrows = 8\n'


def board(folder: Path, text: str) -> CheckerboardTarget:
    (folder / "board.toml").write_text(text, encoding="utf-8")
    return read_board(folder / "board.toml")


def test_square_is_both_pitches(tmp_path: Path) -> None:
    assert board(tmp_path, GOOD + "square_mm = 13") == CheckerboardTarget(11, 8, 13.0, 13.0)


def test_every_key(tmp_path: Path) -> None:
    text = GOOD + (
        "pitch_x_mm = 13.01\npitch_y_mm = 12.99\npitch_sigma_mm = 0.002\n"
        "cte_per_k = 2.4e-5\ntemperature_c = 20.0\n"
    )
    expected = CheckerboardTarget(11, 8, 13.01, 12.99, 0.002, 2.4e-5, 20.0)
    assert board(tmp_path, text) == expected


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    columns=st.integers(3, 1000),
    pitches=st.tuples(st.floats(0.1, 1e4), st.floats(0.1, 1e4)),
    further=st.tuples(
        st.none() | st.floats(0, 1), st.none() | st.floats(-1e-2, 1e-2), st.none() | st.just(-5.0)
    ),
)
def test_boards_read_back(tmp_path: Path, columns: int, pitches: Any, further: Any) -> None:
    for pair in (pitches, pitches[:1] * 2):
        target = CheckerboardTarget(columns, 8, *pair, *further)
        write_board(tmp_path / "board.toml", target)
        assert read_board(tmp_path / "board.toml") == target


def test_square_boards_say_their_square(tmp_path: Path) -> None:
    write_board(tmp_path / "board.toml", CheckerboardTarget(11, 8, 13.0, 13.0))
    assert (tmp_path / "board.toml").read_text() == GOOD + "square_mm = 13.0\n"


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (CheckerboardTarget(2, 8, 13.0, 13.0), "this board could not be read back: .*columns mu"),
        (CheckerboardTarget(11, 8, 13.0, 0.0), "pitch_y_mm must be 0.1 to 10000, got 0"),
        (CheckerboardTarget(11, 8, 13.0, math.inf), "give either square_mm, or both"),
        (CheckerboardTarget(11, 8, 13.0, 13.0, math.nan), "pitch_sigma_mm must be a finite"),
    ],
)
def test_what_cannot_be_written(tmp_path: Path, target: CheckerboardTarget, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        write_board(tmp_path / "board.toml", target)
    assert list(tmp_path.iterdir()) == []


def test_the_real_board(real: Callable[[str], Path]) -> None:
    target = read_board(real("procam-graycode") / "board.toml")
    assert target == CheckerboardTarget(7, 9, 75.0, 75.0)


EITHER = "give either square_mm, or both pitch_x_mm and pitch_y_mm"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD, EITHER),
        (GOOD + "square_mm = 13.0\npitch_x_mm = 13.0\n", EITHER),
        (GOOD + "pitch_y_mm = 13.0\n", EITHER),
        (GOOD + "square_mm = 0.0", r"board\.toml: square_mm must be 0\.1 to 10000, got 0$"),
        (GOOD + "square_mm = 0.013", r"must be 0\.1 to 10000, got 0\.013; is it in metres\?"),
        (GOOD + "pitch_x_mm = 13.0\npitch_y_mm = 10001.0", "pitch_y_mm must be 0.1 to 10000"),
        (GOOD + "square_mm = inf", "square_mm must be a finite number, got inf"),
        (GOOD + "squares_mm = 13.0", "unknown key 'squares_mm', did you mean 'square_mm'"),
        (GOOD.replace("11", "2") + "square_mm = 13.0", "columns must be >= 3, got 2"),
        (GOOD.replace("11", "11.0") + "square_mm = 13.0", "columns must be a whole number"),
        ('kind = "checkerboard"\nrows = 8\nsquare_mm = 1.0', "columns is missing"),
        ('kind = "charuco"', "kind 'charuco' is planned, not supported yet; use checkerboard"),
        ('kind = "circles"', "kind 'circles' is planned"),
        ('kind = "dots"', "kind must be 'checkerboard', got 'dots'"),
        ("columns = 3", "kind is missing"),
        ("columns = ", r"not valid TOML: .*\(at"),
        ("kind = []", r"kind must be 'checkerboard', got \[\]"),
    ],
)
def test_refusals(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FormatError, match=message) as caught:
        board(tmp_path, text)
    assert str(tmp_path / "board.toml") in str(caught.value)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"none\.toml: cannot be read \(No such file"):
        read_board(tmp_path / "none.toml")
