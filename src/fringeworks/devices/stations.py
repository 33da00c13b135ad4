"""The devices of a station, opened."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from fringeworks.devices.clocks import VirtualClock
from fringeworks.devices.protocols import CameraDevice, Clock, ProjectorDevice
from fringeworks.devices.simulated import SimulatedBench
from fringeworks.files.station import Station


@dataclass(frozen=True, slots=True)
class Bench:
    """A projector, a camera, and the clock that times both."""

    projector: ProjectorDevice
    camera: CameraDevice
    clock: Clock


@contextmanager
def open_station(station: Station, *, rng: np.random.Generator) -> Iterator[Bench]:
    """The station's devices; at the end the projector is dark and both are let go.

    A simulated bench lives in virtual time: what it waits for takes none. `rng` is its noise.

    Raises
    ------
    UsageError
        The scene cannot be seen by the rig (see `twin.stage.Stage`).
    """
    from fringeworks.twin.stage import Stage

    clock = VirtualClock()
    stage = Stage(station.scene, station.rig, station.effects)
    made = SimulatedBench(stage, rng=rng, clock=clock, latency_ms=station.latency_ms)
    try:
        yield Bench(made.projector, made.camera, clock)
    finally:
        made.projector.close()
        made.camera.close()
