"""``decode --motion`` and ``--other-light``: what they say, and what they refuse."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fringeworks.cli.app import app
from fringeworks.files import read_capture, write_capture
from fringeworks.model import Capture, Fringe, PatternSet, Sensor, Sequence
from fringeworks.patterns import equal_shifts

RATE_PX = 0.5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plane that comes nearer: its fringes run on by half a projector px a frame."""
    at = tmp_path_factory.mktemp("motion") / "capture"
    fringes = [Fringe("x", period, equal_shifts(4)) for period in (160.0, 32.0)]
    x = np.arange(160) * 0.5 + 20
    stacks, age = [], 0
    for fringe in fringes:
        rows = []
        for shift in fringe.shifts_rad:
            phase = 2 * np.pi * (x + RATE_PX * age - fringe.zero_px) / fringe.period_px
            rows.append(np.rint(30_000 + 18_000 * np.cos(phase - shift)))
            age += 1
        stacks.append(np.repeat(np.array(rows, np.uint16)[:, None], 80, axis=1))
    sets = tuple(PatternSet(fringe) for fringe in fringes)
    write_capture(Capture(Sequence(150, 80, sets), tuple(stacks), Sensor(65_535.0)), at)
    return at


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["decode", *words])
    return done.exit_code, done.output


def test_motion_is_taken_out_and_told(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "phase.npz"
    status, told = run(str(folder), "--out", str(out), "--motion", "0,0", "--json")

    assert status == 0
    motion = json.loads(told)["motion"]
    assert motion["projector_px"]["x"] == pytest.approx(RATE_PX, rel=0.01)
    assert motion["reference_frame"] == 5.5
    assert motion["misfit_after"] < 0.1 * motion["misfit_before"]
    with np.load(out) as maps:
        found = maps["column"][40]
    true = np.arange(160) * 0.5 + 20 + RATE_PX * 5.5
    # 1 % of the rate over the six frames from the first set to the reference.
    assert np.nanmax(np.abs(found - true)) < 0.03


def test_without_the_option_nothing_is_said(folder: Path, tmp_path: Path) -> None:
    status, told = run(str(folder), "--out", str(tmp_path / "p.npz"), "--json")
    assert status == 0
    assert json.loads(told)["motion"] is None


def test_other_light_is_an_option_beside_it(folder: Path, tmp_path: Path) -> None:
    asked = ("--motion", "0,0", "--other-light", "--json")
    status, told = run(str(folder), "--out", str(tmp_path / "p.npz"), *asked)
    assert status == 0
    assert json.loads(told)["axes"]["x"]["valid_share"] == 1.0


def test_other_words_are_refused(folder: Path, tmp_path: Path) -> None:
    status, _ = run(str(folder), "--out", str(tmp_path / "p.npz"), "--motion", "1,2,3")
    assert status != 0


def test_a_motion_out_of_the_image_is_refused(folder: Path, tmp_path: Path) -> None:
    status, told = run(str(folder), "--out", str(tmp_path / "p.npz"), "--motion", "200,0")
    assert status == 1
    assert "leaves no pixel inside the image" in told


def test_several_exposures_are_refused(folder: Path, tmp_path: Path) -> None:
    once = read_capture(folder)
    sets = [replace(item, exposure_ms=ms) for ms in (4.0, 8.0) for item in once.sequence.sets]
    twice = replace(once, sequence=replace(once.sequence, sets=tuple(sets)), frames=once.frames * 2)
    write_capture(twice, tmp_path / "twice")
    out = ("--out", str(tmp_path / "p.npz"))
    for motion in ("auto", "0,0"):
        status, told = run(str(tmp_path / "twice"), *out, "--motion", motion)
        assert status == 1
        assert "frames of one exposure" in told


def test_one_period_tells_nothing_of_other_light(folder: Path, tmp_path: Path) -> None:
    both = read_capture(folder)
    fine = replace(both.sequence, sets=both.sequence.sets[1:])
    write_capture(replace(both, sequence=fine, frames=both.frames[1:]), tmp_path / "fine")
    asked = ("--out", str(tmp_path / "p.npz"), "--other-light", "--json")
    assert "no two periods" in run(str(tmp_path / "fine"), *asked)[1]
    assert "no two periods" not in run(str(folder), *asked)[1]
