"""``acquire``: what it says, how it ends, and that it goes on."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from fringeworks.devices import Faults, SimulatedBench, stations
from fringeworks.files import read_capture, write_rig
from fringeworks.files.acquiring import ACQUIRING_JSON
from tests.cli.scenes import run
from tests.devices.stages import RIG, MirrorStage

PRESET = ("acquire", "measure", "--axes", "x", "--steps", "3", "--periods", "8", "--code", "gray")
IMAGES = 3 + 2 + 2
"""Fringes, two bits for three cells of 8 px over 24 px, white and black."""


@pytest.fixture
def station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A station whose stage has no optics."""
    monkeypatch.setattr("fringeworks.twin.stage.Stage", lambda *_: MirrorStage())
    write_rig(tmp_path / "rig.json", RIG)
    path = tmp_path / "station.toml"
    path.write_text(
        'format = "fringeworks-station/1"\n[projector]\nkind = "simulated"\n'
        '[camera]\nkind = "simulated"\n[simulated]\nscene = "wall"\nrig = "rig.json"\nseed = 4\n'
    )
    return path


@pytest.fixture
def faulty(monkeypatch: pytest.MonkeyPatch) -> Callable[[Faults], None]:
    def make(faults: Faults) -> None:
        monkeypatch.setattr(stations, "SimulatedBench", partial(SimulatedBench, faults=faults))

    return make


def test_a_capture_is_written_and_told(station: Path, tmp_path: Path) -> None:
    told = run(*PRESET, "--station", station, "--out", tmp_path / "a")
    assert told.exit_code == 0, told.stderr
    assert f"wrote {IMAGES} images and capture.toml in {tmp_path / 'a'}" in told.stdout
    assert read_capture(tmp_path / "a").provenance["scene"] == "wall"
    values = json.loads(
        run(*PRESET, "--station", station, "--out", tmp_path / "b", "--json").stdout
    )
    assert (values["images"], values["taken"]) == (IMAGES, IMAGES)
    assert f"passed over    {values['frames']['stale']} frames" in told.stdout
    assert values["frames"]["repeated"] == values["frames"]["dropped"] == 0


def test_faults_are_counted(
    station: Path, tmp_path: Path, faulty: Callable[[Faults], None]
) -> None:
    faulty(Faults(dropped=(3, 4), repeated=(7,)))
    told = run(*PRESET, "--station", station, "--out", tmp_path / "a")
    assert told.exit_code == 0, told.stderr
    assert "1 frames, grabbed anew" in told.stdout
    assert "2 frames missing" in told.stdout


def test_a_camera_that_hangs_ends_with_3_and_the_command_goes_on(
    station: Path, tmp_path: Path, faulty: Callable[[Faults], None]
) -> None:
    arguments = (*PRESET, "--station", station, "--out", tmp_path / "a")
    faulty(Faults(dropped=range(8, sys.maxsize)))
    failed = run(*arguments)
    assert failed.exit_code == 3
    assert failed.stderr.startswith("error: fringe_x_p8_2.png: no frame whose exposure began")
    assert (tmp_path / "a" / ACQUIRING_JSON).exists()

    faulty(Faults())
    done = run(*arguments, "--json")
    assert done.exit_code == 0, done.stderr
    assert "2 images are there from an unfinished run" in done.stderr
    assert json.loads(done.stdout)["taken"] == IMAGES - 2
    assert read_capture(tmp_path / "a").provenance["resumed_at"] == ["fringe_x_p8_2.png"]


def test_a_run_that_goes_on_draws_other_noise(
    station: Path, tmp_path: Path, faulty: Callable[[Faults], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[float] = []

    def expose(self: MirrorStage, image: object, *, rng: object, **_: object) -> object:
        drawn.append(rng.random())  # type: ignore[attr-defined]
        return image

    monkeypatch.setattr(MirrorStage, "expose", expose)
    arguments = (*PRESET, "--station", station, "--out", tmp_path / "a")
    faulty(Faults(dropped=range(8, sys.maxsize)))
    assert run(*arguments).exit_code == 3
    faulty(Faults())
    assert run(*arguments).exit_code == 0
    assert len(set(drawn)) == IMAGES


def test_a_finished_capture_is_not_replaced_unasked(station: Path, tmp_path: Path) -> None:
    arguments = (*PRESET, "--station", station, "--out", tmp_path / "a")
    assert run(*arguments).exit_code == 0
    refused = run(*arguments)
    assert refused.exit_code == 2
    assert "holds a capture already" in refused.stderr
    assert run(*arguments, "--overwrite").exit_code == 0


def test_where_no_folder_can_be(station: Path, tmp_path: Path) -> None:
    told = run(*PRESET, "--station", station, "--out", tmp_path / ("n" * 300))
    assert told.exit_code == 1
    assert "cannot be read (File name too long)" in told.stderr


def test_other_patterns_do_not_go_on(
    station: Path, tmp_path: Path, faulty: Callable[[Faults], None]
) -> None:
    faulty(Faults(dropped=range(8, sys.maxsize)))
    assert run(*PRESET, "--station", station, "--out", tmp_path / "a").exit_code == 3
    other = run(*PRESET, "--inverted", "--station", station, "--out", tmp_path / "a")
    assert other.exit_code == 2
    assert "unfinished acquisition that is another: its sequence had" in other.stderr
