"""Drivers of other packages, by entry point.

A package names a callable under the group ``fringeworks.cameras`` or ``fringeworks.projectors``;
called with the station's `options` it returns an opened device (`CameraDevice`,
`ProjectorDevice`).
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

from fringeworks.devices.protocols import CameraDevice, ProjectorDevice
from fringeworks.errors import DeviceError, FringeworksError
from fringeworks.files.station_devices import PluginSettings

CAMERAS = "fringeworks.cameras"
PROJECTORS = "fringeworks.projectors"


def load_camera(settings: PluginSettings) -> CameraDevice:
    """The camera that a plug-in opens; DeviceError where there is none or it fails."""
    camera: CameraDevice = _open(CAMERAS, settings, ("name", "width", "height", "sensor", "grab"))
    return camera


def load_projector(settings: PluginSettings) -> ProjectorDevice:
    """The projector that a plug-in opens; DeviceError where there is none or it fails."""
    projector: ProjectorDevice = _open(
        PROJECTORS, settings, ("name", "width", "height", "bits", "show")
    )
    return projector


def _open(group: str, settings: PluginSettings, members: tuple[str, ...]) -> Any:
    found = {item.name: item for item in entry_points(group=group)}
    if settings.name not in found:
        names = ", ".join(sorted(found)) or "none"
        raise DeviceError(f"no plug-in {settings.name!r} in {group}; installed: {names}")
    try:
        device = found[settings.name].load()(**settings.options)
    except FringeworksError:
        raise
    except Exception as error:
        raise DeviceError(f"plug-in {settings.name!r} failed: {error}") from error
    members = (*members, "close")
    missing = [member for member in members if not hasattr(device, member)]
    if missing:
        raise DeviceError(
            f"plug-in {settings.name!r} must have {', '.join(members)}, got none of "
            f"{', '.join(missing)}"
        )
    return device
