"""A camera that is a folder: some other program takes images and writes them there.

What is there at the start is old; each further name is a frame, once its file is complete. Its
exposure is taken to have begun its duration before the file was last written, by this machine's
clock. That is an upper bound, as taking and writing the image need time; `settle_ms` has to cover
it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from fringeworks.devices.protocols import Grab
from fringeworks.errors import DeviceError, FormatError
from fringeworks.files.image_header import inspect_image
from fringeworks.files.images import read_image
from fringeworks.files.station_devices import FolderSettings
from fringeworks.model import Frames, Sensor

POLL_S = 0.02
STABLE_S = 0.1
"""How long a file must not have grown to be taken for complete."""

DEFAULT_BITS = 8

State = tuple[int, int]
"""Bytes of a file, and when it was last written, ns."""


class FolderCamera:
    """A `CameraDevice`; `make_sensor` tells the sensor from the full scale of the images' bits.

    Raises
    ------
    DeviceError
        There is no such folder, or neither settings nor images tell the size.
    """

    def __init__(self, settings: FolderSettings, make_sensor: Callable[[float], Sensor]) -> None:
        self._folder, self._settings = Path(settings.path), settings
        self.name = f"images in {self._folder.name}"
        self._done = set(self._list())
        self.width, self.height, self._bits = self._measure()
        self.sensor = make_sensor(float(2**self._bits - 1))
        self._growing: dict[Path, tuple[State, float]] = {}
        self._number = 0

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        """See `CameraDevice`; the other program sets the exposure: DeviceError for another one."""
        if exposure_ms != self._settings.exposure_ms:
            raise DeviceError(
                f"{self._folder}: exposure_ms must be {self._settings.exposure_ms:g} as in the "
                f"station, got {exposure_ms:g}: what takes the images sets it"
            )
        end_s = time.monotonic() + timeout_s
        while (grab := self._look()) is None:
            if time.monotonic() >= end_s:
                raise TimeoutError(f"no complete new image within {timeout_s:g} s")
            time.sleep(POLL_S)
        return grab

    def close(self) -> None:
        """Nothing to let go of."""

    def _list(self) -> list[Path]:
        if not self._folder.is_dir():
            raise DeviceError(f"{self._folder}: is no folder; say in the station where images come")
        try:
            return list(self._folder.glob(self._settings.pattern))
        except (NotImplementedError, ValueError) as error:
            raise DeviceError(
                f"pattern must be names in the folder, such as *.png, got "
                f"'{self._settings.pattern}' ({error})"
            ) from error

    def _measure(self) -> tuple[int, int, int]:
        """Width, height, px, and bits."""
        settings, newest = self._settings, max(self._done, key=_written_ns, default=None)
        if settings.width is not None and settings.height is not None and settings.bits is not None:
            return settings.width, settings.height, settings.bits
        if newest is None:
            if settings.width is None or settings.height is None:
                raise DeviceError(
                    f"{self._folder}: has no image like {settings.pattern} that tells the size; "
                    "take one, or give width and height"
                )
            return settings.width, settings.height, DEFAULT_BITS
        header = inspect_image(newest)
        return (
            settings.width or header.width,
            settings.height or header.height,
            settings.bits or header.bits,
        )

    def _look(self) -> Grab | None:
        """The oldest new image that is complete."""
        fresh = [path for path in self._list() if path not in self._done]
        for path in sorted(fresh, key=lambda path: (_written_ns(path), path.name)):
            image = self._read(path)
            if image is not None:
                self._done.add(path)
                del self._growing[path]
                self._number += 1
                return Grab(self._number, self._start_of(path), partial(_same, image))
        return None

    def _read(self, path: Path) -> Frames | None:
        """The image of a file that has stopped growing; None where it is not complete."""
        try:
            told = path.stat()
        except OSError:  # renamed or removed meanwhile
            return None
        state, now_s = (told.st_size, told.st_mtime_ns), time.monotonic()
        before, since_s = self._growing.get(path, (None, now_s))
        self._growing[path] = (state, since_s if state == before else now_s)
        if state != before or now_s - since_s < STABLE_S:
            return None
        try:
            image = read_image(path)
        except FormatError:  # a part of it so far
            return None
        if 8 * image.dtype.itemsize != self._bits:
            raise DeviceError(f"{path}: must have {self._bits} bit, got {8 * image.dtype.itemsize}")
        return image

    def _start_of(self, path: Path) -> float:
        """On the monotonic clock; a file from the future is refused: its age is not known."""
        age_s = time.time() - _written_ns(path) / 1e9
        if age_s < 0:
            raise DeviceError(
                f"{path}: was written {-age_s:.3g} s from now by this machine's clock; set the "
                "clocks of all machines that write there"
            )
        return time.monotonic() - age_s - self._settings.exposure_ms / 1000


def _same(image: Frames) -> Frames:
    return image


def _written_ns(path: Path) -> int:
    """When a file was last written; 0 where it is gone."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0
