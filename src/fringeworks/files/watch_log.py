"""``watch.sqlite``: what `watch` has measured, one row per scan and one per zone and scan.

A scan and its zones are one transaction of SQLite's write-ahead log, synced to the disk: whatever
ends the process, the file holds all scans that were logged, and none by half.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from fringeworks.errors import FormatError
from fringeworks.files.system import check_file

LOG_FORMAT = "fringeworks-watch/1"
CAVEAT = "no safety function: do not protect people by it"

_SCHEMA = """
CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE runs (run INTEGER PRIMARY KEY, started_utc TEXT NOT NULL, settings TEXT NOT NULL);
CREATE TABLE scans (
    scan INTEGER PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs,
    started_utc TEXT NOT NULL,
    points INTEGER, valid_share REAL, sigma_mm REAL, temperature_c REAL,
    acquire_s REAL, scan_s REAL, zones_s REAL, cloud_s REAL,
    cloud TEXT, failure TEXT
);
CREATE TABLE zones (
    scan INTEGER NOT NULL REFERENCES scans,
    zone TEXT NOT NULL,
    points INTEGER NOT NULL, needed_points INTEGER NOT NULL,
    occupied_mm3 REAL NOT NULL, unseen_share REAL NOT NULL,
    nearest_mm REAL, nearest_x_mm REAL, nearest_y_mm REAL, nearest_z_mm REAL,
    alarm INTEGER NOT NULL,
    PRIMARY KEY (scan, zone)
);
"""


@dataclass(frozen=True, slots=True)
class ScanRow:
    """A scan in the log; what was not reached is None.

    Attributes
    ----------
    scan, run
        Numbers, from 1.
    started_utc
        ISO 8601.
    points, valid_share, sigma_mm
        Of the cloud: count, share of all pixels, median of the random part.
    temperature_c
        As the camera's table says it.
    acquire_s, scan_s, zones_s, cloud_s
        Time that each stage took.
    cloud
        Name of its file; it may have made room since.
    failure
        Why there is no cloud.
    """

    scan: int
    run: int
    started_utc: str
    points: int | None = None
    valid_share: float | None = None
    sigma_mm: float | None = None
    temperature_c: float | None = None
    acquire_s: float | None = None
    scan_s: float | None = None
    zones_s: float | None = None
    cloud_s: float | None = None
    cloud: str | None = None
    failure: str | None = None


@dataclass(frozen=True, slots=True)
class ZoneRow:
    """A zone of a scan in the log; the nearest point is None where there is none."""

    scan: int
    zone: str
    points: int
    needed_points: int
    occupied_mm3: float
    unseen_share: float
    nearest_mm: float | None
    nearest_x_mm: float | None
    nearest_y_mm: float | None
    nearest_z_mm: float | None
    alarm: bool


_INSERTS = {
    "scans": f"INSERT INTO scans VALUES ({', '.join('?' * len(fields(ScanRow)))})",
    "zones": f"INSERT INTO zones VALUES ({', '.join('?' * len(fields(ZoneRow)))})",
}


class WatchLog:
    """The log, open for writing; it is made where there is none.

    Raises
    ------
    FormatError
        The file is no such log, damaged, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with _told(path, "written"):
            self._database = sqlite3.connect(path)
        try:
            with _told(path, "written"):
                self._prepare()
        except FormatError:
            self._database.close()
            raise

    def _prepare(self) -> None:
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.execute("PRAGMA synchronous = FULL")
        if not self._database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            about = f"INSERT INTO about VALUES ('format', '{LOG_FORMAT}'), ('note', '{CAVEAT}');"
            self._database.executescript(f"BEGIN; {_SCHEMA} {about} COMMIT;")
        _check_log(self._database, self._path)

    def last_scan(self) -> int:
        """Number of the newest scan; 0 without any."""
        with _told(self._path, "read"):
            return int(
                self._database.execute("SELECT ifnull(max(scan), 0) FROM scans").fetchone()[0]
            )

    def begin_run(self, started_utc: str, settings: Mapping[str, object]) -> int:
        """Number of a new run; `settings` must be what JSON knows."""
        with _told(self._path, "written"), self._database:
            row = (started_utc, json.dumps(settings, allow_nan=False))
            done = self._database.execute(
                "INSERT INTO runs (started_utc, settings) VALUES (?, ?)", row
            )
        assert done.lastrowid is not None  # it follows an INSERT
        return done.lastrowid

    def add(self, scan: ScanRow, zones: list[ZoneRow]) -> None:
        """A scan with its zones, on disk when this returns."""
        with _told(self._path, "written"), self._database:
            self._database.execute(_INSERTS["scans"], astuple(scan))
            self._database.executemany(_INSERTS["zones"], map(astuple, zones))

    def close(self) -> None:
        """Let go of the file."""
        self._database.close()


def read_watch_log(path: Path, *, last: int | None = None) -> tuple[list[ScanRow], list[ZoneRow]]:
    """Scans, or the last of them, and their zones, oldest first; one may be writing meanwhile.

    Raises
    ------
    FormatError
        No such file, no such log, or damaged.
    """
    check_file(path)
    since = "WHERE scan > (SELECT max(scan) FROM scans) - ?" if last else "WHERE ? IS NULL"
    address = f"{path.resolve().as_uri()}?mode=ro"
    with _told(path, "read"), closing(sqlite3.connect(address, uri=True)) as database:
        _check_log(database, path)
        database.execute("BEGIN")  # what is added between two questions is in neither answer
        scans = database.execute(f"SELECT * FROM scans {since} ORDER BY scan", (last,))
        rows = [ScanRow(*row) for row in scans]
        zones = database.execute(f"SELECT * FROM zones {since} ORDER BY scan, zone", (last,))
        return rows, [ZoneRow(*(*row[:-1], bool(row[-1]))) for row in zones]


def _check_log(database: sqlite3.Connection, path: Path) -> None:
    known = "SELECT count(*) FROM sqlite_master WHERE name = 'about'"
    found = None
    if database.execute(known).fetchone()[0]:
        found = database.execute("SELECT value FROM about WHERE key = 'format'").fetchone()
    if found is None or found[0] != LOG_FORMAT:
        got = "no format" if found is None else f"'{found[0]}'"
        raise FormatError(
            f"{path}: format must be '{LOG_FORMAT}', got {got}; choose another folder"
        )


@contextmanager
def _told(path: Path, done: str) -> Iterator[None]:
    try:
        yield
    except sqlite3.Error as error:
        raise FormatError(f"{path}: cannot be {done} ({error})") from error
