"""GigE Vision and USB3 Vision cameras through Aravis.

A frame's exposure began its duration before the first of it arrived, or earlier: the camera takes
time to read it out. That lag is part of what `latency` measures and `settle_ms` covers. With the
software trigger the start is known: no frame begins before it is asked for.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NoReturn

from fringeworks.devices.pixel_formats import choose_format, read_format, unpack
from fringeworks.devices.protocols import Grab
from fringeworks.errors import DeviceError, MissingExtraError
from fringeworks.files.station_devices import GenicamSettings
from fringeworks.model import Sensor

if TYPE_CHECKING:
    from types import ModuleType

BUFFERS = 8
"""Frames that wait in the driver; where nobody asks for them the newer ones are lost."""

AUTOMATICS = ("ExposureAuto", "GainAuto", "BalanceWhiteAuto")
"""What a camera may change by itself between two frames: all must be off."""

READOUT_MS = 50.0
"""Longest time from the end of an exposure to its frame's first packet."""

LAST_GIGE_NUMBER = 0xFFFF
"""GigE Vision counts frames from 1 to this, then from 1 again."""

NEAR = 1000
"""Fewer frames than this are lost at once; a camera that restarts then is not told from it."""

PACKAGES = (
    "a GenICam camera needs Aravis and PyGObject: the Debian packages gir1.2-aravis-0.8, "
    "libgirepository1.0-dev and libcairo2-dev, then pip install 'fringeworks[aravis]'"
)


class GenicamCamera:
    """A `CameraDevice`; `make_sensor` tells the sensor from the full scale of the pixel format.

    Raises
    ------
    MissingExtraError
        Aravis or PyGObject is not installed.
    DeviceError
        There is no such camera, it is in use, or it refuses its settings.
    """

    def __init__(self, settings: GenicamSettings, make_sensor: Callable[[float], Sensor]) -> None:
        self._aravis, self._failure = import_aravis()
        self._settings = settings
        self._exposure_ms: float | None = None
        self._stream: Any = None
        self._camera: Any = None
        self._numbers, self._arrivals = FrameNumbers(), Arrivals()
        try:
            self._camera = self._aravis.Camera.new(settings.device)
            self._set_up()
            self.sensor = make_sensor(self._format.full_scale)
        except BaseException as error:
            self._camera = None  # who keeps the error would keep the camera from others
            if isinstance(error, self._failure):
                raise DeviceError(f"{_name_of(settings)}: {_told(error)}") from error
            raise

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        """See `CameraDevice`; frames of which a part was lost are passed over."""
        if self._camera is None:
            raise DeviceError(f"{self.name}: was let go of after it failed")
        try:
            if exposure_ms != self._exposure_ms:
                self._expose(exposure_ms)
            return self._next(timeout_s)
        except self._failure as error:
            self._stream = self._camera = None  # each further question would wait for seconds
            raise DeviceError(f"{self.name}: {_told(error)}") from error

    def close(self) -> None:
        """Stop the stream and let go of the camera, which may be gone."""
        if self._stream is not None:
            with suppress(self._failure):
                self._camera.stop_acquisition()
        self._stream = self._camera = None

    def _set_up(self) -> None:
        settings = self._settings  # a local camera would live on in a traceback
        self.name = f"{self._camera.get_vendor_name()} {self._camera.get_model_name()}"
        for feature in AUTOMATICS:
            if self._camera.is_feature_available(feature):
                self._camera.set_string(feature, "Off")
        offered = list(self._camera.dup_available_pixel_formats_as_strings())
        chosen = settings.pixel_format or choose_format(offered)
        if chosen not in offered:
            raise DeviceError(
                f"{self.name}: pixel_format must be one of {', '.join(offered)}, got {chosen}"
            )
        self._format = read_format(chosen)
        self._camera.set_pixel_format_from_string(chosen)
        if self._camera.is_gain_available():
            self._camera.set_gain(settings.gain_db)
        self._set_trigger()
        self._camera.set_acquisition_mode(self._aravis.AcquisitionMode.CONTINUOUS)
        _, _, self.width, self.height = self._camera.get_region()
        if self._camera.is_gv_device():
            self._camera.gv_auto_packet_size()

    def _set_trigger(self) -> None:
        source = {"free": None, "software": "Software"}.get(
            self._settings.trigger, self._settings.trigger
        )
        self._camera.clear_triggers()
        if source is None:
            return
        there = list(self._camera.dup_available_trigger_sources())
        if source not in there:
            known = ", ".join(("free", "software", *(item for item in there if item != "Software")))
            raise DeviceError(f"{self.name}: trigger must be one of {known}, got {source}")
        self._camera.set_trigger(source)

    def _expose(self, exposure_ms: float) -> None:
        """Set the exposure and begin anew, so that no frame of another one waits anywhere."""
        low, high = self._camera.get_exposure_time_bounds()
        if not low <= 1000 * exposure_ms <= high:
            raise DeviceError(
                f"{self.name}: exposure_ms must be {low / 1000:g} to {high / 1000:g}, "
                f"got {exposure_ms:g}"
            )
        self._restart(1000 * exposure_ms)
        self._exposure_ms = exposure_ms

    def _restart(self, exposure_us: float) -> None:
        if self._stream is None:
            self._stream = self._camera.create_stream(None, None)
            if self._stream is None:
                raise DeviceError(f"{self.name}: no stream")
        else:
            self._camera.stop_acquisition()
            self._drain()
            self._stream.stop_thread(True)
            self._stream.start_thread()
        self._camera.set_exposure_time(exposure_us)
        size = self._camera.get_payload()
        for _ in range(BUFFERS):
            self._stream.push_buffer(self._aravis.Buffer.new_allocate(size))
        self._camera.start_acquisition()

    def _drain(self) -> None:
        """A camera that is told to stop ends its frame first, which must not come after the start.

        Buffers are not given back, so that one that does not stop runs out of them.
        """
        assert self._exposure_ms is not None
        quiet_us = round(1000 * (self._exposure_ms + READOUT_MS))
        while self._stream.timeout_pop_buffer(quiet_us) is not None:
            pass

    def _next(self, timeout_s: float) -> Grab:
        asked_s = time.monotonic()
        end_s = asked_s + timeout_s
        asked = self._settings.trigger == "software"
        if asked:
            self._camera.software_trigger()
        while True:
            left_us = max(0, round(1e6 * (end_s - time.monotonic())))
            buffer = self._stream.timeout_pop_buffer(left_us)
            if buffer is None:
                self._give_up(timeout_s, late_frame=asked)
            try:
                if buffer.get_status() == self._aravis.BufferStatus.SUCCESS:
                    return self._read(buffer, asked_s if asked else None)
            finally:
                self._stream.push_buffer(buffer)

    def _give_up(self, timeout_s: float, *, late_frame: bool) -> NoReturn:
        """No frame came: is the camera still there? A late frame must not pass for the next."""
        exposure_us = self._camera.get_exposure_time()
        if late_frame:
            self._restart(exposure_us)
        raise TimeoutError(f"no frame within {timeout_s:g} s")

    def _read(self, buffer: Any, asked_s: float | None) -> Grab:
        """The bytes are copied: the buffer goes back to the driver."""
        assert self._exposure_ms is not None
        arrived_s = self._arrivals.monotonic_of(buffer.get_system_timestamp() / 1e9)
        start_s = arrived_s - self._exposure_ms / 1000 if asked_s is None else asked_s
        shape = (buffer.get_image_height(), buffer.get_image_width())
        image = cache(partial(unpack, buffer.get_data(), shape, self._format))
        return Grab(self._numbers.take(buffer.get_frame_id()), start_s, image)


class Arrivals:
    """Times of the system's clock, which may be set at any time, on the monotonic one.

    Of its latest leads over the monotonic clock the largest counts: as many are kept as frames can
    wait, so that none of before the clock was set is told to be younger than it is.
    """

    def __init__(self) -> None:
        self._leads_s: deque[float] = deque(maxlen=BUFFERS + 1)
        self._note()

    def monotonic_of(self, system_s: float) -> float:
        """The time at which the system's clock said this, or an earlier one."""
        self._note()
        return system_s - max(self._leads_s)

    def _note(self) -> None:
        now_s = time.monotonic()  # first: a pause between the two makes frames older
        self._leads_s.append(time.time() - now_s)


class FrameNumbers:
    """A camera's numbers without their wrap: a jump from the last to the first is no restart."""

    def __init__(self) -> None:
        self._last, self._turns = 0, 0

    def take(self, number: int) -> int:
        near_the_end = LAST_GIGE_NUMBER - NEAR < self._last <= LAST_GIGE_NUMBER
        if near_the_end and number < NEAR:
            self._turns += 1
        self._last = number
        return number + self._turns * LAST_GIGE_NUMBER


def import_aravis() -> tuple[ModuleType, type[Exception]]:
    """Aravis, and the error that its calls raise.

    Raises
    ------
    MissingExtraError
        It is not installed.
    """
    try:
        import gi

        gi.require_version("Aravis", "0.8")
        from gi.repository import Aravis, GLib
    except (ImportError, ValueError):
        raise MissingExtraError(PACKAGES) from None
    return Aravis, GLib.Error


def _told(error: Exception) -> str:
    """A GLib error's own words, without its domain and number."""
    return str(getattr(error, "message", error))


def _name_of(settings: GenicamSettings) -> str:
    return "the first GenICam camera" if settings.device is None else settings.device
