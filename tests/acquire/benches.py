"""A short sequence, what a mirror's camera sees of it, and acquisitions of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from fringeworks.acquire import Acquisition, Timing, acquire_sequence
from fringeworks.devices import CameraDevice, Faults, Grab, SimulatedBench, VirtualClock
from fringeworks.files import read_image
from fringeworks.model import Frames, Fringe, GrayCode, PatternSet, Sensor, Sequence, Uniform
from fringeworks.patterns import frame_names, render_sequence
from fringeworks.twin.effects import Effects
from tests.devices.stages import HEIGHT, WIDTH, MirrorStage, seen

EXPOSURE_MS = 10.0
SEQUENCE = Sequence(
    WIDTH,
    HEIGHT,
    (
        PatternSet(Fringe("x", 8.0, (0.0, math.pi / 2, math.pi)), repeats=2),
        PatternSet(GrayCode("x", bits=2, cell_px=8.0)),
        PatternSet(Uniform(1.0), exposure_ms=5.0),
        PatternSet(Uniform(0.0)),
    ),
)
"""Ten images; all its patterns differ."""

NAMES = [name for row in frame_names(SEQUENCE) for name in row]


def expected() -> dict[str, Frames]:
    """What each image must show."""
    rows = zip(render_sequence(SEQUENCE), frame_names(SEQUENCE), strict=True)
    return {
        name: seen(image, item.exposure_ms or EXPOSURE_MS)
        for (item, stack), row in rows
        for name, image in zip(row, stack, strict=True)
    }


def make_bench(
    *, faults: Faults | None = None, latency_ms: float = 20.0, interval_ms: float = 33.3
) -> tuple[SimulatedBench, VirtualClock]:
    clock = VirtualClock()
    stage = MirrorStage(effects=Effects(frame_interval_ms=interval_ms))
    rng = np.random.default_rng(0)
    bench = SimulatedBench(stage, rng=rng, clock=clock, latency_ms=latency_ms, faults=faults)
    return bench, clock


def acquire(
    folder: Path,
    bench: tuple[SimulatedBench, VirtualClock] | None = None,
    *,
    camera: CameraDevice | None = None,
    **options: Any,
) -> Acquisition:
    """The sequence, from a bench without faults unless told."""
    made, clock = bench or make_bench()
    settings = {"sequence": SEQUENCE, "exposure_ms": EXPOSURE_MS, "timing": Timing(), **options}
    sequence = settings.pop("sequence")
    return acquire_sequence(
        sequence, made.projector, camera or made.camera, folder=folder, clock=clock, **settings
    )


def assert_every_image_shows_its_pattern(folder: Path, *, names: list[str] = NAMES) -> None:
    wanted = expected()
    wrong = [name for name in names if not np.array_equal(read_image(folder / name), wanted[name])]
    assert not wrong


class Interrupted:
    """A camera, and somebody who presses Ctrl-C at its k-th grab."""

    def __init__(self, camera: CameraDevice, *, at: int) -> None:
        self.name, self.width, self.height = camera.name, camera.width, camera.height
        self.sensor: Sensor = camera.sensor
        self._camera, self._left = camera, at

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        if self._left == 0:
            raise KeyboardInterrupt
        self._left -= 1
        return self._camera.grab(exposure_ms=exposure_ms, timeout_s=timeout_s)

    def close(self) -> None:
        self._camera.close()
