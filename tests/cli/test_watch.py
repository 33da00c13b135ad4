"""``watch``: what it prints, how it ends, and that it goes on after a kill."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from fringeworks.files import read_cloud, read_rig
from fringeworks.files.frame import keep_station
from fringeworks.files.watch_log import ScanRow, WatchLog, read_watch_log
from fringeworks.model import Pose
from fringeworks.model.frame import Frame
from fringeworks.watch import CLOUDS, LOG
from tests.cli.scenes import plain, run
from tests.watch.stations import PATTERNS, write_station

ZONE = ("--zone", "wall=-30:30,-20:20,650:750")


@pytest.fixture
def station(tmp_path: Path) -> Path:
    return write_station(tmp_path)


def test_scans_are_told_and_shown(station: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    told = run("watch", "--station", station, "--out", out, "--count", 2, *PATTERNS, *ZONE)
    assert told.exit_code == 0, told.stderr
    lines = told.stdout.splitlines()
    assert lines[0].split()[0] == "1"
    assert "points" in lines[0]
    assert "wall: ALARM" in lines[1]
    assert "2 scans, 0 failed" in told.stdout
    assert "acquire" in told.stdout
    assert "wall: 2 alarms; no safety function" in told.stdout

    shown = run("watch", "--show", out)
    assert shown.stdout.splitlines()[:4] == lines[:4]
    rows = json.loads(run("watch", "--show", out, "--json").stdout)
    assert [row["scan"] for row in rows["scans"]] == [1, 2]
    assert [row["alarm"] for row in rows["zones"]] == [True, True]


def test_a_scan_without_sigma_is_shown(tmp_path: Path) -> None:
    """As of a camera whose noise the station does not say."""
    with closing(WatchLog(tmp_path / LOG)) as log:
        run_number = log.begin_run("2024-05-06T07:08:09.000+00:00", {})
        begun = "2024-05-06T07:08:09.000+00:00"
        log.add(ScanRow(1, run_number, begun, 7, 0.5, float("nan")), [])
    shown = run("watch", "--show", tmp_path)
    assert shown.exit_code == 0
    assert "7 points, 50.0%, sigma nan mm" in shown.stdout


def test_json_is_one_object(station: Path, tmp_path: Path) -> None:
    arguments = ("--count", 1, *PATTERNS, *ZONE, "--least-points", 100_000, "--json")
    told = run("watch", "--station", station, "--out", tmp_path / "out", *arguments)
    values = json.loads(told.stdout)
    assert (values["scans"], values["failed"]) == (1, 0)
    assert values["alarms"] == {"wall": 0}
    assert set(values["shares"]) == {"acquire", "scan", "zones", "cloud", "log", "rest"}
    assert "no safety function" in values["caveat"]


def test_zones_of_the_station(station: Path, tmp_path: Path) -> None:
    arguments = ("watch", "--station", station, "--out", tmp_path / "out", *PATTERNS, "--count", 1)
    zone = ("--zone", "a=-20:20,-20:20,-50:50", "--frame", "station")
    refused = run(*arguments, *zone)
    assert refused.exit_code == 2
    assert "has no station_from_camera" in refused.stderr

    path = tmp_path / "rig.json"
    keep_station(path, read_rig(path), Frame("station", Pose(np.eye(3), np.array([0, 0, -700.0]))))
    told = run(*arguments, *zone)
    assert told.exit_code == 0, told.stderr
    assert "a: ALARM" in told.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--zone", "a=1:2,3:4"), "--zone a must be X0:X1,Y0:Y1,Z0:Z1"),
        (("--zone", "a=:2,3:4,5:6"), "zone a: x must be a finite range"),
        ((*ZONE, *ZONE), "each zone must have a name of its own"),
        (("--frame", "moon"), "--frame must be camera or station"),
        (("--zone", "a=0:1,0:1,-9:-8"), "the camera does not see it"),
    ],
)
def test_refusals(station: Path, tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    told = run("watch", "--station", station, "--out", tmp_path / "out", *arguments)
    assert told.exit_code == 2
    assert message in told.stderr
    assert not (tmp_path / "out").exists()


def test_it_needs_a_station_or_a_log(tmp_path: Path) -> None:
    told = run("watch", "--out", tmp_path)
    assert told.exit_code == 2
    assert "watch needs --station and --out" in told.stderr
    assert run("watch", "--show", tmp_path).exit_code == 1


def test_the_help_says_that_it_is_no_safety_function() -> None:
    assert "NO SAFETY FUNCTION" in plain(run("watch", "--help").stdout)


def start(station: Path, out: Path) -> subprocess.Popen[str]:
    """The command in a process of its own; its folder has room for some of its clouds."""
    command = [sys.executable, "-m", "fringeworks", "watch", "--station", str(station)]
    return subprocess.Popen(
        [*command, "--out", str(out), *PATTERNS, *ZONE, "--max-gb", "0.001"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_whatever_ends_it_the_log_is_complete_and_it_goes_on(station: Path, tmp_path: Path) -> None:
    rng, out, last = random.Random(7), tmp_path / "out", 0
    ends = {signal.SIGKILL: -9, signal.SIGTERM: 143, signal.SIGINT: 130}
    for how, status in ends.items():
        with start(station, out) as watching:
            assert watching.stdout is not None
            first = watching.stdout.readline()
            time.sleep(rng.uniform(0, 0.3))
            watching.send_signal(how)
            rest, errors = watching.communicate(timeout=30)
        scans, zones = read_watch_log(out / LOG)
        assert [row.scan for row in scans] == [row.scan for row in zones]
        assert [row.scan for row in scans] == list(range(1, len(scans) + 1))
        assert last < int(first.split()[0]) <= len(scans)
        assert all(read_cloud(path).valid.any() for path in (out / CLOUDS).glob("scan_*.npz"))
        assert watching.returncode == status, errors
        if how != signal.SIGKILL:
            assert ("terminated" if how == signal.SIGTERM else "interrupted") in errors
            logged = len(scans) - last  # the last one may not have been told yet
            assert any(f"{told} scans, 0 failed" in rest for told in (logged - 1, logged))
            assert not (out / ".acquiring.lock").exists()
        last = len(scans)
    assert scans[-1].run == len(ends)
