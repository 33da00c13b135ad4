"""``calibrate --residual``: fields chosen, told and written, or why there are none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fringeworks.calibrate
from fringeworks.calibrate import CalibrationSettings, ImageSize, View, calibrate_rig
from fringeworks.files import read_rig, write_board
from fringeworks.model import Rig
from tests.calibrate.synthetic import BOARD, board_poses, dense_sites, rig_state, views_of
from tests.cli.scenes import plain, run


def views_with_sites() -> list[View]:
    rng = np.random.default_rng(4)
    truth = rig_state(board_poses(7, rng=rng))
    sites = dense_sites(truth, sigma=0.02, rng=rng)
    return [
        replace(view, dense=part.only(np.arange(len(part)) % 6 == 0))
        for view, part in zip(views_of(truth, sigma=0.02, rng=rng), sites, strict=True)
    ]


def arguments(folder: Path, views: list[View], patch: pytest.MonkeyPatch) -> list[Path | str]:
    """A calibration whose captures are none: their views are made up."""

    def calibrate_captures(captures: Any, board: Any, *, settings: CalibrationSettings) -> Rig:
        camera, projector = ImageSize(752, 480), ImageSize(608, 684)
        return calibrate_rig(
            views, board, camera_size=camera, projector_size=projector, settings=settings
        )

    patch.setattr(fringeworks.calibrate, "calibrate_captures", calibrate_captures)
    write_board(folder / "board.toml", BOARD)
    (folder / "pose").mkdir()
    (folder / "pose" / "capture.toml").touch()
    files = ("--board", folder / "board.toml", "--out", folder / "rig.json")
    return ["calibrate", folder / "pose", *files]


def test_fields_are_told_and_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = arguments(tmp_path, views_with_sites(), monkeypatch)
    done = run(*words, "--residual", "auto", "--json")
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)["residual"]
    assert [(item["model"], item["axis"]) for item in told[:2]] == [("full", "x"), ("full", "y")]
    fields = read_rig(tmp_path / "rig.json").residual
    assert {field.model for field in fields} == {"geometric"}
    assert [item["order"] for item in told if item["order"]] == [field.order for field in fields]


def test_without_sites_the_rig_is_written_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    views = [replace(view, dense=None) for view in views_with_sites()]
    words = arguments(tmp_path, views, monkeypatch)
    done = run(*words, "--residual", "auto")
    assert done.exit_code == 0, done.stderr
    assert "left out: the rig's calibration has no sites" in plain(done.stdout)
    assert read_rig(tmp_path / "rig.json").residual == ()
    assert "residual field" not in plain(run(*words).stdout)
