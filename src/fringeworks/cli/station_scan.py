"""What ``fringeworks scan`` measures: a capture that is there, or one that a station takes now."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.output import print_note
from fringeworks.cli.sequences import Preset, sequence_of
from fringeworks.cli.stopping import stoppable
from fringeworks.errors import UsageError

CAPTURE_TOML = "capture.toml"

if TYPE_CHECKING:
    from fringeworks.devices import Bench
    from fringeworks.files.station import Station
    from fringeworks.model import Capture, Rig, Sequence
    from fringeworks.model.progress import Progress

StationOption = Annotated[
    Path | None,
    typer.Option(
        "--station", help="station.toml: take the capture now, in place of a CAPTURE that is there."
    ),
]
PresetOption = Annotated[
    Preset, typer.Option("--preset", help="With --station: what to show, as `acquire` has it.")
]
KeepOption = Annotated[
    Path | None,
    typer.Option(
        "--keep",
        metavar="CAPTURE",
        help="With --station: write the capture into this folder too; an interrupted one goes on.",
    ),
]


@dataclass(frozen=True, slots=True)
class Asked:
    """Where a scan's images come from, as a command line says it."""

    capture: Path | None
    rig: Path | None
    station: Path | None
    preset: Preset
    keep: Path | None

    def check(self) -> None:
        """Refuse what does not fit together, with a UsageError."""
        if (self.capture is None) == (self.station is None):
            raise UsageError("scan needs a CAPTURE or --station, one of them")
        if self.station is None and self.rig is None:
            raise UsageError("scan needs --rig: the rig.json that `fringeworks calibrate` wrote")
        if self.station is None and self.keep is not None:
            raise UsageError("--keep belongs to --station: CAPTURE is there already")
        if self.keep is not None and (self.keep / CAPTURE_TOML).exists():
            raise UsageError(
                f"{self.keep}: holds a capture already; scan that one without --station, or choose "
                "another folder"
            )

    @property
    def rig_source(self) -> Path:
        """The file that says the rig."""
        source = self.rig or self.station
        assert source is not None
        return source


def take_or_read(asked: Asked, *, group: str | None, progress: Progress) -> tuple[Capture, Rig]:
    """The capture, read or taken, and the rig to measure it with.

    Raises
    ------
    UsageError
        There is no rig, or it is one of other devices than the station's; or as
        `acquire_sequence`.
    DeviceError
        A device failed.
    """
    from fringeworks.files import read_capture, read_rig

    calibrated = None if asked.rig is None else read_rig(asked.rig)
    if asked.station is None:
        assert asked.capture is not None
        assert calibrated is not None
        return read_capture(asked.capture, group=group, progress=progress), calibrated
    from fringeworks.files.station import read_station

    place = read_station(asked.station)
    rig = calibrated or place.rig
    if rig is None:
        raise UsageError(
            f'{asked.station}: names no rig; say rig = "rig.json" there, or give --rig'
        )
    return _take(asked, replace(place, rig=rig), progress).select(group), rig


def _take(asked: Asked, place: Station, progress: Progress) -> Capture:
    from fringeworks.acquire import count_taken
    from fringeworks.acquire.captures import CaptureTaker
    from fringeworks.devices import open_station

    taken = 0 if asked.keep is None else count_taken(asked.keep)
    if taken:
        print_note(f"{asked.keep}: {taken} images are there from an unfinished run")
    with stoppable(), open_station(place, run=taken) as bench:
        sequence = _sequence(asked.preset, bench)
        if asked.keep is not None:
            return _keep(asked.keep, sequence, place, bench=bench, progress=progress)
        taker = CaptureTaker(
            sequence,
            bench.projector,
            bench.camera,
            exposure_ms=place.exposure_ms,
            timing=place.timing,
            clock=bench.clock,
        )
        return replace(taker.take(), name=asked.preset)


def _keep(
    folder: Path, sequence: Sequence, place: Station, *, bench: Bench, progress: Progress
) -> Capture:
    from fringeworks.acquire import acquire_sequence
    from fringeworks.files import read_capture

    acquire_sequence(
        sequence,
        bench.projector,
        bench.camera,
        folder=folder,
        exposure_ms=place.exposure_ms,
        timing=place.timing,
        clock=bench.clock,
        facts=place.facts,
        progress=progress,
    )
    return read_capture(folder)


def _sequence(preset: Preset, bench: Bench) -> Sequence:
    return sequence_of(
        preset,
        width=bench.projector.width,
        height=bench.projector.height,
        axes="xy",
        steps=None,
        periods=None,
        code=None,
        inverted=None,
        codewords=None,
    )
