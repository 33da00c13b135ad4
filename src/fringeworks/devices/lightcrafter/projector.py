"""A DLP LightCrafter (DLP3000) as a projector.

Its 608 x 684 mirrors stand on a diamond lattice: column x of row y is at x + (y mod 2) / 2 columns,
and two rows are as high as one column is wide. Images address the mirrors themselves, one pixel
each, so nothing is resampled; a calibration takes columns as `conventions` has them.

Without `led` images are shown in static mode, all three LEDs in turn. With it they are 8 bit
patterns of one LED, each repeated every `frame_ms`; only these are signalled at the trigger
output.
"""

from __future__ import annotations

import struct
from contextlib import suppress

import numpy as np

from fringeworks.devices.lightcrafter.connection import Connection
from fringeworks.devices.lightcrafter.packets import Command
from fringeworks.errors import DeviceError, ShapeError
from fringeworks.files.station_devices import LightCrafterSettings
from fringeworks.model import Frames

WIDTH, HEIGHT = 608, 684

STATIC_IMAGE, PATTERN_SEQUENCE = 0, 4
"""Display modes."""

LEDS = {"red": 0, "green": 1, "blue": 2}

NORMAL_PATTERN, REPEAT, AUTO_TRIGGER = 0, 1, 1
SIGNAL_US = 200
"""Length of the pulse at the trigger output."""

BMP_HEADER = struct.Struct("<2sIHHI")
BMP_INFO = struct.Struct("<IiiHHIIiiII")
PIXELS_PER_M = 2835


class LightCrafterProjector:
    """A `ProjectorDevice`, dark until it shows something.

    Raises
    ------
    DeviceError
        Nothing answers at the address, or the board refuses its settings.
    """

    width, height, bits = WIDTH, HEIGHT, 8

    def __init__(self, settings: LightCrafterSettings) -> None:
        self._settings, self._closed = settings, False
        self._line = Connection(settings.host, settings.port)
        try:
            version = self._line.read(Command.VERSION, b"\x00")
            self.name = f"LightCrafter {version.rstrip(bytes(1)).decode('ascii', 'replace')}"
            self._set_up()
        except DeviceError:
            self._line.close()
            raise

    def show(self, image: Frames) -> None:
        """See `ProjectorDevice`; returns when the board has unpacked the image.

        Raises
        ------
        ShapeError
            Another size than 608 x 684, or not 8 bit.
        DeviceError
            The board refused the image, or the line broke.
        """
        fits = image.shape[:2] == (HEIGHT, WIDTH) and image.shape[2:] in ((), (3,))
        if not fits or image.dtype != np.uint8:
            raise ShapeError(
                f"image must be {(HEIGHT, WIDTH)} of uint8, got {image.shape} of {image.dtype}"
            )
        if self._settings.led is None:
            self._line.write(Command.STATIC_IMAGE, to_bmp(image))
            return
        if image.ndim == 3:
            raise ShapeError(f"patterns of one LED must be grey, got {image.shape}")
        self._line.write(Command.PATTERN_RUN, b"\x00")
        self._line.write(Command.PATTERN_IMAGE, b"\x00" + to_bmp(image))
        self._line.write(Command.PATTERN_RUN, b"\x01")

    def close(self) -> None:
        """Go dark and hang up; by a new line where this one is broken or an answer is due on it."""
        if self._closed:
            return
        self._closed = True
        try:
            self._go_dark()
        except DeviceError:
            with suppress(DeviceError):
                self._line = Connection(self._settings.host, self._settings.port)
                self._go_dark()
        self._line.close()

    def _set_up(self) -> None:
        settings = self._settings
        self._go_dark()
        if settings.led_current is not None:
            self._line.write(Command.LED_CURRENT, struct.pack("<3H", *settings.led_current))
        if settings.led is None:
            return
        period_us = round(1000 * settings.frame_ms)
        signal = struct.pack("<BBBII", settings.trigger_out, 0, 0, 0, SIGNAL_US)
        self._line.write(Command.TRIGGER_OUT, signal)
        sequence = (8, 1, NORMAL_PATTERN, AUTO_TRIGGER, 0, period_us, period_us)
        tail = (LEDS[settings.led], REPEAT)
        self._line.write(Command.DISPLAY_MODE, bytes([PATTERN_SEQUENCE]))
        self._line.write(Command.PATTERN_SEQUENCE, struct.pack("<BHBBIIIBB", *sequence, *tail))

    def _go_dark(self) -> None:
        self._line.write(Command.DISPLAY_MODE, bytes([STATIC_IMAGE]))
        self._line.write(Command.STATIC_COLOUR, bytes(4))


def to_bmp(image: Frames) -> bytes:
    """A 24 bit BMP, rows from the bottom up, of ``(H, W[, 3])`` RGB uint8, W a multiple of 4."""
    height, width = image.shape[:2]
    colours = image if image.ndim == 3 else np.stack([image] * 3, axis=2)
    pixels = np.ascontiguousarray(colours[::-1, :, ::-1]).tobytes()
    start = BMP_HEADER.size + BMP_INFO.size
    head = BMP_HEADER.pack(b"BM", start + len(pixels), 0, 0, start)
    size = (BMP_INFO.size, width, height, 1, 24, 0, len(pixels), PIXELS_PER_M, PIXELS_PER_M, 0, 0)
    return head + BMP_INFO.pack(*size) + pixels
