"""``devices``: what it lists, and that it fails for nothing. Aravis is in test_genicam."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest

from fringeworks.devices import found
from tests.cli.scenes import run
from tests.devices.screens import open_screens
from tests.devices.toys import install_toys


@pytest.fixture(autouse=True)
def nothing_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without devices and drivers; Aravis would ask the network."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY", found.PRODUCERS):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setitem(sys.modules, "gi", None)
    monkeypatch.setattr(found, "VIDEO_DEVICES", tmp_path / "video4linux")


def listed() -> dict[str, Any]:
    told = run("devices", "--json")
    assert told.exit_code == 0, told.stderr
    values: dict[str, Any] = json.loads(told.stdout)
    return values


def of_kind(kind: str) -> list[dict[str, Any]]:
    return [item for item in listed()["devices"] if item["kind"] == kind]


def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    values = listed()
    assert values["devices"] == []
    assert "fringeworks[hardware]" in values["reasons"]["window"]
    assert "gir1.2-aravis-0.8" in values["reasons"]["genicam"]
    assert "GENICAM_GENTL64_PATH" in values["reasons"]["gentl"]
    assert set(values["reasons"]) == {"window", "genicam", "gentl", "opencv", "plugin"}
    assert "  plugin: no package brings one" in run("devices").stdout


def test_displays(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame")
    with open_screens((320, 240), (192, 256)) as screens:
        monkeypatch.setenv("DISPLAY", screens.display)
        windows = of_kind("window")
    assert [item["settings"] for item in windows] == [
        {"display": 0, "width": 320, "height": 240},
        {"display": 1, "width": 192, "height": 256},
    ]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there are other displays")
def test_no_display() -> None:
    pytest.importorskip("pygame")
    assert "neither DISPLAY nor WAYLAND_DISPLAY is set" in listed()["reasons"]["window"]


def test_webcams(tmp_path: Path) -> None:
    for name in ("video10", "video2"):
        (tmp_path / "video4linux" / name).mkdir(parents=True)
    (tmp_path / "video4linux" / "video2" / "name").write_text("HD Webcam\n")
    assert [(item["name"], item["settings"]) for item in of_kind("opencv")] == [
        ("HD Webcam", {"index": 2}),
        ("video10", {"index": 10}),
    ]
    assert "HD Webcam  index = 2" in run("devices").stdout


def test_producers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "maker.cti").touch()
    path = os.pathsep.join([str(tmp_path / "none"), str(tmp_path)])
    monkeypatch.setenv(found.PRODUCERS, path)
    monkeypatch.setitem(sys.modules, "genicam", None)
    assert "harvesters" in listed()["reasons"]["gentl"]
    monkeypatch.delitem(sys.modules, "genicam")
    pytest.importorskip("harvesters")
    (item,) = of_kind("gentl")
    assert item["settings"] == {"producer": str(tmp_path / "maker.cti")}


def test_plugins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    assert [(item["role"], item["settings"]["name"]) for item in of_kind("plugin")] == [
        ("projector", "toy"),
        ("camera", "toy"),
    ]


def test_a_driver_that_breaks_hides_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> list[found.FoundDevice]:
        raise ZeroDivisionError("oops")

    install_toys(tmp_path, monkeypatch)
    monkeypatch.setattr(found, "_displays", broken)
    values = listed()
    assert values["reasons"]["window"] == "ZeroDivisionError: oops"
    assert len(values["devices"]) == 2
