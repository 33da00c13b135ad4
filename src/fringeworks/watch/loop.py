"""The loop: acquire in memory, scan, look at zones, keep the cloud, log.

What does not change from scan to scan is made once: patterns are rendered, each zone's rays are
cut with its box. (The rig's table takes less time than looking it up would be worth.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from fringeworks.acquire.captures import CaptureTaker
from fringeworks.acquire.lock import locked
from fringeworks.devices import Clock, MonotonicClock
from fringeworks.devices.stations import open_station
from fringeworks.errors import DecodeError, DeviceError, UsageError
from fringeworks.files.kept_clouds import KeptClouds
from fringeworks.files.station import Station
from fringeworks.files.watch_log import ScanRow, WatchLog, ZoneRow
from fringeworks.measure.frames import move_cloud
from fringeworks.measure.zones import (
    Occupation,
    Zone,
    ZoneRules,
    ZoneView,
    look_at_zone,
    measure_zone,
)
from fringeworks.model import Cloud, GreyCurve, Rig, Sequence
from fringeworks.model.frame import Frame
from fringeworks.pipeline import scan
from fringeworks.reconstruct.full import CloudRules
from fringeworks.watch.stages import Stages

LOG, CLOUDS = "watch.sqlite", "clouds"

MakeSequence: TypeAlias = Callable[[int, int], Sequence]
"""The patterns of a projector of this width and height, px."""


@dataclass(frozen=True, slots=True)
class Watching:
    """What to look at, how often, and what to keep.

    Attributes
    ----------
    zones, rules
        What to look at, and when it is an alarm.
    frame
        Frame of zones and clouds; the camera's unless given.
    z_range_mm
        Depths to keep, as `scan` has them.
    curve
        Pre-distorts what is shown.
    every_s
        From the start of one scan to that of the next, where it takes less.
    count
        How many scans, those that failed included; None for no end.
    pause_s, most_failures
        Wait after a scan that failed, and how many in a row end it.
    most_bytes
        Of the clouds that are kept.
    """

    zones: tuple[Zone, ...] = ()
    rules: ZoneRules = field(default_factory=ZoneRules)
    frame: Frame | None = None
    z_range_mm: tuple[float, float] | None = None
    curve: GreyCurve | None = None
    every_s: float = 0.0
    count: int | None = None
    pause_s: float = 5.0
    most_failures: int = 10
    most_bytes: int = 2 * 10**9


@dataclass(frozen=True, slots=True)
class Scanned:
    """A scan that was logged: its row, what it says of each zone, and the time logging took."""

    row: ScanRow
    zones: Mapping[str, Occupation] = field(default_factory=lambda: MappingProxyType({}))
    log_s: float = 0.0

    @property
    def alarms(self) -> list[str]:
        """Names of the zones that are occupied."""
        return [name for name, found in self.zones.items() if found.alarm]


def watch(
    station: Station,
    make_sequence: MakeSequence,
    folder: Path,
    watching: Watching,
    *,
    settings: Mapping[str, object] | None = None,
    clock: Clock | None = None,
) -> Generator[Scanned, None, None]:
    """Scan after scan, each on disk before it is yielded; close the iterator to let go of all.

    A scan that fails is logged with its reason; the devices are closed, and opened again after a
    pause. `settings` are kept with the run in the log; `clock` is that of the pauses.

    Raises
    ------
    UsageError
        The station has no rig, the camera does not see a zone, or another process watches into
        `folder`; the folder has clouds of a log that is gone; or the sequence cannot be shown.
    DeviceError, DecodeError
        The last one of too many failures in a row.
    FormatError
        Log or clouds cannot be written.
    """
    rig = station.rig
    if rig is None:
        raise UsageError("watch needs the rig that measures: name its rig.json in station.toml")
    pose = watching.frame.frame_from_camera if watching.frame else None
    views = tuple(look_at_zone(zone, rig.camera, pose) for zone in watching.zones)
    with ExitStack() as opened:
        opened.enter_context(locked(folder))
        log = opened.enter_context(closing(WatchLog(folder / LOG)))
        clouds = KeptClouds(folder / CLOUDS, most_bytes=watching.most_bytes)
        _check_numbers(folder, log=log, clouds=clouds)
        devices = opened.enter_context(closing(_Devices(station, make_sequence, watching.curve)))
        run = log.begin_run(_now(), {**station.facts, **(settings or {})})
        scanner = _Scanner(devices, rig, views, clouds, watching)
        yield from _repeat(scanner, log, run=run, clock=clock or MonotonicClock())


def _check_numbers(folder: Path, *, log: WatchLog, clouds: KeptClouds) -> None:
    """Clouds that a new log would number over are not replaced unasked."""
    last = log.last_scan()
    if clouds.newest > last + 1:  # one may be of a scan that was killed before it was logged
        raise UsageError(
            f"{folder / CLOUDS}: holds scan {clouds.newest}, but {LOG} ends with scan {last}; put "
            "its log back, move the clouds away, or choose another folder"
        )


def _repeat(
    scanner: _Scanner, log: WatchLog, *, run: int, clock: Clock
) -> Generator[Scanned, None, None]:
    watching, first = scanner.watching, log.last_scan() + 1
    number, failures = first, 0
    while watching.count is None or number < first + watching.count:
        begin_s = clock.now()
        made, error = scanner.scan(number, run)
        stages = Stages()
        with stages.timed("log"):
            log.add(made.row, _zone_rows(made))
        yield Scanned(made.row, made.zones, stages.seconds["log"])
        number, failures = number + 1, 0 if error is None else failures + 1
        if error is not None:
            with suppress(DeviceError):  # what failed may fail again when it is let go of
                scanner.devices.close()
            if failures >= watching.most_failures:
                raise error
            clock.sleep(watching.pause_s)
        if watching.count is None or number < first + watching.count:
            clock.sleep(max(0.0, begin_s + watching.every_s - clock.now()))


@dataclass(frozen=True, slots=True)
class _Scanner:
    """All that a scan needs."""

    devices: _Devices
    rig: Rig
    views: tuple[ZoneView, ...]
    clouds: KeptClouds
    watching: Watching

    def scan(self, number: int, run: int) -> tuple[Scanned, DeviceError | DecodeError | None]:
        """One scan, and why it failed, if it did; its cloud is kept, and not logged yet."""
        begun, stages = _now(), Stages()
        try:
            return self._scan(ScanRow(number, run, begun), stages), None
        except (DeviceError, DecodeError) as error:
            row = ScanRow(number, run, begun, failure=str(error))
            return Scanned(replace(row, **stages.row())), error

    def _scan(self, row: ScanRow, stages: Stages) -> Scanned:
        with stages.timed("acquire"):
            capture = self.devices.taker(row.scan).take()
        with stages.timed("scan"):
            rules = CloudRules(z_range_mm=self.watching.z_range_mm)
            cloud = scan(capture, self.rig, cloud_rules=rules)
        with stages.timed("zones"):
            found = {
                view.zone.name: measure_zone(cloud, view, self.watching.rules)
                for view in self.views
            }
        with stages.timed("cloud"):
            frame = self.watching.frame
            kept = self.clouds.keep(row.scan, move_cloud(cloud, frame) if frame else cloud)
        temperature_c = capture.sensor.temperature_c
        row = replace(row, temperature_c=temperature_c, cloud=kept, **stages.row())
        return Scanned(replace(row, **_measures(cloud)), found)


class _Devices:
    """A station's devices: open from the first capture on, and again after `close`."""

    def __init__(
        self, station: Station, make_sequence: MakeSequence, curve: GreyCurve | None
    ) -> None:
        self._station, self._make_sequence, self._curve = station, make_sequence, curve
        self._opened = ExitStack()
        self._taker: CaptureTaker | None = None

    def taker(self, run: int) -> CaptureTaker:
        """What takes captures; `run` is the noise's, of a simulated station that is opened."""
        if self._taker is None:
            bench = self._opened.enter_context(open_station(self._station, run=run))
            self._taker = CaptureTaker(
                self._make_sequence(bench.projector.width, bench.projector.height),
                bench.projector,
                bench.camera,
                exposure_ms=self._station.exposure_ms,
                timing=self._station.timing,
                clock=bench.clock,
                curve=self._curve,
            )
        return self._taker

    def close(self) -> None:
        """The projector is dark, and both are let go of."""
        self._taker = None
        self._opened.close()


def _measures(cloud: Cloud) -> dict[str, Any]:
    valid = cloud.valid
    count = int(valid.sum())
    sigma = float(np.median(cloud.sigma_mm[valid])) if count else float("nan")
    return {"points": count, "valid_share": count / valid.size, "sigma_mm": sigma}


def _zone_rows(made: Scanned) -> list[ZoneRow]:
    return [_zone_row(made.row.scan, name, found) for name, found in made.zones.items()]


def _zone_row(number: int, name: str, found: Occupation) -> ZoneRow:
    empty = math.isnan(found.nearest_mm)
    x, y, z = (None, None, None) if empty else found.nearest_xyz_mm
    return ZoneRow(
        number,
        name,
        points=found.points,
        needed_points=found.needed_points,
        occupied_mm3=found.occupied_mm3,
        unseen_share=found.unseen_share,
        nearest_mm=None if empty else found.nearest_mm,
        nearest_x_mm=x,
        nearest_y_mm=y,
        nearest_z_mm=z,
        alarm=found.alarm,
    )


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
