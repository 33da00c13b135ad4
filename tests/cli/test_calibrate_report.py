"""``calibrate --report``: a page beside the rig."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fringeworks.calibrate
from fringeworks.calibrate import CalibrationSettings, ImageSize, calibrate_rig
from fringeworks.files import read_rig, write_board, write_capture
from fringeworks.model import (
    Capture,
    CheckerboardTarget,
    PatternSet,
    Rig,
    Sensor,
    Sequence,
    Uniform,
)
from fringeworks.twin.scenes import paper_rig
from tests.calibrate.synthetic import BOARD, board_poses, rig_state, views_of
from tests.cli.scenes import plain, run


@pytest.fixture
def arguments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path | str]:
    """A calibration whose captures are none: their views are made up."""
    truth = rig_state(board_poses(6, rng=np.random.default_rng(4)))
    views = views_of(truth, sigma=0.03, rng=np.random.default_rng(5))

    def calibrate_captures(
        captures: Any, board: CheckerboardTarget, *, settings: CalibrationSettings
    ) -> Rig:
        camera, projector = ImageSize(752, 480), ImageSize(608, 684)
        return calibrate_rig(
            views, board, camera_size=camera, projector_size=projector, settings=settings
        )

    monkeypatch.setattr(fringeworks.calibrate, "calibrate_captures", calibrate_captures)
    write_board(tmp_path / "board.toml", BOARD)
    pose = tmp_path / "pose"
    pose.mkdir()
    (pose / "capture.toml").touch()
    return ["calibrate", pose, "--board", tmp_path / "board.toml", "--out", tmp_path / "rig.json"]


def test_a_page_is_written(arguments: list[Path | str], tmp_path: Path) -> None:
    done = run(*arguments, "--report", tmp_path / "report.html")
    assert done.exit_code == 0, done.stderr
    assert f"wrote {tmp_path / 'report.html'}" in plain(done.stdout)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert text.index("What to look at") < text.index("Two halves of the views")
    assert (tmp_path / "rig.json").exists()


def test_json_has_its_numbers(arguments: list[Path | str], tmp_path: Path) -> None:
    done = run(*arguments, "--report", tmp_path / "report.html", "--json")
    said = json.loads(done.stdout)
    assert said["report"] == (tmp_path / "report.html").as_posix()
    assert len(said["judged"]["systematic"]["aligned"]["depth_mm"]) == 3
    assert said["judged"]["sigma"]["camera.fx"] > 0


def test_without_it_nothing_is_said(arguments: list[Path | str], tmp_path: Path) -> None:
    said = json.loads(run(*arguments, "--json").stdout)
    assert said["report"] is None
    assert "judged" not in said
    assert not list(tmp_path.glob("*.html"))


def test_halves_and_scale_are_told_without_it(arguments: list[Path | str], tmp_path: Path) -> None:
    said = json.loads(run(*arguments, "--json").stdout)
    assert said["halves"]["ratio"] == pytest.approx(
        said["halves"]["rms_mm"] / said["halves"]["predicted_rms_mm"]
    )
    assert (said["k3"], said["left_out"]) == ([], [])
    shown = plain(run(*arguments).stdout)
    assert f"two halves of the views differ by {1e3 * said['halves']['rms_mm']:.1f} µm" in shown
    assert "uncertainty not known: measure the pitch (pitch_sigma_mm in board.toml)" in shown
    write_board(tmp_path / "board.toml", replace(BOARD, pitch_sigma_mm=0.002))
    shown = plain(run(*arguments).stdout)
    assert "known to 1.5e-04 of every length, 1 sd, by the board's pitch" in shown
    assert read_rig(tmp_path / "rig.json").scale_sigma == pytest.approx(0.002 / 13)


def test_another_kind_of_file_is_refused_before_any_work(
    arguments: list[Path | str], tmp_path: Path
) -> None:
    done = run(*arguments, "--report", tmp_path / "report.pdf")
    assert done.exit_code == 2
    assert "--report must be a .html file" in done.stderr
    assert not (tmp_path / "rig.json").exists()


def test_another_group_of_the_captures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two alternatives of 200 and 180 grey levels; calibration itself is stood in for."""
    levels: list[float] = []

    def calibrate_captures(captures: Any, *_: object, **__: object) -> Rig:
        levels.extend(float(capture.frames[0].mean()) for capture in captures)
        return paper_rig()

    monkeypatch.setattr(fringeworks.calibrate, "calibrate_captures", calibrate_captures)
    groups = [PatternSet(Uniform(1.0), group=name) for name in ("dim", "bright")]
    frames = tuple(np.full((1, 4, 5), grey, np.uint8) for grey in (180, 200))
    write_capture(Capture(Sequence(8, 6, tuple(groups)), frames, Sensor(255.0)), tmp_path / "pose")
    write_board(tmp_path / "board.toml", BOARD)
    files = ("--board", tmp_path / "board.toml", "--out", tmp_path / "rig.json")
    for options in ((), ("--group", "bright")):
        assert run("calibrate", tmp_path / "pose", *files, *options).exit_code == 0
    assert levels == [180.0, 200.0]
    done = run("calibrate", tmp_path / "pose", *files, "--group", "dark")
    assert done.exit_code == 2
    assert "dark" in done.stderr


def test_the_boards_shape_is_a_choice(arguments: list[Path | str], tmp_path: Path) -> None:
    shapes = {}
    for shape in ("flat", "paraboloid"):
        assert run(*arguments, "--board-shape", shape).exit_code == 0
        rig = json.loads((tmp_path / "rig.json").read_text())
        assert rig["calibration"]["settings"]["board_shape"] == shape
        shapes[shape] = [name for name in rig["covariance"]["names"] if name.startswith("board.")]
    assert shapes["flat"] == []
    assert len(shapes["paraboloid"]) == 2
