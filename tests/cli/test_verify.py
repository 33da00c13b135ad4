"""``fringeworks verify`` on a simulated capture and on a real one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.files import write_board, write_capture, write_rig
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Pose, Rig
from fringeworks.patterns import make_sequence
from fringeworks.twin.scene import Scene
from fringeworks.twin.scenes import BOARD, board_scene, paper_rig, target_of
from fringeworks.twin.simulate import simulate
from tests.cli.scenes import plain, run

POSE = 3
"""Of the twin's fourteen: tilted by 28 degrees."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of the paper's rig, 752 x 480, 3 steps, with all of its noise."""
    folder = tmp_path_factory.mktemp("verify")
    scene, rig = board_scene(), paper_rig()
    (board,) = scene.objects
    placed = Scene("board", (replace(board, camera_from_object=scene.poses[POSE]),))
    width, height = rig.projector.width, rig.projector.height
    sequence = make_sequence("calibrate", width=width, height=height, steps=3)
    made = simulate(placed, rig, sequence, rng=np.random.default_rng(5))
    write_capture(made.capture, folder / "capture")
    write_board(folder / "board.toml", target_of(BOARD))
    write_rig(folder / "rig.json", rig)
    return folder


def turned(rig: Rig, degrees: float) -> Rig:
    """With its projector turned about the vertical."""
    turn = rotation_matrix(np.array([0.0, np.radians(degrees), 0.0]))
    pose = rig.projector_from_camera
    return replace(
        rig, projector_from_camera=Pose(turn @ pose.rotation, turn @ pose.translation_mm)
    )


def verify(capture: Path, rig: Path, *options: object) -> dict[str, Any]:
    board = ("--board", capture.parent / "board.toml")
    done = run("verify", capture, "--rig", rig, *board, *options, "--json")
    assert done.exit_code == 0, done.stderr
    values: dict[str, Any] = json.loads(done.stdout, parse_constant=pytest.fail)
    return values


def test_the_rig_of_the_capture_holds(folder: Path, tmp_path: Path) -> None:
    found = verify(folder / "capture", folder / "rig.json", "--figures", tmp_path)
    assert found["holds"] is True
    assert found["verdict"] == "holds"
    assert found["moved"] is None
    # corners come out to 0.03 px, their coordinates to 0.05 px, and 88 of them have a mean
    assert found["camera_rms_px"] < 0.06
    assert found["projector_rms_px"] < 0.1
    assert abs(found["epipolar_mean_px"]) < 0.05
    assert abs(found["depth_error_mm"]) < 0.1
    assert found["squares_mean_mm"] == pytest.approx(13.0, abs=0.01)
    assert found["scale_share"] == pytest.approx(found["squares_mean_mm"] / 13 - 1, abs=1e-9)
    assert found["plane_rms_mm"] < 0.1
    assert found["scale_sigma"] is None
    (figure,) = found["figures"]
    assert Path(figure).stat().st_size > 10_000


def test_a_rig_that_moved(folder: Path, tmp_path: Path) -> None:
    rig = tmp_path / "turned.json"
    write_rig(rig, turned(paper_rig(), -0.1))
    found = verify(folder / "capture", rig)
    assert found["holds"] is False
    assert "the projector turned" in found["moved_parts"]
    assert "camera" not in " ".join(found["moved_parts"])
    # 1.7e-3 rad of a column at fx = 1013 px and of the projector's distance, about 650 mm
    assert found["projector_rms_px"] > 1
    assert abs(found["depth_error_mm"]) > 1


def test_what_it_says(folder: Path, tmp_path: Path) -> None:
    write_rig(tmp_path / "turned.json", turned(paper_rig(), -0.1))
    board = ("--board", folder / "board.toml")
    done = run("verify", folder / "capture", "--rig", folder / "rig.json", *board)
    assert done.stdout.splitlines()[0] == "capture: the rig holds"
    done = run("verify", folder / "capture", "--rig", tmp_path / "turned.json", *board)
    assert done.exit_code == 0
    lines = done.stdout.splitlines()
    assert lines[0] == "capture: the rig has moved"
    assert "the projector turned (0.1" in lines[1]
    assert "scale sigma" not in plain(done.stdout)
    for words in ("depth error", "squares", "scale", "plane", "limits: fixed"):
        assert words in plain(done.stdout)


def test_what_the_rig_knows_of_its_scale(folder: Path, tmp_path: Path) -> None:
    rig = tmp_path / "rig.json"
    write_rig(rig, replace(paper_rig(), scale_sigma=1.5e-4))
    board = ("--board", folder / "board.toml")
    done = run("verify", folder / "capture", "--rig", rig, *board)
    assert "scale sigma 0.015% of every length, 1 sd" in plain(done.stdout)
    assert verify(folder / "capture", rig)["scale_sigma"] == 1.5e-4


def test_a_capture_of_another_camera(folder: Path, tmp_path: Path) -> None:
    rig = paper_rig()
    write_rig(tmp_path / "rig.json", replace(rig, camera=replace(rig.camera, width=640)))
    arguments = ("--rig", tmp_path / "rig.json", "--board", folder / "board.toml")
    done = run("verify", folder / "capture", *arguments)
    assert done.exit_code == 1
    assert "camera must be 640x" in done.stderr


def test_a_real_capture(real: Callable[[str], Path], tmp_path: Path) -> None:
    half = real("procam-half")
    rig = tmp_path / "rig.json"
    done = run("calibrate", half, "--board", half / "board.toml", "--out", rig)
    assert done.exit_code == 0, done.stderr
    found = verify(half / "capture_3", rig)
    assert found["holds"] is True
    assert "4 views" in found["limits_from"]
    # the bars of calibration: 0.19 and 0.26 px, squares 75.0 +- 0.1 mm
    assert found["camera_rms_px"] < 0.19
    assert found["projector_rms_px"] < 0.26
    assert found["squares_mean_mm"] == pytest.approx(75, abs=0.1)
