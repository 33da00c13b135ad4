from __future__ import annotations

import json
from pathlib import Path

import pytest

from fringeworks.files import read_board
from fringeworks.model import CharucoTarget, CheckerboardTarget, CirclesTarget, Target
from tests.cli.scenes import run

SIZE = ["--columns", "11", "--rows", "8", "--square-mm", "20"]


@pytest.mark.parametrize(
    ("kind", "further", "target"),
    [
        ("checkerboard", [], CheckerboardTarget(11, 8, 20.0, 20.0)),
        ("charuco", [], CharucoTarget(11, 8, 20.0, 20.0, 14.0, "DICT_5X5_250")),
        (
            "charuco",
            ["--marker-mm", "15", "--dictionary", "DICT_4X4_100"],
            CharucoTarget(11, 8, 20.0, 20.0, 15.0, "DICT_4X4_100"),
        ),
        ("circles", ["--diameter-mm", "8"], CirclesTarget(11, 8, 20.0, 20.0, 8.0)),
    ],
)
def test_page_and_description(
    tmp_path: Path, kind: str, further: list[str], target: Target
) -> None:
    out = tmp_path / "new" / "page.pdf"
    done = run("board", kind, *SIZE, *further, "--out", str(out), "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["bars_mm"] == [200.0, 150.0 if kind != "circles" else 100.0]
    assert out.read_bytes().startswith(b"%PDF")
    assert read_board(out.with_name("board.toml")) == target


def test_a_measured_board_is_not_overwritten(tmp_path: Path) -> None:
    """Its board.toml holds what somebody measured."""
    (tmp_path / "board.toml").write_text("measured")
    command = ["board", "checkerboard", *SIZE, "--out", str(tmp_path / "page.pdf")]
    done = run(*command)
    assert done.exit_code == 2
    assert "is there already" in done.stderr
    assert (tmp_path / "board.toml").read_text() == "measured"
    assert not (tmp_path / "page.pdf").exists()
    assert run(*command, "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--paper", "a5"], "--paper must be a4, a3, letter, or WIDTHxHEIGHT in mm, got 'a5'"),
        (["--paper", "100x80"], "do not fit 100x80 (100 x 80 mm)"),
        (["--marker-mm", "10"], "--marker-mm is for charuco, not for checkerboard"),
        (["--diameter-mm", "10"], "--diameter-mm is for circles"),
        (["--out", "board.png"], "--out must end in .pdf"),
        (["--square-mm", "0.01"], "is it in metres?"),
        (["--columns", "2"], "--columns"),
    ],
)
def test_refusals(tmp_path: Path, arguments: list[str], message: str) -> None:
    command = ["board", "checkerboard", *SIZE, "--out", str(tmp_path / "page.pdf"), *arguments]
    done = run(*command)
    assert done.exit_code == 2
    assert message in done.stderr
    assert list(tmp_path.iterdir()) == []
