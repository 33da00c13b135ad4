"""Read ``station.toml``: which devices there are, what they look at, and their timing."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from fringeworks.errors import FormatError
from fringeworks.files.named import files_of, find_rig, find_scene
from fringeworks.files.sensor import read_sensor
from fringeworks.files.system import told
from fringeworks.files.validation import Table, check_format, read_toml, refusing, validated
from fringeworks.model import Rig
from fringeworks.twin.effects import LEAST_MS, MOST_MS, MOST_SEED, Effects
from fringeworks.twin.scene import Scene

STATION_FORMAT = "fringeworks-station/1"

PLANNED_KINDS = {
    "projector": ("window", "lightcrafter"),
    "camera": ("genicam", "opencv", "folder"),
}

SHOWN_DIGITS = 12
"""Digits of a file's SHA-256 that tell it from its earlier states."""

Name = Annotated[str, Field(min_length=1, max_length=1000)]
Milliseconds = Annotated[float, Field(ge=0, le=MOST_MS)]


@dataclass(frozen=True, slots=True)
class Timing:
    """How long an acquisition waits.

    Attributes
    ----------
    settle_ms
        From showing an image until it is lit for certain: frames that begin earlier are not used.
    timeout_s
        Longest wait for a frame after that.
    retries
        How often an image is shown again after a wait in vain.
    """

    settle_ms: float = 60.0
    timeout_s: float = 2.0
    retries: int = 3


DEFAULT_TIMING = Timing()


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """A simulated station: the twin's scene before its rig.

    Attributes
    ----------
    scene, rig, effects
        What the camera sees, how, and what is wrong with it.
    latency_ms
        From the call to the projector until the image is lit.
    exposure_ms
        Of sets that do not say their own.
    seed
        Of the noise.
    timing
        How long an acquisition waits.
    facts
        What a capture's provenance says of the station, and what must be the same when an
        acquisition goes on; files have their digest.
    """

    scene: Scene
    rig: Rig
    effects: Effects
    latency_ms: float
    exposure_ms: float
    seed: int
    timing: Timing
    facts: Mapping[str, str | int | float]


class ProjectorTable(Table):
    """The projector; its latency is a simulated one's."""

    kind: Literal["simulated"]
    latency_ms: Milliseconds = 20.0


class CameraTable(Table):
    """The camera."""

    kind: Literal["simulated"]
    exposure_ms: Annotated[float, Field(ge=LEAST_MS, le=MOST_MS)] | None = None


class SimulatedTable(Table):
    """What simulated devices look at: names, or files relative to the station's."""

    scene: Name
    rig: Name
    sensor: Name | None = None
    seed: Annotated[int, Field(ge=0, le=MOST_SEED)] = 0


class TimingTable(Table):
    """See `Timing`."""

    settle_ms: Milliseconds = DEFAULT_TIMING.settle_ms
    timeout_s: Annotated[float, Field(gt=0, le=3600)] = DEFAULT_TIMING.timeout_s
    retries: Annotated[int, Field(ge=0, le=100)] = DEFAULT_TIMING.retries


class StationFile(Table):
    """The whole ``station.toml``."""

    format: Literal["fringeworks-station/1"]
    projector: ProjectorTable
    camera: CameraTable
    simulated: SimulatedTable
    timing: TimingTable = TimingTable()


def read_station(path: str | Path) -> Station:
    """The station that ``station.toml`` describes, with all the files it names.

    Raises
    ------
    FormatError
        Not TOML, a key missing, unknown or out of bounds, a kind of device that is not supported
        yet, a scene or rig that there is not; or as the readers of the files it names.
    """
    path = Path(path)
    document = read_toml(path)
    check_format(document, STATION_FORMAT, path)
    _refuse_planned(document, path)
    file = validated(StationFile, document, path)
    _refuse_early(file, path)
    seen = file.simulated
    effects = Effects() if seen.sensor is None else read_sensor(path.parent / seen.sensor)
    with refusing(path):
        scene = find_scene(seen.scene, beside=path.parent)
        rig = find_rig(seen.rig, beside=path.parent)
    return Station(
        scene=scene,
        rig=rig,
        effects=effects,
        latency_ms=file.projector.latency_ms,
        exposure_ms=file.camera.exposure_ms or effects.camera.exposure_ms,
        seed=seen.seed,
        timing=Timing(**file.timing.model_dump()),
        facts=_facts(file, path),
    )


def _refuse_planned(document: Mapping[str, Any], path: Path) -> None:
    for device, planned in PLANNED_KINDS.items():
        table = document.get(device)
        kind = table.get("kind") if isinstance(table, dict) else None
        if kind in planned:
            raise FormatError(
                f"{path}: {device}.kind '{kind}' is planned, not supported yet; use simulated"
            )


def _refuse_early(file: StationFile, path: Path) -> None:
    """Frames that begin before an image is lit show the one before, and nothing would tell."""
    latency, settle = file.projector.latency_ms, file.timing.settle_ms
    if settle < latency:
        raise FormatError(
            f"{path}: timing.settle_ms must be at least projector.latency_ms, {latency:g}, got "
            f"{settle:g}: frames would show the image before"
        )


def _facts(file: StationFile, path: Path) -> dict[str, str | int | float]:
    seen, folder = file.simulated, path.parent
    facts = {
        "scene": _tell(seen.scene, files_of(seen.scene, beside=folder)),
        "rig": _tell(seen.rig, files_of(seen.rig, beside=folder)),
    }
    if seen.sensor is not None:
        facts["sensor"] = _tell(seen.sensor, [folder / seen.sensor])
    return {
        "devices": "simulated",
        **facts,
        "seed": seen.seed,
        "latency_ms": file.projector.latency_ms,
    }


def _tell(name: str, files: list[Path]) -> str:
    """A name; that of files with the digest of their content."""
    if not files:
        return name
    digest = hashlib.sha256()
    for path in files:
        with told(path, "read"):
            digest.update(path.read_bytes())
    return f"{name} (sha256 {digest.hexdigest()[:SHOWN_DIGITS]})"
