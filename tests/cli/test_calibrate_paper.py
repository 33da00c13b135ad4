"""``calibrate --model paper``: what is said, written and drawn."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.files import read_image, write_board, write_capture
from fringeworks.twin.scenes import BOARD, target_of
from tests.calibrate.projected_views import paper_captures, without
from tests.cli.scenes import plain, run


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three captures with a projected checkerboard, board.toml beside them."""
    folder = tmp_path_factory.mktemp("paper")
    write_board(folder / "board.toml", target_of(BOARD))
    for capture in paper_captures(3):
        write_capture(capture, folder / "poses" / capture.name)
    return folder


@pytest.fixture(scope="module")
def arguments(poses: Path) -> list[Path | str]:
    board, out = poses / "board.toml", poses / "rig.json"
    return ["calibrate", poses / "poses", "--board", board, "--out", out, "--model", "paper"]


def test_it_says_what_the_paper_says(arguments: list[Path | str]) -> None:
    done = run(*arguments)
    assert done.exit_code == 0, done.stderr
    said = plain(done.stdout)
    assert "model: paper" in said
    assert "264 of 264 printed corners within 0.25 px" in said
    assert "the paper's: 0.0987 0.0905 px" in said
    assert "the paper's: 0.7706 0.4851 px" in said


def test_the_model_is_in_the_file_and_in_json(arguments: list[Path | str], poses: Path) -> None:
    said = json.loads(run(*arguments, "--json").stdout)
    kept = json.loads((poses / "rig.json").read_text(encoding="utf-8"))["calibration"]
    assert said["model"] == kept["model"] == "paper"
    assert said["paper"] == kept["paper"]
    assert [view["name"] for view in said["views"]] == ["pose_01", "pose_03", "pose_05"]
    corners = [view["kept"] for view in said["views"]]
    assert sum(corners) == said["paper"]["printed_kept"] + said["paper"]["projected_kept"]


@pytest.mark.parametrize(("mode", "points"), [("map", 10000), ("paper", 264)])
def test_the_ten_are_fitted_to_the_boards(
    arguments: list[Path | str], tmp_path: Path, mode: str, points: int
) -> None:
    """By all bright pixels, or by the 264 printed corners; these captures have one fringe."""
    out = tmp_path / "rig.json"
    changed = [out if str(part).endswith("rig.json") else part for part in arguments]
    done = run(*changed, "--extended", mode)
    assert done.exit_code == 0, done.stderr
    assert f"extended model, fitted by {mode}" in done.stdout
    assert "no plane tells Ku0 by itself" in done.stdout
    said = json.loads(run(*changed, "--extended", mode, "--json").stdout)["extended"]
    kept = json.loads(out.read_text(encoding="utf-8"))["extended"]
    assert kept == {"axis": "x", "period_px": 638.4, **said["parameters"]}
    assert said["points"] == points if mode == "paper" else said["points"] > points
    assert said["planes"] == 3
    assert said["rms_mm"] < said["rms_before_mm"]


def test_figure_5_is_drawn(arguments: list[Path | str], tmp_path: Path) -> None:
    """Points of both devices' scatter, in colour on white; the same three boards in space."""
    done = run(*arguments, "--figures", tmp_path / "figures", "--report", tmp_path / "page.html")
    assert done.exit_code == 0, done.stderr
    names = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert names == ["boards.png", "coverage.png", "residuals.png", "views.png"]
    image = read_image(tmp_path / "figures" / "residuals.png")
    left, right = np.array_split(image, 2, axis=1)
    assert coloured(left) > 264
    assert coloured(right) > 50
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "3 views of a board and a projected checkerboard, as the paper does" in page
    assert "--model joint has them" in page
    assert "leave some parameter open" not in page
    assert "whether halves of the views agree" not in page


def test_a_pitch_in_inches_is_a_finding(arguments: list[Path | str], tmp_path: Path) -> None:
    inches = replace(target_of(BOARD), pitch_x_mm=13 / 25.4, pitch_y_mm=13 / 25.4)
    write_board(tmp_path / "board.toml", inches)
    done = run(*arguments, "--board", tmp_path / "board.toml", "--out", tmp_path / "rig.json")
    assert done.exit_code == 0, done.stderr
    assert "were it in inches" in plain(done.stderr)


def test_captures_of_one_name_are_told_apart(arguments: list[Path | str], tmp_path: Path) -> None:
    for place, capture in zip("abc", paper_captures(3), strict=True):
        write_capture(capture, tmp_path / place / "pose")
    folders = [tmp_path / "a" / "pose", tmp_path / "b" / "pose" / "capture.toml"]
    folders.append(tmp_path / "c" / "pose")
    done = run("calibrate", *folders, *arguments[2:], "--out", tmp_path / "rig.json", "--json")
    names = [view["name"] for view in json.loads(done.stdout)["views"]]
    assert names == ["a/pose", "b/pose", "c/pose"]


def coloured(image: NDArray[np.generic]) -> int:
    """Pixels that are not grey."""
    return int(np.count_nonzero(np.ptp(image[..., :3].astype(int), axis=-1) > 40))


def test_without_a_projected_checkerboard(poses: Path, tmp_path: Path) -> None:
    for capture in paper_captures(3):
        write_capture(without(capture, keep=(0, 1, 3, 4)), tmp_path / "plain" / capture.name)
    done = run(
        "calibrate", tmp_path / "plain", "--board", poses / "board.toml",
        "--out", tmp_path / "rig.json", "--model", "paper",
    )  # fmt: skip
    assert done.exit_code == 1
    said = plain(done.stderr)
    assert "no projected checkerboard" in said
    assert "fringeworks patterns paper-calibrate" in said
    assert not (tmp_path / "rig.json").exists()


def test_a_shape_of_the_board_is_not_for_it(arguments: list[Path | str]) -> None:
    done = run(*arguments, "--board-shape", "paraboloid")
    assert done.exit_code == 2
    assert "--board-shape must be flat with --model paper" in done.stderr
