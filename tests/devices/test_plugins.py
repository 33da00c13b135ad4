"""Drivers of another package, installed and used through a station."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fringeworks.devices import open_station
from fringeworks.errors import DeviceError
from fringeworks.files import read_capture
from fringeworks.files.station import read_station
from tests.cli.scenes import run
from tests.devices.toys import ENTRY_POINTS, install_toys

STATION = """format = "fringeworks-station/1"
[projector]
kind = "plugin"
name = "toy"
[camera]
kind = "plugin"
name = "toy"
exposure_ms = 5
options = { darker = 2 }
[timing]
settle_ms = 1
"""


@pytest.fixture(autouse=True)
def another_module() -> Iterator[None]:
    yield
    sys.modules.pop("fringeworks_toys", None)


def station(folder: Path, text: str = STATION) -> Path:
    (folder / "station.toml").write_text(text)
    return folder / "station.toml"


def test_a_capture_by_plug_ins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    path = station(tmp_path)
    preset = ("acquire", "measure", "--axes", "x", "--periods", "8", "--steps", "3")
    told = run(*preset, "--station", path, "--out", tmp_path / "a")
    assert told.exit_code == 0, told.stderr
    read = read_capture(tmp_path / "a")
    assert read.provenance["projector"] == "toy screen: 24x16 px, 8 bit"
    assert read.provenance["camera"] == "toy eye: 24x16 px, full scale 255"
    assert read.white() is not None
    assert np.all(read.white() == 127)


def opening(path: Path) -> None:
    with open_station(read_station(path)):
        pass


def test_one_that_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = station(tmp_path)
    with pytest.raises(DeviceError, match=r"no plug-in 'toy' in fringeworks.cameras; installed: n"):
        opening(path)
    install_toys(tmp_path, monkeypatch)
    with pytest.raises(DeviceError, match=r"no plug-in 'toys' in .*cameras; installed: toy"):
        opening(station(tmp_path, STATION.replace('name = "toy"\nexp', 'name = "toys"\nexp')))


def test_one_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    broken = STATION.replace("[camera]", 'options = { bulb = "broken" }\n[camera]')
    with pytest.raises(DeviceError, match="plug-in 'toy' failed: no light"):
        opening(station(tmp_path, broken))
    unknown = STATION.replace("darker", "brighter")
    with pytest.raises(DeviceError, match=r"plug-in 'toy' failed: .*brighter"):
        opening(station(tmp_path, unknown))


def test_one_that_is_no_camera(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = ENTRY_POINTS.replace("fringeworks_toys:Eye", "fringeworks_toys:half_made")
    install_toys(tmp_path, monkeypatch, entry_points=wrong)
    with pytest.raises(DeviceError, match="'toy' must have name, width, height, sensor, grab, clo"):
        opening(station(tmp_path, STATION.replace("options = { darker = 2 }\n", "")))
