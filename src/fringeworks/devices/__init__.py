"""Cameras and projectors behind two small Protocols, and the clock that both are timed by."""

from fringeworks.devices.clocks import MonotonicClock, VirtualClock
from fringeworks.devices.protocols import CameraDevice, Clock, Grab, ProjectorDevice
from fringeworks.devices.simulated import Faults, SimulatedBench
from fringeworks.devices.stations import Bench, open_station

__all__ = [
    "Bench",
    "CameraDevice",
    "Clock",
    "Faults",
    "Grab",
    "MonotonicClock",
    "ProjectorDevice",
    "SimulatedBench",
    "VirtualClock",
    "open_station",
]
