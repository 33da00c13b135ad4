"""``scan --station``: from light to points in one command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.files import read_cloud, write_rig
from fringeworks.model import Camera, Lens, Rig
from fringeworks.twin.scenes import named_rig
from tests.cli.scenes import run

BINNED = 4


def small() -> Rig:
    """The paper's rig with larger and fewer pixels in the camera."""
    rig = named_rig("paper")
    camera, lens = rig.camera, rig.camera.lens
    larger = replace(
        lens,
        fx=lens.fx / BINNED,
        fy=lens.fy / BINNED,
        cx=(lens.cx + 0.5) / BINNED - 0.5,
        cy=(lens.cy + 0.5) / BINNED - 0.5,
    )
    return replace(rig, camera=Camera(camera.width // BINNED, camera.height // BINNED, larger))


@pytest.fixture
def station(tmp_path: Path) -> Path:
    write_rig(tmp_path / "rig.json", small())
    path = tmp_path / "station.toml"
    path.write_text(
        'format = "fringeworks-station/1"\n[projector]\nkind = "simulated"\n'
        '[camera]\nkind = "simulated"\n[simulated]\nscene = "wall"\nrig = "rig.json"\n'
    )
    return path


def test_a_wall(station: Path, tmp_path: Path) -> None:
    out = tmp_path / "cloud.npz"
    told = run("scan", "--station", station, "--out", out, "--json")
    assert told.exit_code == 0, told.stderr
    values = json.loads(told.stdout)
    assert (values["capture"], values["rig"]) == ("measure", station.as_posix())
    kept = run("scan", "--station", station, "--keep", tmp_path / "a", "--out", tmp_path / "a.npz")
    assert kept.exit_code == 0, kept.stderr
    twice = run("scan", "--station", station, "--keep", tmp_path / "a", "--out", out)
    assert twice.exit_code == 2
    assert "holds a capture already; scan that one without --station" in twice.stderr
    again = run("scan", tmp_path / "a", "--rig", tmp_path / "rig.json", "--out", tmp_path / "b.npz")
    assert again.exit_code == 0, again.stderr
    clouds = [read_cloud(path).points() for path in (out, tmp_path / "a.npz", tmp_path / "b.npz")]
    assert len(clouds[0]) == values["points"] > 5000
    assert np.array_equal(clouds[0], clouds[1])
    assert np.array_equal(clouds[0], clouds[2])


def test_a_rig_of_other_devices(station: Path, tmp_path: Path) -> None:
    write_rig(tmp_path / "other.json", named_rig("paper"))
    arguments = ("scan", "--station", station, "--out", tmp_path / "cloud.npz")
    told = run(*arguments, "--rig", tmp_path / "other.json", "--keep", tmp_path / "a")
    assert told.exit_code == 2
    assert "error: the rig's camera must be" in told.stderr
    assert "calibrate this station" in told.stderr
    assert not (tmp_path / "a").exists()


def test_a_stations_rig_of_other_devices_is_refused_by_acquire(
    station: Path, tmp_path: Path
) -> None:
    other = small()
    other = replace(other, camera=Camera(6, 4, Lens(5, 5, 3, 2)))
    write_rig(tmp_path / "other.json", other)
    text = station.read_text()
    station.write_text(text.replace("[projector]", 'rig = "other.json"\n[projector]'))
    told = run("acquire", "measure", "--station", station, "--out", tmp_path / "a")
    assert told.exit_code == 2
    assert "the rig's camera must be" in told.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "a CAPTURE or --station, one of them"),
        (("a", "--station", "s.toml"), "a CAPTURE or --station, one of them"),
        (("a",), "scan needs --rig"),
        (("a", "--rig", "r.json", "--keep", "b"), "--keep belongs to --station"),
    ],
)
def test_what_does_not_fit_together(arguments: tuple[str, ...], message: str) -> None:
    told = run("scan", *arguments, "--out", "c.npz")
    assert told.exit_code == 2
    assert message in told.stderr


def test_a_station_without_a_rig(tmp_path: Path) -> None:
    path = tmp_path / "station.toml"
    path.write_text(
        'format = "fringeworks-station/1"\n[projector]\nkind = "window"\n'
        '[camera]\nkind = "opencv"\n'
    )
    told = run("scan", "--station", path, "--out", tmp_path / "c.npz")
    assert told.exit_code == 2
    assert 'names no rig; say rig = "rig.json" there, or give --rig' in told.stderr
