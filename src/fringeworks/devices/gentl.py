"""Cameras through a vendor's GenTL producer, by harvesters.

Written by the documented interfaces of harvesters and genicam; no producer was at hand to try it
with. A frame's exposure began its duration before a thread fetched it, or earlier, as with
`genicam`; with the software trigger no frame begins before it is asked for.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fringeworks.devices.fetching import Arrival, FetchingThread
from fringeworks.devices.pixel_formats import choose_format, read_format, unpack
from fringeworks.devices.protocols import Grab
from fringeworks.errors import DeviceError, MissingExtraError
from fringeworks.files.station_devices import GenTLSettings
from fringeworks.model import Sensor

if TYPE_CHECKING:
    from types import ModuleType

AUTOMATICS = ("ExposureAuto", "GainAuto", "BalanceWhiteAuto")
"""What a camera may change by itself between two frames: all must be off."""


FETCHING_S = 0.1
"""How long a frame is waited for before the end or another exposure is looked for."""


class GenTLCamera:
    """A `CameraDevice`; `make_sensor` tells the sensor from the full scale of the pixel format.

    Raises
    ------
    MissingExtraError
        harvesters is not installed.
    DeviceError
        There is no such producer or camera, it is in use, or it refuses its settings.
    """

    def __init__(self, settings: GenTLSettings, make_sensor: Callable[[float], Sensor]) -> None:
        core, gentl, genapi = import_harvesters()
        self._failures: tuple[type[Exception], ...] = (
            gentl.GenericException,
            genapi.GenericException,
        )
        self._late = gentl.TimeoutException
        self._settings, self.name = settings, settings.device or "the first GenTL camera"
        self._exposure_ms: float | None = None
        self._thread: FetchingThread | None = None
        self._acquirer: Any = None
        self._harvester = core.Harvester()
        try:
            self._open()
            self._set_up()
        except DeviceError:
            self._release()
            raise
        except (*self._failures, ValueError, AttributeError) as error:
            self._release()
            raise DeviceError(f"{self.name}: {_told(error)}") from error
        self.sensor = make_sensor(self._format.full_scale)

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        """See `CameraDevice`; frames of which a part was lost are passed over."""
        if self._acquirer is None and self._thread is None:
            raise DeviceError(f"{self.name}: was let go of")
        if self._settings.trigger == "software":
            return self._ask(exposure_ms, timeout_s)
        if self._thread is None:
            self._thread = FetchingThread(
                self.name, self._fetch, release=self._release, exposure_ms=exposure_ms
            )
        return self._thread.grab(exposure_ms=exposure_ms, timeout_s=timeout_s)

    def close(self) -> None:
        """Stop, and let go of the camera and of the producer."""
        if self._thread is None:
            self._release()
        else:
            self._thread.close()

    def _release(self) -> None:
        if self._acquirer is not None:
            with suppress(*self._failures):
                self._acquirer.destroy()
        self._acquirer = None
        with suppress(*self._failures):
            self._harvester.reset()

    def _open(self) -> None:
        producer = self._settings.producer
        if not Path(producer).is_file():
            raise DeviceError(f"{producer}: there is no such producer (a .cti file)")
        self._harvester.add_file(producer)
        self._harvester.update()
        there = list(self._harvester.device_info_list)
        wanted = self._settings.device
        for place, item in enumerate(there):
            if wanted is None or wanted in (item.id_, item.serial_number, item.user_defined_name):
                self.name = f"{item.vendor} {item.model}"
                self._acquirer = self._harvester.create(place)
                return
        names = ", ".join(item.id_ for item in there) or "none"
        raise DeviceError(f"{self.name} is not there; {Path(producer).name} finds: {names}")

    def _set_up(self) -> None:
        nodes, settings = self._nodes, self._settings
        for feature in AUTOMATICS:
            if nodes.has_node(feature):
                nodes.get_node(feature).value = "Off"
        offered = list(nodes.PixelFormat.symbolics)
        chosen = settings.pixel_format or choose_format(offered)
        if chosen not in offered:
            raise DeviceError(
                f"{self.name}: pixel_format must be one of {', '.join(offered)}, got {chosen}"
            )
        self._format = read_format(chosen)
        nodes.PixelFormat.value = chosen
        if nodes.has_node("Gain"):
            nodes.Gain.value = settings.gain_db
        self._set_trigger()
        self.width, self.height = int(nodes.Width.value), int(nodes.Height.value)

    def _set_trigger(self) -> None:
        nodes, trigger = self._nodes, self._settings.trigger
        if nodes.has_node("TriggerMode"):
            nodes.TriggerMode.value = "Off"
        if trigger == "free":
            return
        there = list(nodes.TriggerSource.symbolics)
        source = "Software" if trigger == "software" else trigger
        if source not in there:
            raise DeviceError(
                f"{self.name}: trigger must be free or one of {', '.join(there)}, got {source}"
            )
        nodes.TriggerSelector.value = "FrameStart"
        nodes.TriggerSource.value = source
        nodes.TriggerMode.value = "On"

    def _expose(self, exposure_ms: float) -> None:
        """Set the exposure and begin anew, so that no frame of another one waits anywhere."""
        node = self._nodes.ExposureTime
        if not node.min <= 1000 * exposure_ms <= node.max:
            raise DeviceError(
                f"{self.name}: exposure_ms must be {node.min / 1000:g} to {node.max / 1000:g}, "
                f"got {exposure_ms:g}"
            )
        self._acquirer.stop()
        node.value = 1000 * exposure_ms
        self._acquirer.start()
        self._exposure_ms = exposure_ms

    def _ask(self, exposure_ms: float, timeout_s: float) -> Grab:
        """A frame by the software trigger."""
        try:
            return self._trigger(exposure_ms, timeout_s)
        except self._failures as error:
            raise DeviceError(f"{self.name}: {_told(error)}") from error

    def _trigger(self, exposure_ms: float, timeout_s: float) -> Grab:
        if exposure_ms != self._exposure_ms:
            self._expose(exposure_ms)
        asked_s = time.monotonic()
        self._nodes.TriggerSoftware.execute()
        while (left_s := asked_s + timeout_s - time.monotonic()) > 0:
            came = self._next(left_s)
            if came is not None:
                return Grab(came.number, asked_s, came.image)
        self._acquirer.stop()  # a late frame must not pass for the next
        self._acquirer.start()
        raise TimeoutError(f"no frame within {timeout_s:g} s")

    def _fetch(self, exposure_ms: float) -> Arrival | None:
        try:
            if exposure_ms != self._exposure_ms:
                self._expose(exposure_ms)
            return self._next(FETCHING_S)
        except self._failures as error:
            raise DeviceError(f"{self.name}: {_told(error)}") from error

    def _next(self, timeout_s: float) -> Arrival | None:
        """The next frame, unless it is late or incomplete; its bytes are copied."""
        try:
            buffer = self._acquirer.try_fetch(timeout=timeout_s, is_raw=True)
        except self._late:
            return None
        if buffer is None:
            return None
        arrived_s = time.monotonic()
        try:
            shape = (int(buffer.height), int(buffer.width))
            data = bytes(buffer.raw_buffer)[int(buffer.image_offset) :]
            image = cache(partial(unpack, data, shape, self._format))
            return Arrival(int(buffer.frame_id), arrived_s, image)
        finally:
            buffer.parent.queue_buffer(buffer)

    @property
    def _nodes(self) -> Any:
        return self._acquirer.remote_device.node_map


def import_harvesters() -> tuple[ModuleType, ModuleType, ModuleType]:
    """``harvesters.core``, ``genicam.gentl`` and ``genicam.genapi``.

    Raises
    ------
    MissingExtraError
        They are not installed.
    """
    try:
        from genicam import genapi, gentl
        from harvesters import core
    except ImportError:
        raise MissingExtraError(
            "a GenTL camera needs harvesters: pip install 'fringeworks[hardware]'"
        ) from None
    return core, gentl, genapi


def _told(error: Exception) -> str:
    return str(error) or type(error).__name__
