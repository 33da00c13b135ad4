"""What an acquisition asks of a projector, of a camera and of a clock.

A device that fails raises `DeviceError` in its own words; the acquisition adds which image it was
after. One clock times both devices: the start of a frame can be held against the moment at which
an image was shown.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from fringeworks.model import Frames, Sensor


@dataclass(frozen=True, slots=True, eq=False)
class Grab:
    """One frame as a camera delivers it.

    Attributes
    ----------
    number
        The camera's own count: a frame delivered twice has one number, a lost frame leaves a gap.
    start_s
        Start of the exposure, on the acquisition's clock.
    image
        Call it for the grey levels ``(H, W)``, of a colour camera ``(H, W, 3)``, uint8 or uint16,
        every time the same. Frames that are passed over are never unpacked.
    """

    number: int
    start_s: float
    image: Callable[[], Frames]


class ProjectorDevice(Protocol):
    """Shows images of its own size, px, and depth, bits; `name` tells it from others."""

    @property
    def name(self) -> str: ...

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def bits(self) -> int: ...

    def show(self, image: Frames) -> None:
        """Show ``(height, width[, 3])`` grey levels, 0 to 2^bits - 1, until the next call.

        Returns when the device has the image; its light may come later (see `Timing.settle_ms`).
        """

    def close(self) -> None:
        """Go dark and let go of the device; a second call does nothing."""


class CameraDevice(Protocol):
    """Delivers frames of one size, px. `sensor` has its full scale, and its noise where known.

    `name` tells it from others.
    """

    @property
    def name(self) -> str: ...

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def sensor(self) -> Sensor: ...

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        """The next frame in the order in which they were taken.

        It may have waited in a buffer and show what was projected before. Frames of another
        exposure than `exposure_ms` are never delivered: a change of it empties the buffers.

        Raises
        ------
        TimeoutError
            No frame came within `timeout_s`.
        DeviceError
            The camera failed.
        """

    def close(self) -> None:
        """Let go of the device; a second call does nothing."""


class Clock(Protocol):
    """Seconds that never run backwards, from an arbitrary zero."""

    def now(self) -> float: ...

    def sleep(self, duration_s: float) -> None: ...
