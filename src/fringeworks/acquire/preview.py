"""Frame after frame of a camera while the projector shows one image."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from typing import Literal

import numpy as np

from fringeworks.acquire.looking import Look, look_at
from fringeworks.devices import Bench, Grab, ProjectorDevice
from fringeworks.errors import DeviceError
from fringeworks.files.station import Timing
from fringeworks.model import Frames

STRIPE_PX = 16

PACE_FRAMES = 10
"""Over how many frames their pace is taken."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A frame as it came, its figures, and how many there were; the pace from the second on."""

    count: int
    image: Frames
    look: Look
    full_scale: float
    frames_per_s: float | None


def watch_camera(
    bench: Bench,
    *,
    exposure_ms: float,
    timing: Timing,
    show: Literal["white", "stripes", "black"] = "white",
    frames: int | None = None,
) -> Iterator[Seen]:
    """Show one image and grab what the camera delivers, `frames` times or for ever.

    Frames from before the image had settled are left out.

    Raises
    ------
    DeviceError
        A device failed, or no frame came within `timing.timeout_s`.
    """
    bench.projector.show(plain_image(bench.projector, show))
    settled_s = bench.clock.now() + timing.settle_ms / 1000
    starts: deque[float] = deque(maxlen=PACE_FRAMES)
    for number in count(1):
        grab = _fresh(bench, exposure_ms=exposure_ms, timing=timing, settled_s=settled_s)
        starts.append(grab.start_s)
        span_s = starts[-1] - starts[0]
        image, sensor = grab.image(), bench.camera.sensor
        pace = (len(starts) - 1) / span_s if span_s > 0 else None
        yield Seen(number, image, look_at(image, sensor), sensor.full_scale, pace)
        if number == frames:
            return


def plain_image(projector: ProjectorDevice, show: Literal["white", "stripes", "black"]) -> Frames:
    """``(height, width)`` grey levels of the projector: even, or vertical stripes."""
    white = 2**projector.bits - 1
    image = np.zeros((projector.height, projector.width), np.uint8 if white < 256 else np.uint16)
    if show == "white":
        image[:] = white
    if show == "stripes":
        image[:, np.arange(projector.width) // STRIPE_PX % 2 == 0] = white
    return image


def _fresh(bench: Bench, *, exposure_ms: float, timing: Timing, settled_s: float) -> Grab:
    while True:
        try:
            grab = bench.camera.grab(exposure_ms=exposure_ms, timeout_s=timing.timeout_s)
        except TimeoutError as error:
            raise DeviceError(
                f"{bench.camera.name}: {error}; check its cable, power and trigger"
            ) from error
        if grab.start_s >= settled_s:
            return grab
