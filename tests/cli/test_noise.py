"""``noise``: from repeated levels to the [camera] table of a capture."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from fringeworks.files import read_capture, write_capture
from fringeworks.twin.effects import CameraEffects
from tests.cli.scenes import run
from tests.phase.flats import see_dark, see_flats

CAMERA = CameraEffects(bits=12, black_level=60.0)


@pytest.fixture(scope="module")
def flats(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("noise") / "flats"
    times = (0.1, 0.2, 0.35, 0.5, 0.7, 0.9)
    write_capture(see_flats(CAMERA, 0, levels=(0.5, 1.0), exposures=times), folder)
    return folder


def told(*arguments: object) -> dict[str, Any]:
    done = run(*arguments, "--json")
    assert done.exit_code == 0, done.stderr
    values = json.loads(done.stdout, parse_constant=pytest.fail)
    assert isinstance(values, dict)
    return values


def test_figures_are_told_written_and_drawn(flats: Path, tmp_path: Path) -> None:
    scan = tmp_path / "scan"
    write_capture(see_flats(CAMERA, 9, levels=(0.0,)), scan)
    drawn = tmp_path / "figures"
    values = told("noise", flats, "--write", scan, "--figures", drawn)
    assert abs(values["gain"]["value"] - 0.34125) < 4 * values["gain"]["sigma"]
    assert values["black_level"]["way"] == "exposures"
    assert values["linearity_error"]["most"] < 0.01
    assert sorted(path.name for path in drawn.iterdir()) == ["linearity.png", "noise.png"]
    assert min(path.stat().st_size for path in drawn.iterdir()) > 10_000
    sensor = read_capture(scan).sensor
    assert sensor.noise_is_known
    assert sensor.gain == values["camera"]["gain"] == float(f"{values['gain']['value']:.6g}")
    assert sensor.black_level == pytest.approx(values["black_level"]["value"], rel=1e-5)
    assert sensor.full_scale == 4095.0


def test_words_have_a_table_to_paste(flats: Path, tmp_path: Path) -> None:
    dark = tmp_path / "dark"
    write_capture(see_dark(CAMERA, 1), dark)
    done = run("noise", flats, "--dark", dark)
    assert done.exit_code == 0, done.stderr
    assert "dark frames" in done.stdout
    table = tomllib.loads(done.stdout[done.stdout.index("[camera]") :])["camera"]
    assert table["black_level"] == pytest.approx(60.0, abs=0.3)
    assert table["read_noise"] == pytest.approx(6.825, rel=0.03)


def test_patterns_and_what_cannot_be_measured(tmp_path: Path) -> None:
    size = ("--projector", "64x48", "--out", tmp_path / "p")
    done = run("patterns", "noise", *size, "--steps", "4")
    assert done.exit_code == 2
    assert "preset noise shows grey levels" in done.stderr
    assert run("patterns", "noise", *size, "--axes", "x").exit_code == 2
    values = told("patterns", "noise", *size)
    assert values["images"] == 64
    shown = read_capture(tmp_path / "p").sequence.sets
    assert [item.repeats for item in shown] == [4] * 16
    done = run("noise", tmp_path / "p", "--write", tmp_path / "p")
    assert done.exit_code == 1
    assert "let no repeat be a copy" in done.stderr
    assert not read_capture(tmp_path / "p").sensor.noise_is_known
