"""The log of `watch` and its folder of clouds, also after a process was killed."""

from __future__ import annotations

import random
import shutil
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest

from fringeworks.errors import FormatError
from fringeworks.files import read_cloud, watch_log
from fringeworks.files.atomic import replacing
from fringeworks.files.kept_clouds import KeptClouds
from fringeworks.files.watch_log import ScanRow, WatchLog, ZoneRow, read_watch_log
from fringeworks.model import Cloud

BEGUN = "2024-05-06T07:08:09.000+00:00"
KILLS = 3


def small_cloud(side: int = 16) -> Cloud:
    values = np.random.default_rng(2).random((side, side, 5)).astype(np.float32)
    return Cloud(values[..., :3], values[..., 3], values[..., 4], values[..., 4])


def zone_row(scan: int) -> ZoneRow:
    return ZoneRow(scan, "bench", 7, 3, 12.5, 0.25, 900.0, 1.0, 2.0, 899.0, alarm=True)


def test_what_is_logged_is_read(tmp_path: Path) -> None:
    path = tmp_path / "watch.sqlite"
    empty = ZoneRow(2, "bench", 0, 3, 0.0, 0.5, None, None, None, None, alarm=False)
    with closing(WatchLog(path)) as log:
        assert log.last_scan() == 0
        run = log.begin_run(BEGUN, {"scene": "wall"})
        first = ScanRow(1, run, BEGUN, 100, 0.5, 0.02, 21.5, 0.3, 0.1, 0.01, 0.02, "scan.npz")
        log.add(first, [zone_row(1)])
        failed = ScanRow(2, run, BEGUN, failure="black.png: no frame")
        log.add(failed, [empty])
        assert read_watch_log(path) == ([first, failed], [zone_row(1), empty])  # while it writes
    with closing(WatchLog(path)) as log:
        assert log.last_scan() == 2
        assert log.begin_run(BEGUN, {}) == run + 1
    assert read_watch_log(path, last=1) == ([failed], [empty])


def test_a_sigma_that_nobody_knows_is_null(tmp_path: Path) -> None:
    with closing(WatchLog(tmp_path / "watch.sqlite")) as log:
        run = log.begin_run(BEGUN, {})
        log.add(ScanRow(1, run, BEGUN, 0, 0.0, float("nan")), [])
    (row,), _ = read_watch_log(tmp_path / "watch.sqlite")
    assert row.sigma_mm is None


def test_a_reader_sees_one_moment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scan that is logged between its two questions has neither row nor zones."""
    path = tmp_path / "watch.sqlite"
    with closing(WatchLog(path)) as log:
        run = log.begin_run(BEGUN, {})
        log.add(ScanRow(1, run, BEGUN), [zone_row(1)])

        def late(*row: object) -> ScanRow:
            with suppress(FormatError):  # once
                log.add(ScanRow(2, run, BEGUN), [zone_row(2)])
            return ScanRow(*row)  # type: ignore[arg-type]

        monkeypatch.setattr(watch_log, "ScanRow", late)
        rows, zones = read_watch_log(path, last=1)
        assert log.last_scan() == 2
    assert [row.scan for row in rows] == [zone.scan for zone in zones] == [1]


def test_a_zone_without_its_scan_is_not_logged_by_half(tmp_path: Path) -> None:
    with closing(WatchLog(tmp_path / "watch.sqlite")) as log:
        run = log.begin_run(BEGUN, {})
        with pytest.raises(FormatError, match="cannot be written"):
            log.add(ScanRow(1, run, BEGUN), [zone_row(1), zone_row(1)])
        assert log.last_scan() == 0


def test_other_files_are_refused(tmp_path: Path) -> None:
    damaged, foreign = tmp_path / "damaged.sqlite", tmp_path / "foreign.sqlite"
    damaged.write_bytes(b"no database" * 100)
    with closing(sqlite3.connect(foreign)) as database:
        database.execute("CREATE TABLE mine (a)")
    for ask in (WatchLog, read_watch_log):
        with pytest.raises(FormatError, match="not a database"):
            ask(damaged)
        with pytest.raises(
            FormatError, match="format must be 'fringeworks-watch/1', got no format"
        ):
            ask(foreign)
    with pytest.raises(FormatError, match="no such file"):
        read_watch_log(tmp_path / "none.sqlite")
    with pytest.raises(FormatError, match="cannot be written"):
        WatchLog(tmp_path / "no" / "folder.sqlite")


def test_the_newest_clouds_stay(tmp_path: Path) -> None:
    cloud = small_cloud()
    KeptClouds(tmp_path / "probe", most_bytes=1).keep(1, cloud)
    size = (tmp_path / "probe" / "scan_0000001.npz").stat().st_size
    kept = KeptClouds(tmp_path / "clouds", most_bytes=3 * size)
    names = [kept.keep(number, cloud) for number in range(1, 6)]
    assert sorted(path.name for path in (tmp_path / "clouds").iterdir()) == names[2:]

    again = KeptClouds(tmp_path / "clouds", most_bytes=2 * size)  # a smaller limit, later
    assert again.keep(5, cloud) == names[4]  # replaced: no cloud more
    assert sorted(path.name for path in (tmp_path / "clouds").iterdir()) == names[3:]
    KeptClouds(tmp_path / "clouds", most_bytes=1).keep(6, cloud)
    assert [path.name for path in (tmp_path / "clouds").iterdir()] == ["scan_0000006.npz"]


def test_other_files_in_the_folder_stay_and_half_written_ones_go(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "scan_1.npz").write_bytes(b"mine too")
    with suppress(KeyboardInterrupt), replacing(tmp_path / "scan_0000001.npz") as half:
        half.write_bytes(b"half")
        shutil.copy(half, left := half.with_name(half.name[:-5] + "0.npz"))
        raise KeyboardInterrupt
    assert left.exists()
    KeptClouds(tmp_path, most_bytes=1).keep(1, small_cloud())
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "notes.txt",
        "scan_0000001.npz",
        "scan_1.npz",
    ]


WRITER = """
import sys
from pathlib import Path
from tests.files.test_watch_log import BEGUN, KeptClouds, ScanRow, WatchLog, small_cloud, zone_row
folder = Path(sys.argv[1])
log, clouds = WatchLog(folder / "watch.sqlite"), KeptClouds(folder / "clouds", most_bytes=10**7)
run, cloud = log.begin_run(BEGUN, {}), small_cloud(300)
while True:
    number = log.last_scan() + 1
    name = clouds.keep(number, cloud)
    log.add(ScanRow(number, run, BEGUN, cloud=name), [zone_row(number)])
    print(number, flush=True)
"""


def test_killed_while_it_writes(tmp_path: Path) -> None:
    """It does nothing but write, so that the kill hits a write."""
    rng, last = random.Random(5), 0
    for _ in range(KILLS):
        command = [sys.executable, "-c", WRITER, str(tmp_path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            printed = writer.stdout.readline()
            time.sleep(rng.uniform(0, 0.1))
            writer.kill()
            printed += writer.stdout.read()
        scans, zones = read_watch_log(tmp_path / "watch.sqlite")
        assert [row.scan for row in scans] == [row.scan for row in zones]
        assert [row.scan for row in scans] == list(range(1, len(scans) + 1))
        assert last < max(map(int, printed.split())) <= len(scans)  # what was told is there
        last = len(scans)
        whole = sorted((tmp_path / "clouds").glob("scan_*.npz"))
        assert all(read_cloud(path).valid.all() for path in whole)
        assert whole[-1].name >= str(scans[-1].cloud)  # one may be written and not yet logged
