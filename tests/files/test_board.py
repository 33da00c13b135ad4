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
from fringeworks.model import CharucoTarget, CheckerboardTarget, CirclesTarget, Target

GOOD = 'kind = "checkerboard"\ncolumns = 11\nrows = 8\n'


def board(folder: Path, text: str) -> Target:
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
        st.none() | st.floats(0, 1e-2),
        st.none() | st.floats(-1e-2, 1e-2),
        st.none() | st.just(-5.0),
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


CHARUCO = (
    'kind = "charuco"\ncolumns = 11\nrows = 8\nmarker_mm = 9.0\ndictionary = "DICT_5X5_100"\n'
    "square_mm = 13.0\n"
)
CIRCLES = (
    'kind = "circles"\ncolumns = 7\nrows = 9\ndiameter_mm = 7.5\n'
    "pitch_x_mm = 20.1\npitch_y_mm = 20.0\n"
)


@pytest.mark.parametrize(
    ("text", "target"),
    [
        (CHARUCO, CharucoTarget(11, 8, 13.0, 13.0, 9.0, "DICT_5X5_100")),
        (
            CIRCLES + "pitch_sigma_mm = 0.01\ncte_per_k = 1e-5\ntemperature_c = 21.0\n",
            CirclesTarget(7, 9, 20.1, 20.0, 7.5, 0.01, 1e-5, 21.0),
        ),
    ],
)
def test_other_kinds_read_back(tmp_path: Path, text: str, target: Target) -> None:
    assert board(tmp_path, text) == target
    write_board(tmp_path / "again.toml", target)
    assert read_board(tmp_path / "again.toml") == target


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
        (
            GOOD + "square_mm = 13.0\npitch_sigma_mm = 2.0",
            r"a tenth of the pitch \(13\), got 2; is",
        ),
        (GOOD + "squares_mm = 13.0", "unknown key 'squares_mm', did you mean 'square_mm'"),
        (GOOD.replace("11", "2") + "square_mm = 13.0", "columns must be >= 3, got 2"),
        (GOOD.replace("11", "11.0") + "square_mm = 13.0", "columns must be a whole number"),
        ('kind = "checkerboard"\nrows = 8\nsquare_mm = 1.0', "columns is missing"),
        (CHARUCO.replace("marker_mm = 9.0\n", ""), "marker_mm is missing"),
        (CHARUCO.replace("9.0", "13.0"), r"marker_mm must be below the pitch \(13\), got 13"),
        (CHARUCO.replace("DICT_5X5_100", "5x5"), "dictionary"),
        (CIRCLES.replace("7.5", "0.0"), "diameter_mm must be > 0, got 0"),
        (CIRCLES.replace("7.5", "21.0"), r"diameter_mm must be below the pitch \(20\), got 21"),
        (GOOD + "square_mm = 13.0\nmarker_mm = 9.0", "unknown key 'marker_mm'"),
        ('kind = "dots"', "must be one of 'checkerboard', 'charuco', 'circles', got 'dots'"),
        ('kind = "charcuo"', "got 'charcuo', did you mean 'charuco'"),
        ("columns = 3", "kind is missing"),
        ("columns = ", r"not valid TOML: .*\(at"),
        ("kind = []", r"kind must be one of .*got \[\]"),
    ],
)
def test_refusals(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FormatError, match=message) as caught:
        board(tmp_path, text)
    assert str(tmp_path / "board.toml") in str(caught.value)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"none\.toml: cannot be read \(No such file"):
        read_board(tmp_path / "none.toml")
