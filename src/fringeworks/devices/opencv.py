"""Webcams through OpenCV, on Linux (V4L2) and Windows (Media Foundation).

A webcam sets everything by itself unless it is told not to: where it does not obey, it is refused.
It counts no frames and tells no times. A thread fetches them at once and counts what it gets:
frames that the driver loses leave no gap. A frame's exposure is taken to have
begun its duration before the frame was there. That is an upper bound: it began earlier by what
reading out, compressing and transferring take, and `settle_ms` and `drop_frames`, as `latency`
measures them, have to cover this.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, cast

from fringeworks.devices.auto_gain import switch_off_auto_gain
from fringeworks.devices.fetching import Arrival, FetchingThread
from fringeworks.devices.protocols import Grab
from fringeworks.errors import DeviceError
from fringeworks.files.images import quiet_opencv
from fringeworks.files.station_devices import OpenCvSettings
from fringeworks.model import Frames, Sensor

DRAINED_FRAMES = 5
"""Frames after a change of exposure that may be of the old one: one in the driver, one under way,
and up to three until a webcam obeys."""

EXPOSURE_TOLERANCE = 0.05
"""A webcam whose exposure differs by a larger share from what it was told is refused."""

FULL_SCALE = 255.0
OFF, NOT_THERE = 0.0, -1.0


@dataclass(frozen=True, slots=True)
class Backend:
    """How one of OpenCV's backends is told an exposure; `manual` is the mode that obeys."""

    name: str
    manual: float
    value_of_ms: Callable[[float], float]
    ms_of_value: Callable[[float], float]


BACKENDS: Mapping[str, Backend] = MappingProxyType(
    {
        "linux": Backend(
            "CAP_V4L2", 1.0, lambda ms: round(10 * ms), lambda value: max(0.0, value / 10)
        ),
        "win32": Backend(
            "CAP_MSMF",
            0.0,
            lambda ms: round(math.log2(ms / 1000)),
            lambda value: 1000 * 2**value,
        ),
    }
)
"""By `sys.platform`: units of 100 us on Linux, powers of two of a second on Windows."""


class OpenCvCamera:
    """A `CameraDevice`; colour unless the webcam sees grey levels only.

    Parameters
    ----------
    settings
        Which webcam; its size, px, must be what the settings say.
    make_sensor
        Tells the sensor from the full scale, 255.
    switch_off_gain
        Turns the automatic gain of the webcam of this number off; DeviceError where it stays on.

    Raises
    ------
    DeviceError
        There is no such webcam, it has another size, or what it changes by itself stays on.
    """

    def __init__(
        self,
        settings: OpenCvSettings,
        make_sensor: Callable[[float], Sensor],
        *,
        switch_off_gain: Callable[[int], None] = switch_off_auto_gain,
    ) -> None:
        import cv2

        self._cv2 = cv2
        self._backend = choose_backend(sys.platform)
        self.name = f"webcam {settings.index}"
        self.sensor = make_sensor(FULL_SCALE)
        with quiet_opencv():
            self._capture: Any = cv2.VideoCapture(settings.index, getattr(cv2, self._backend.name))
        self._number = 0
        try:
            self.width, self.height = self._set_up(settings)
            switch_off_gain(settings.index)
            self._set_exposure(settings.exposure_ms)
        except BaseException:
            self._capture.release()
            raise
        self._thread = FetchingThread(
            self.name,
            self._fetch,
            release=self._capture.release,
            exposure_ms=settings.exposure_ms,
        )

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        """See `CameraDevice`; `start_s` is an upper bound (see the module)."""
        return self._thread.grab(exposure_ms=exposure_ms, timeout_s=timeout_s)

    def close(self) -> None:
        """Let go of the webcam."""
        self._thread.close()

    def _set_up(self, settings: OpenCvSettings) -> tuple[int, int]:
        """Everything but the exposure; width and height, px."""
        cv2, capture = self._cv2, self._capture
        if not capture.isOpened():
            raise DeviceError(
                f"{self.name}: there is none, or another program has it; `fringeworks devices` "
                "lists what is there"
            )
        sizes = {"FRAME_WIDTH": settings.width, "FRAME_HEIGHT": settings.height}
        for key, wanted in sizes.items():
            if wanted is not None:
                capture.set(getattr(cv2, f"CAP_PROP_{key}"), float(wanted))
        width = round(capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        asked = (settings.width or width, settings.height or height)
        if asked != (width, height):
            raise DeviceError(
                f"{self.name}: size must be {asked[0]}x{asked[1]} px, got {width}x{height}"
            )
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1.0)
        self._switch_off("AUTO_WB", "white balance")
        self._switch_off("AUTOFOCUS", "focus")
        return width, height

    def _switch_off(self, key: str, words: str) -> None:
        """Turn one of the automatics off, where the webcam has it."""
        prop = getattr(self._cv2, f"CAP_PROP_{key}")
        self._capture.set(prop, OFF)
        if self._capture.get(prop) not in (OFF, NOT_THERE):
            raise DeviceError(f"{self.name}: its automatic {words} cannot be turned off")

    def _set_exposure(self, exposure_ms: float) -> None:
        cv2, capture, backend = self._cv2, self._capture, self._backend
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, backend.manual)
        if capture.get(cv2.CAP_PROP_AUTO_EXPOSURE) not in (backend.manual, NOT_THERE):
            raise DeviceError(f"{self.name}: its automatic exposure cannot be turned off")
        capture.set(cv2.CAP_PROP_EXPOSURE, backend.value_of_ms(exposure_ms))
        has_ms = backend.ms_of_value(capture.get(cv2.CAP_PROP_EXPOSURE))
        if abs(has_ms - exposure_ms) > EXPOSURE_TOLERANCE * exposure_ms:
            raise DeviceError(
                f"{self.name}: exposure_ms must be one that it has, within "
                f"{EXPOSURE_TOLERANCE:.0%}: told {exposure_ms:g}, it has {has_ms:g}"
            )
        self._exposure_ms, self._to_drain = exposure_ms, DRAINED_FRAMES

    def _fetch(self, exposure_ms: float) -> Arrival | None:
        """The next frame; None where it may be of an earlier exposure."""
        if exposure_ms != self._exposure_ms:
            self._set_exposure(exposure_ms)
        fetched = self._capture.grab()
        arrived_s = time.monotonic()
        decoded, image = self._capture.retrieve() if fetched else (False, None)
        if not decoded or image is None:
            raise DeviceError(f"{self.name}: delivers no frames any more; check its cable")
        self._number += 1
        if self._to_drain > 0:
            self._to_drain -= 1
            return None
        levels = cast(Frames, image if image.ndim == 2 else image[..., ::-1])
        return Arrival(self._number, arrived_s, lambda: levels)


def choose_backend(platform: str) -> Backend:
    """The backend of an operating system, by the name that `sys.platform` gives it.

    Raises
    ------
    DeviceError
        OpenCV cannot set exposures there.
    """
    if platform not in BACKENDS:
        raise DeviceError(
            "webcams can be used on Linux and Windows: elsewhere OpenCV cannot set their exposure"
        )
    return BACKENDS[platform]
