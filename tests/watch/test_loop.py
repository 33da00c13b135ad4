"""Scan after scan of a simulated station: what is logged, what is kept, and what goes wrong."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from fringeworks.acquire import Timing
from fringeworks.devices import Faults, SimulatedBench, VirtualClock, stations
from fringeworks.devices.simulated import SimulatedProjector
from fringeworks.errors import DecodeError, DeviceError, UsageError
from fringeworks.files import read_cloud
from fringeworks.files.station import Station, read_station
from fringeworks.files.watch_log import read_watch_log
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.measure.zones import Zone
from fringeworks.model import Pose
from fringeworks.model.frame import Frame
from fringeworks.watch import CLOUDS, LOG, Scanned, Totals, Watching, watch
from tests.watch.stations import make_patterns, write_station

WALL = Zone("wall", ((-30.0, 30.0), (-20.0, 20.0), (650.0, 750.0)))
AIR = Zone("air", ((-30.0, 30.0), (-20.0, 20.0), (600.0, 650.0)))
IMAGES = 3 + 5 + 2
"""Fringes, Gray code with its extra bit, white and black."""


@pytest.fixture
def station(tmp_path: Path) -> Station:
    return read_station(write_station(tmp_path))


@pytest.fixture
def faulty(monkeypatch: pytest.MonkeyPatch) -> Callable[[Faults], None]:
    def make(faults: Faults) -> None:
        monkeypatch.setattr(stations, "SimulatedBench", partial(SimulatedBench, faults=faults))

    return make


def run(station: Station, folder: Path, clock: VirtualClock, **options: object) -> list[Scanned]:
    watching = replace(Watching(), **options)  # type: ignore[arg-type]
    return list(watch(station, make_patterns, folder, watching, clock=clock))


def test_scans_are_logged_and_kept(station: Station, tmp_path: Path) -> None:
    out = tmp_path / "out"
    made = run(station, out, VirtualClock(), count=3, zones=(WALL, AIR))
    rows, zones = read_watch_log(out / LOG)
    assert rows == [one.row for one in made]
    assert [row.scan for row in rows] == [1, 2, 3]
    assert [one.alarms for one in made] == [["wall"]] * 3
    assert [row.zone for row in zones] == ["air", "wall"] * 3
    for row in rows:
        cloud = read_cloud(out / CLOUDS / str(row.cloud))
        assert int(cloud.valid.sum()) == row.points
        assert row.points is not None
        assert row.points > 0.9 * cloud.valid.size
        assert min(row.acquire_s or 0, row.scan_s or 0, row.zones_s or 0, row.cloud_s or 0) > 0
    assert rows[0].sigma_mm != rows[1].sigma_mm  # another noise

    again = run(station, out, VirtualClock(), count=1)
    assert (again[0].row.scan, again[0].row.run) == (4, 2)
    assert again[0].row.sigma_mm not in {row.sigma_mm for row in rows}


def test_zones_and_clouds_in_a_frame(station: Station, tmp_path: Path) -> None:
    turn = rotation_matrix(np.array([0.0, 0.2, 0.0]))
    frame = Frame("station", Pose(turn, -turn @ np.array([0.0, 0.0, 700.0])))
    table = Zone("table", ((-20.0, 20.0), (-20.0, 20.0), (-50.0, 50.0)))
    (made,) = run(station, tmp_path / "out", VirtualClock(), count=1, zones=(table,), frame=frame)
    found = made.zones["table"]
    assert found.alarm
    assert abs(found.nearest_xyz_mm[2]) < 50
    assert 600 < found.nearest_mm < 750
    assert read_cloud(tmp_path / "out" / CLOUDS / str(made.row.cloud)).frame == "station"


def test_its_pace(station: Station, tmp_path: Path) -> None:
    clock = VirtualClock()
    run(station, tmp_path / "out", clock, count=3, every_s=10.0)
    assert clock.now() == pytest.approx(20.0)  # none after the last


def test_a_failed_scan_is_logged_and_the_next_one_comes(
    station: Station, tmp_path: Path, faulty: Callable[[Faults], None]
) -> None:
    dark: list[bool] = []
    close = SimulatedProjector.close

    def closing_dark(self: SimulatedProjector) -> None:
        dark.append(True)
        close(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SimulatedProjector, "close", closing_dark)
        faulty(Faults(dropped=range(20, 10**9)))
        watching = Watching(count=3)
        clock = VirtualClock()
        scans = watch(station, make_patterns, tmp_path / "out", watching, clock=clock)
        with closing(scans):
            failed = next(scans)
            assert "no frame whose exposure began" in str(failed.row.failure)
            assert str(failed.row.failure).startswith("gray_x_")
            assert "same command again" not in str(failed.row.failure)
            assert not dark
            faulty(Faults())
            good = next(scans)
            assert dark == [True]
            assert good.row.failure is None
            assert good.row.points
        assert dark == [True, True]
    assert clock.now() == watching.pause_s
    rows, _ = read_watch_log(tmp_path / "out" / LOG)
    assert rows == [failed.row, good.row]
    assert failed.row.acquire_s is not None
    assert failed.row.scan_s is None


def test_too_many_failures_end_it(
    station: Station, tmp_path: Path, faulty: Callable[[Faults], None]
) -> None:
    faulty(Faults(dropped=range(10**9)))
    hasty = replace(station, timing=Timing(retries=0))
    with pytest.raises(DeviceError, match="no frame"):
        run(hasty, tmp_path / "out", VirtualClock(), most_failures=3)
    assert len(read_watch_log(tmp_path / "out" / LOG)[0]) == 3


def test_nothing_to_decode_is_a_failure_too(station: Station, tmp_path: Path) -> None:
    with pytest.raises(DecodeError):
        run(station, tmp_path / "out", VirtualClock(), z_range_mm=(100.0, 110.0), most_failures=1)


def test_refusals(station: Station, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="watch needs the rig"):
        run(replace(station, rig=None), tmp_path / "out", VirtualClock(), count=1)
    behind = Zone("back", ((0.0, 1.0), (0.0, 1.0), (-2.0, -1.0)))
    with pytest.raises(UsageError, match="zone back: the camera does not see it"):
        run(station, tmp_path / "out", VirtualClock(), count=1, zones=(behind,))
    assert not (tmp_path / "out").exists()
    with closing(watch(station, make_patterns, tmp_path / "out", Watching())) as scans:
        next(scans)
        with pytest.raises(UsageError, match="acquires into it"):
            run(station, tmp_path / "out", VirtualClock(), count=1)


def test_clouds_of_a_lost_log_are_not_written_over(station: Station, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(station, out, VirtualClock(), count=2)
    kept = {path.name: path.read_bytes() for path in (out / CLOUDS).iterdir()}
    (out / LOG).unlink()
    with pytest.raises(UsageError, match=r"holds scan 2, but watch\.sqlite ends with scan 0"):
        run(station, out, VirtualClock(), count=1)
    assert {path.name: path.read_bytes() for path in (out / CLOUDS).iterdir()} == kept


def test_memory_stays_flat(station: Station, tmp_path: Path) -> None:
    """What is still held after 12 scans more is less than one capture."""
    watching = Watching(zones=(WALL,), most_bytes=10**6)
    with closing(watch(station, make_patterns, tmp_path / "out", watching)) as scans:
        totals = Totals()
        tracemalloc.start()
        for _ in range(5):
            totals.add(next(scans))
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        for _ in range(12):
            totals.add(next(scans))
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert after - before < IMAGES * 94 * 60
    told = totals.summary()
    assert told["scans"] == 17
    assert told["alarms"] == {"wall": 17}
    assert sum(told["shares"].values()) == pytest.approx(1)
