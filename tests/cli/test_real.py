"""Calibrate, scan and measure real captures, through the commands."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.scenes import run

Real = Callable[[str], Path]


@pytest.fixture(scope="module")
def half(data_dir: Path, real: Real) -> Path:
    return real("procam-half")


def test_calibrate_then_scan_then_measure(half: Path, tmp_path: Path) -> None:
    rig, cloud = tmp_path / "rig.json", tmp_path / "cloud.npz"
    done = run("calibrate", half, "--board", half / "board.toml", "--out", rig)
    assert done.exit_code == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "model: joint"
    assert [line.split()[0] for line in lines[2:7]] == [*(f"capture_{i}" for i in range(4)), "all"]
    assert "does not fit the other corners" in done.stdout
    assert "focal lengths" in done.stdout
    assert run("scan", half / "capture_0", "--rig", rig, "--out", cloud).exit_code == 0
    done = run("measure", "plane", cloud, "--pixels", "150:440,100:380", "--json")
    found = json.loads(done.stdout)
    assert found["form_rms_mm"] <= 3.3
    assert found["points"] > 50_000


def test_captures_one_by_one_are_those_of_the_folder(half: Path, tmp_path: Path) -> None:
    board, one = half / "board.toml", tmp_path / "one.json"
    poses = [half / f"capture_{i}" for i in range(1, 4)]
    done = run("calibrate", *poses, "--board", board, "--out", one, "--json")
    assert done.exit_code == 0, done.stderr
    values = json.loads(done.stdout, parse_constant=pytest.fail)
    assert [view["name"] for view in values["views"]] == [pose.name for pose in poses]
    assert values["out"] == one.as_posix()


def test_too_few_captures(half: Path, tmp_path: Path) -> None:
    arguments = ("--board", half / "board.toml", "--out", tmp_path / "rig.json")
    done = run("calibrate", half / "capture_0", half / "capture_1", *arguments)
    assert (done.exit_code, done.stdout) == (1, "")
    assert "at least 3 views of the board are needed" in done.stderr
    assert not (tmp_path / "rig.json").exists()


def test_dome_is_relative(real: Real, tmp_path: Path) -> None:
    done = run("decode", real("fourstep-dome"), "--out", tmp_path / "phase.npz", "--json")
    assert done.exit_code == 0
    axis = json.loads(done.stdout)["axes"]["x"]
    assert axis["absolute"] is False
    assert axis["valid_share"] > 0.9
    assert "JPEG" in done.stderr
