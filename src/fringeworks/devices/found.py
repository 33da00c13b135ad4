"""Which projectors and cameras this machine has, and what it lacks to use others.

Nothing here fails: a driver that is missing or finds nothing is a reason, not an error.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from fringeworks.devices.plugins import CAMERAS, PROJECTORS
from fringeworks.errors import DeviceError, FringeworksError

VIDEO_DEVICES = Path("/sys/class/video4linux")
"""Where Linux keeps the names of its video devices."""

PRODUCERS = "GENICAM_GENTL64_PATH"
"""Where GenTL producers register their folders."""


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A device: its `role`, and what ``station.toml`` says of it, `kind` and `settings`."""

    role: str
    kind: str
    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FoundDevices:
    """Devices that are there, and a reason by kind for those that cannot be looked for."""

    devices: tuple[FoundDevice, ...]
    reasons: Mapping[str, str]


def find_devices() -> FoundDevices:
    """Look for displays, GenICam, GenTL and video cameras and for plug-ins."""
    searches: dict[str, Callable[[], Iterable[FoundDevice]]] = {
        "window": _displays,
        "genicam": _genicam_cameras,
        "gentl": _producers,
        "opencv": _webcams,
        "plugin": _plugins,
    }
    devices: list[FoundDevice] = []
    reasons: dict[str, str] = {}
    for kind, search in searches.items():
        try:
            devices += (found := list(search()))
        except FringeworksError as error:
            reasons[kind] = str(error)
        except Exception as error:  # whatever a driver raises must not hide the others
            reasons[kind] = f"{type(error).__name__}: {error}"
        else:
            if not found:
                reasons[kind] = NONE_FOUND[kind]
    return FoundDevices(tuple(devices), reasons)


NONE_FOUND = {
    "window": "no display",
    "genicam": "Aravis finds no camera: cable, power, network address?",
    "gentl": f"no producer: {PRODUCERS} names no folder with a .cti file",
    "opencv": "no /dev/video*" if sys.platform == "linux" else "not listed here; try index = 0",
    "plugin": f"no package brings one (entry points {PROJECTORS}, {CAMERAS})",
}


def _displays() -> list[FoundDevice]:
    from fringeworks.devices.window import import_pygame, list_displays

    pygame = import_pygame()
    try:
        sizes = list_displays(pygame)
    finally:
        pygame.display.quit()
    return [
        FoundDevice(
            "projector",
            "window",
            f"display of {width}x{height} px",
            {"display": number, "width": width, "height": height},
        )
        for number, (width, height) in enumerate(sizes)
    ]


def _genicam_cameras() -> list[FoundDevice]:
    from fringeworks.devices.genicam import import_aravis

    aravis, failure = import_aravis()
    try:
        aravis.update_device_list()
        numbers = range(aravis.get_n_devices())
    except failure as error:
        raise DeviceError(str(error)) from error
    return [
        FoundDevice(
            "camera",
            "genicam",
            f"{aravis.get_device_vendor(number)} {aravis.get_device_model(number)}",
            {"device": aravis.get_device_id(number)},
        )
        for number in numbers
    ]


def _producers() -> list[FoundDevice]:
    from fringeworks.devices.gentl import import_harvesters

    folders = [Path(part) for part in os.environ.get(PRODUCERS, "").split(os.pathsep) if part]
    files = [file for folder in folders for file in sorted(folder.glob("*.cti"))]
    if files:
        import_harvesters()  # of no use without a producer, so that its lack is told only here
    return [FoundDevice("camera", "gentl", file.stem, {"producer": str(file)}) for file in files]


def _webcams() -> list[FoundDevice]:
    return [
        FoundDevice("camera", "opencv", _name_of(folder), {"index": number})
        for number, folder in sorted(
            (int(folder.name.removeprefix("video")), folder)
            for folder in VIDEO_DEVICES.glob("video*")
        )
    ]


def _name_of(folder: Path) -> str:
    try:
        return (folder / "name").read_text(encoding="utf-8").strip()
    except OSError:
        return folder.name


def _plugins() -> list[FoundDevice]:
    roles = {"projector": PROJECTORS, "camera": CAMERAS}
    return [
        FoundDevice(role, "plugin", item.value, {"name": item.name})
        for role, group in roles.items()
        for item in entry_points(group=group)
    ]
