"""The devices of a station, opened: each driver is imported when its kind is asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass

import numpy as np

from fringeworks.devices.clocks import MonotonicClock, VirtualClock
from fringeworks.devices.plugins import load_camera, load_projector
from fringeworks.devices.protocols import CameraDevice, Clock, ProjectorDevice
from fringeworks.devices.simulated import SimulatedBench
from fringeworks.errors import UsageError
from fringeworks.files.station import Simulated, Station
from fringeworks.files.station_devices import (
    CameraSettings,
    FolderSettings,
    GenicamSettings,
    GenTLSettings,
    LightCrafterSettings,
    OpenCvSettings,
    PluginSettings,
    ProjectorSettings,
    SimulatedCameraSettings,
    SimulatedProjectorSettings,
    WindowSettings,
)
from fringeworks.model import Camera, Projector, Rig


@dataclass(frozen=True, slots=True)
class Bench:
    """A projector, a camera, and the clock that times both."""

    projector: ProjectorDevice
    camera: CameraDevice
    clock: Clock


@contextmanager
def open_station(station: Station, *, run: int = 0) -> Iterator[Bench]:
    """The station's devices; at the end the projector is dark and both are let go.

    A simulated bench lives in virtual time: what it waits for takes none. Its noise is another one
    for each `run`: one that goes on must not draw the noise of the first again.

    Raises
    ------
    DeviceError
        A device is not there, or refuses its settings.
    MissingExtraError
        A driver needs a package that is not installed.
    UsageError
        The station's rig is one of other devices; a simulated scene cannot be seen by the rig
        (see `twin.stage.Stage`).
    """
    with ExitStack() as opened:
        if station.simulated is not None:
            bench = _simulated(station, station.simulated, run=run)
            opened.enter_context(closing(bench.camera))
            opened.enter_context(closing(bench.projector))
        else:
            camera = opened.enter_context(closing(open_camera(station.camera, station)))
            projector = opened.enter_context(closing(open_projector(station.projector)))
            bench = Bench(projector, camera, MonotonicClock())
        if station.rig is not None:
            check_rig(station.rig, bench)
        yield bench


def check_rig(rig: Rig, bench: Bench) -> None:
    """Refuse a rig of other devices: its numbers would mean nothing.

    Raises
    ------
    UsageError
        A device has another size than the rig's.
    """
    pairs: list[tuple[str, ProjectorDevice | CameraDevice, Projector | Camera]] = [
        ("projector", bench.projector, rig.projector),
        ("camera", bench.camera, rig.camera),
    ]
    for name, device, known in pairs:
        if (device.width, device.height) != (known.width, known.height):
            raise UsageError(
                f"the rig's {name} must be {device.width}x{device.height} px like {device.name}, "
                f"got {known.width}x{known.height} px: calibrate this station"
            )


def open_projector(settings: ProjectorSettings) -> ProjectorDevice:
    """A real projector, dark; the caller closes it. Fails as `open_station`."""
    match settings:
        case WindowSettings():
            from fringeworks.devices.window import WindowProjector

            return WindowProjector(settings)
        case LightCrafterSettings():
            from fringeworks.devices.lightcrafter import LightCrafterProjector

            return LightCrafterProjector(settings)
        case PluginSettings():
            return load_projector(settings)
        case SimulatedProjectorSettings():
            raise AssertionError("a simulated projector comes with its bench")


def open_camera(settings: CameraSettings, station: Station) -> CameraDevice:
    """A real camera, delivering; the caller closes it. Fails as `open_station`."""
    sensor = station.sensor
    match settings:
        case GenicamSettings():
            from fringeworks.devices.genicam import GenicamCamera

            return GenicamCamera(settings, sensor.sensor)
        case GenTLSettings():
            from fringeworks.devices.gentl import GenTLCamera

            return GenTLCamera(settings, sensor.sensor)
        case OpenCvSettings():
            from fringeworks.devices.opencv import OpenCvCamera

            return OpenCvCamera(settings, sensor.sensor)
        case FolderSettings():
            from fringeworks.devices.folder import FolderCamera

            return FolderCamera(settings, sensor.sensor)
        case PluginSettings():
            return load_camera(settings)
        case SimulatedCameraSettings():
            raise AssertionError("a simulated camera comes with its bench")


def _simulated(station: Station, seen: Simulated, *, run: int) -> Bench:
    from fringeworks.twin.stage import Stage

    assert isinstance(station.projector, SimulatedProjectorSettings)
    clock, rng = VirtualClock(), np.random.default_rng([seen.seed, run])
    stage = Stage(seen.scene, seen.rig, seen.effects)
    latency_ms = station.projector.latency_ms
    made = SimulatedBench(stage, rng=rng, clock=clock, latency_ms=latency_ms)
    return Bench(made.projector, made.camera, clock)
