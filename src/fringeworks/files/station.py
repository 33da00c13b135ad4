"""Read ``station.toml``: which devices there are, what they look at, and their timing."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce
from operator import or_
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic
from pydantic import Field

from fringeworks.errors import FormatError
from fringeworks.files.board import read_board
from fringeworks.files.capture_schema import CameraTable
from fringeworks.files.named import files_of, find_rig, find_scene
from fringeworks.files.nouns import make_noun, table_of
from fringeworks.files.rig import read_rig
from fringeworks.files.sensor import read_sensor
from fringeworks.files.station_devices import (
    CAMERAS,
    PROJECTORS,
    CameraSettings,
    FolderSettings,
    GenTLSettings,
    LightCrafterSettings,
    Milliseconds,
    Name,
    ProjectorSettings,
    SimulatedProjectorSettings,
)
from fringeworks.files.system import told
from fringeworks.files.validation import Table, check_format, read_toml, refusing, validated
from fringeworks.model import Rig, Target
from fringeworks.twin.effects import MOST_SEED, Effects
from fringeworks.twin.scene import Scene

STATION_FORMAT = "fringeworks-station/1"

SHOWN_DIGITS = 12
"""Digits of a file's SHA-256 that tell it from its earlier states."""


@dataclass(frozen=True, slots=True)
class Timing:
    """How long an acquisition waits.

    Attributes
    ----------
    settle_ms
        From showing an image until it is lit for certain: frames that begin earlier are not used.
    drop_frames
        How many frames that begin later are passed over too: for cameras that do not say when a
        frame began.
    timeout_s
        Longest wait for a frame after that.
    retries
        How often an image is shown again after a wait in vain.
    """

    settle_ms: Milliseconds = 60.0
    drop_frames: Annotated[int, Field(ge=0, le=100)] = 0
    timeout_s: Annotated[float, Field(gt=0, le=3600)] = 2.0
    retries: Annotated[int, Field(ge=0, le=100)] = 3


@dataclass(frozen=True, slots=True, eq=False)
class Simulated:
    """What simulated devices look at: the twin's scene before its rig; `seed` is the noise's."""

    scene: Scene
    rig: Rig
    effects: Effects
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """A projector, a camera, and what is known of them.

    Attributes
    ----------
    projector, camera
        Which devices, and how they are set.
    simulated
        What they look at where they are simulated: both are, or none.
    exposure_ms
        Of sets that do not say their own.
    timing
        How long an acquisition waits.
    sensor
        Grey levels of a real camera, as ``[camera]`` of a capture has them.
    rig, board
        What `scan --station` measures with and a calibration looks at, where the station says so;
        the rig of a simulated station is the true one unless it does.
    facts
        What a capture's provenance says of the station, and what must be the same when an
        acquisition goes on; files have their digest.
    """

    projector: ProjectorSettings
    camera: CameraSettings
    simulated: Simulated | None
    exposure_ms: float
    timing: Timing
    sensor: CameraTable
    rig: Rig | None
    board: Target | None
    facts: Mapping[str, str | int | float]


class SimulatedTable(Table):
    """What simulated devices look at: names, or files relative to the station's."""

    scene: Name
    rig: Name
    sensor: Name | None = None
    seed: Annotated[int, Field(ge=0, le=MOST_SEED)] = 0


def _kinds(settings: Mapping[Any, type[Any]]) -> Any:
    """A table that is one of these kinds; its key `kind` tells which."""
    tables = [table_of(noun, kind=(Literal[kind], ...)) for kind, noun in settings.items()]
    return Annotated[reduce(or_, tables), Field(discriminator="kind")]


_Format: Any = Literal["fringeworks-station/1"]
StationFile: Any = pydantic.create_model(
    "StationFile",
    __base__=Table,
    format=(_Format, ...),
    rig=(Name | None, None),
    board=(Name | None, None),
    projector=(_kinds(PROJECTORS), ...),
    camera=(_kinds(CAMERAS), ...),
    simulated=(SimulatedTable | None, None),
    sensor=(CameraTable, CameraTable()),
    timing=(TimingTable := table_of(Timing), TimingTable()),
)
"""The whole ``station.toml``."""


def read_station(path: str | Path) -> Station:
    """The station that ``station.toml`` describes, with all the files it names.

    Raises
    ------
    FormatError
        Not TOML, a key missing, unknown or out of bounds, one device simulated and the other not,
        a scene or rig that there is not; or as the readers of the files it names.
    """
    path = Path(path)
    document = read_toml(path)
    check_format(document, STATION_FORMAT, path)
    file: Any = validated(StationFile, document, path)
    projector: ProjectorSettings = make_noun(PROJECTORS[file.projector.kind], file.projector)
    camera = _beside(make_noun(CAMERAS[file.camera.kind], file.camera), path.parent)
    timing = make_noun(Timing, file.timing)
    _check_simulated(file, path)
    _check_signal(projector, path)
    simulated = None if file.simulated is None else _simulated(file.simulated, path)
    if simulated is not None and isinstance(projector, SimulatedProjectorSettings):
        _refuse_early(projector.latency_ms, timing, path)
    return Station(
        projector=projector,
        camera=camera,
        simulated=simulated,
        exposure_ms=_exposure(camera, simulated),
        timing=timing,
        sensor=file.sensor,
        rig=_rig(file, simulated, path),
        board=None if file.board is None else read_board(path.parent / file.board),
        facts=_facts(file, path),
    )


def _beside(camera: CameraSettings, folder: Path) -> CameraSettings:
    """With the paths that it names relative to the station's folder."""
    match camera:
        case FolderSettings():
            return replace(camera, path=str(folder / camera.path))
        case GenTLSettings():
            return replace(camera, producer=str(folder / camera.producer))
        case _:
            return camera


def _check_simulated(file: Any, path: Path) -> None:
    """A simulated camera sees simulated light alone."""
    kinds = {"projector": file.projector.kind, "camera": file.camera.kind}
    count = list(kinds.values()).count("simulated")
    if count == 1:
        raise FormatError(
            f"{path}: projector.kind and camera.kind must both be 'simulated' or neither, got "
            f"'{kinds['projector']}' and '{kinds['camera']}'"
        )
    if count == 2 and file.simulated is None:
        raise FormatError(f"{path}: simulated is missing: the table says what the devices look at")
    if count == 0 and file.simulated is not None:
        raise FormatError(f"{path}: simulated belongs to simulated devices, and these are not")


def _check_signal(projector: ProjectorSettings, path: Path) -> None:
    if isinstance(projector, LightCrafterSettings) and projector.trigger_out and not projector.led:
        raise FormatError(
            f"{path}: projector.trigger_out needs projector.led: only the patterns of one LED are "
            "signalled"
        )


def _simulated(table: SimulatedTable, path: Path) -> Simulated:
    folder = path.parent
    effects = Effects() if table.sensor is None else read_sensor(folder / table.sensor)
    with refusing(path):
        scene = find_scene(table.scene, beside=folder)
        rig = find_rig(table.rig, beside=folder)
    return Simulated(scene, rig, effects, table.seed)


def _exposure(camera: CameraSettings, simulated: Simulated | None) -> float:
    if camera.exposure_ms is None:
        assert simulated is not None  # only a simulated camera leaves it to its sensor
        return simulated.effects.camera.exposure_ms
    return camera.exposure_ms


def _rig(file: Any, simulated: Simulated | None, path: Path) -> Rig | None:
    if file.rig is not None:
        return read_rig(path.parent / file.rig)
    return None if simulated is None else simulated.rig


def _refuse_early(latency_ms: float, timing: Timing, path: Path) -> None:
    """Frames that begin before an image is lit show the one before, and nothing would tell."""
    if timing.settle_ms < latency_ms:
        raise FormatError(
            f"{path}: timing.settle_ms must be at least projector.latency_ms, {latency_ms:g}, got "
            f"{timing.settle_ms:g}: frames would show the image before"
        )


def _facts(file: Any, path: Path) -> dict[str, str | int | float]:
    """Both devices with their settings, and the simulated world."""
    facts: dict[str, str | int | float] = {}
    for device in ("projector", "camera"):
        settings = getattr(file, device).model_dump(exclude_none=True)
        facts[f"{device}_kind"] = settings.pop("kind")
        facts |= {f"{device}_{key}": _plain(value) for key, value in settings.items()}
    seen, folder = file.simulated, path.parent
    if seen is None:
        return facts
    facts["scene"] = _tell(seen.scene, files_of(seen.scene, beside=folder))
    facts["rig"] = _tell(seen.rig, files_of(seen.rig, beside=folder))
    if seen.sensor is not None:
        facts["sensor"] = _tell(seen.sensor, [folder / seen.sensor])
    return {**facts, "seed": seen.seed}


def _plain(value: object) -> str | int | float:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        return str(value)
    return value


def _tell(name: str, files: list[Path]) -> str:
    """A name; that of files with the digest of their content."""
    if not files:
        return name
    digest = hashlib.sha256()
    for path in files:
        with told(path, "read"):
            digest.update(path.read_bytes())
    return f"{name} (sha256 {digest.hexdigest()[:SHOWN_DIGITS]})"
