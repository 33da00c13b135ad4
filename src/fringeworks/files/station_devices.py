"""What ``station.toml`` says of its two devices, kind by kind; `kind` itself is the tables' key."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from fringeworks.twin.effects import LEAST_MS, MOST_MS

Name = Annotated[str, Field(min_length=1, max_length=1000)]
Count = Annotated[int, Field(ge=0, le=1000)]
Port = Annotated[int, Field(ge=1, le=65535)]
Current = Annotated[int, Field(ge=0, le=274)]
Pixels = Annotated[int, Field(ge=2, le=16384)]
Milliseconds = Annotated[float, Field(ge=0, le=MOST_MS)]
Exposure = Annotated[float, Field(ge=LEAST_MS, le=MOST_MS)]

DEFAULT_EXPOSURE_MS = 10.0
LIGHTCRAFTER_HOST = "192.168.1.100"
LIGHTCRAFTER_PORT = 21845
"""0x5555, where the DLP LightCrafter listens."""


@dataclass(frozen=True, slots=True)
class SimulatedProjectorSettings:
    """The twin's projector; `latency_ms` from the call until the image is lit."""

    latency_ms: Milliseconds = 20.0


@dataclass(frozen=True, slots=True)
class WindowSettings:
    """A window that fills one display, counted from 0, at its own resolution, px.

    Width and height are what the display must have; where they are not given it says them.
    """

    display: Count = 0
    width: Pixels | None = None
    height: Pixels | None = None


@dataclass(frozen=True, slots=True)
class LightCrafterSettings:
    """A DLP LightCrafter (DLP3000) at its address; `led_current` of red, green and blue.

    Images are static, in all colours, unless `led` names the one LED that shows them as patterns,
    each repeated every `frame_ms`; `trigger_out` signals each repetition to the camera.
    """

    host: Name = LIGHTCRAFTER_HOST
    port: Port = LIGHTCRAFTER_PORT
    led: Literal["red", "green", "blue"] | None = None
    led_current: tuple[Current, Current, Current] | None = None
    frame_ms: Annotated[float, Field(ge=1, le=1000)] = 20.0
    trigger_out: bool = False


@dataclass(frozen=True, slots=True)
class SimulatedCameraSettings:
    """The twin's camera; `exposure_ms` is its sensor's unless given."""

    exposure_ms: Exposure | None = None


@dataclass(frozen=True, slots=True)
class GenicamSettings:
    """A GigE Vision or USB3 Vision camera through Aravis; the first one found unless named.

    `trigger` is "free" (frames come by themselves), "software", or the line of a hardware trigger
    such as "Line0".
    """

    device: Name | None = None
    pixel_format: Name | None = None
    gain_db: Annotated[float, Field(ge=0, le=100)] = 0.0
    trigger: Name = "free"
    exposure_ms: Exposure = DEFAULT_EXPOSURE_MS


@dataclass(frozen=True, slots=True)
class GenTLSettings:
    """A camera through a vendor's GenTL producer, a ``.cti`` file; see `GenicamSettings`.

    The file's path is relative to the station's folder.
    """

    producer: Name
    device: Name | None = None
    pixel_format: Name | None = None
    gain_db: Annotated[float, Field(ge=0, le=100)] = 0.0
    trigger: Name = "free"
    exposure_ms: Exposure = DEFAULT_EXPOSURE_MS


@dataclass(frozen=True, slots=True)
class OpenCvSettings:
    """A webcam, or any other camera that OpenCV opens, counted from 0."""

    index: Count = 0
    width: Pixels | None = None
    height: Pixels | None = None
    exposure_ms: Exposure = DEFAULT_EXPOSURE_MS


@dataclass(frozen=True, slots=True)
class FolderSettings:
    """Images that something else writes into a folder, relative to the station's.

    Width, height and `bits` are those of the newest image that is there unless given.
    """

    path: Name
    pattern: Name = "*.png"
    width: Pixels | None = None
    height: Pixels | None = None
    bits: Literal[8, 16] | None = None
    exposure_ms: Exposure = DEFAULT_EXPOSURE_MS


@dataclass(frozen=True, slots=True)
class PluginSettings:
    """A driver of another package, found by its entry point's name; it reads `options`."""

    name: Name
    options: Mapping[str, Any] = field(default_factory=dict)
    exposure_ms: Exposure = DEFAULT_EXPOSURE_MS


ProjectorSettings: TypeAlias = (
    SimulatedProjectorSettings | WindowSettings | LightCrafterSettings | PluginSettings
)
CameraSettings: TypeAlias = (
    SimulatedCameraSettings
    | GenicamSettings
    | GenTLSettings
    | OpenCvSettings
    | FolderSettings
    | PluginSettings
)

ProjectorKind: TypeAlias = Literal["simulated", "window", "lightcrafter", "plugin"]
CameraKind: TypeAlias = Literal["simulated", "genicam", "gentl", "opencv", "folder", "plugin"]

PROJECTORS: Mapping[ProjectorKind, type[ProjectorSettings]] = MappingProxyType(
    {
        "simulated": SimulatedProjectorSettings,
        "window": WindowSettings,
        "lightcrafter": LightCrafterSettings,
        "plugin": PluginSettings,
    }
)
CAMERAS: Mapping[CameraKind, type[CameraSettings]] = MappingProxyType(
    {
        "simulated": SimulatedCameraSettings,
        "genicam": GenicamSettings,
        "gentl": GenTLSettings,
        "opencv": OpenCvSettings,
        "folder": FolderSettings,
        "plugin": PluginSettings,
    }
)
