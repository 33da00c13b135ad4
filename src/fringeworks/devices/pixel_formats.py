"""Bytes of a camera's frame to grey levels, by the names of the Pixel Format Naming Convention.

Grey formats of 8 to 16 bit, unpacked, packed as GigE Vision does ("Packed") and as the convention
does ("p"), Bayer mosaics of 8 to 16 bit, and RGB. Mosaics are turned into colours by OpenCV's
bilinear filter: a fringe is seen through a colour filter there, so a monochrome camera is better.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DeviceError
from fringeworks.model import Frames

GREY_FORMATS = (
    "Mono12",
    "Mono12p",
    "Mono12Packed",
    "Mono10",
    "Mono10p",
    "Mono10Packed",
    "Mono14",
    "Mono16",
    "Mono8",
)
"""In the order in which they are chosen: Mono16 of most cameras is fewer bits in more bytes."""

COLOUR_FORMATS = (
    *(f"Bayer{order}{bits}" for bits in (12, 10, 8) for order in ("RG", "GR", "GB", "BG")),
    "RGB8",
    "BGR8",
)

_NAME = re.compile(r"(Mono|Bayer(?:RG|GR|GB|BG)|RGB|BGR)(8|10|12|14|16)(p|Packed)?")

_OPENCV_MOSAICS = {"RG": "BG", "GR": "GB", "GB": "GR", "BG": "RG"}
"""OpenCV names a mosaic by its second row and column."""


@dataclass(frozen=True, slots=True)
class PixelFormat:
    """A format by name: `kind` ("Mono", "BayerRG", "RGB"...), `bits` of a level, `packing`."""

    name: str
    kind: str
    bits: int
    packing: str

    @property
    def full_scale(self) -> float:
        return float(2**self.bits - 1)


def read_format(name: str) -> PixelFormat:
    """The format of this name.

    Raises
    ------
    DeviceError
        It is none that can be read.
    """
    found = _NAME.fullmatch(name)
    packed_grey = found is not None and found[3] and (found[1] != "Mono" or found[2] not in "1012")
    if found is None or packed_grey:
        known = ", ".join((*GREY_FORMATS, *COLOUR_FORMATS))
        raise DeviceError(f"pixel_format must be one of {known}, got {name}")
    return PixelFormat(name, found[1], int(found[2]), found[3] or "")


def choose_format(offered: list[str]) -> str:
    """The best of the formats that a camera offers: grey before colour, 12 bit before others.

    Raises
    ------
    DeviceError
        It offers none that can be read.
    """
    for name in (*GREY_FORMATS, *COLOUR_FORMATS):
        if name in offered:
            return name
    raise DeviceError(f"none of the camera's pixel formats can be read: {', '.join(offered)}")


def unpack(data: bytes, shape: tuple[int, int], form: PixelFormat) -> Frames:
    """Grey levels ``(H, W)`` of uint8 or uint16, of colour formats ``(H, W, 3)`` RGB.

    Raises
    ------
    DeviceError
        There are fewer bytes than the frame needs.
    """
    channels = 3 if form.kind in ("RGB", "BGR") else 1
    count = shape[0] * shape[1] * channels
    raw = np.frombuffer(data, np.uint8)
    needed = _bytes_of(count, form)
    if len(raw) < needed:
        raise DeviceError(f"a frame of {form.name} must have {needed} bytes, got {len(raw)}")
    levels = _levels(raw[:needed], count, form)
    if form.kind == "Mono":
        return levels.reshape(shape)
    if channels == 3:
        colours = levels.reshape(*shape, 3)
        return colours if form.kind == "RGB" else colours[..., ::-1]
    return _demosaic(levels.reshape(shape), form.kind.removeprefix("Bayer"))


def _bytes_of(count: int, form: PixelFormat) -> int:
    if form.packing == "Packed":
        return -(-count // 2) * 3
    if form.packing == "p":
        return -(-count * form.bits // 8)
    return count * (1 if form.bits == 8 else 2)


def _levels(raw: NDArray[np.uint8], count: int, form: PixelFormat) -> Frames:
    if form.packing == "Packed":
        return _of_packed(raw, form.bits)[:count]
    if form.packing == "p":
        return _of_bit_stream(raw, count, form.bits)
    return raw if form.bits == 8 else raw.view("<u2").astype(np.uint16)


def _of_packed(raw: NDArray[np.uint8], bits: int) -> Frames:
    """Two levels in three bytes: their upper eight bits outside, the lower ones between."""
    first, low, second = raw.astype(np.uint16).reshape(-1, 3).T
    spare = bits - 8
    mask = 2**spare - 1
    pairs = (first << spare | low & mask, second << spare | low >> 4 & mask)
    return np.stack(pairs, axis=1).ravel()


def _of_bit_stream(raw: NDArray[np.uint8], count: int, bits: int) -> Frames:
    """Levels one after the other, lowest bit first, over the borders of bytes."""
    stream = np.unpackbits(raw, bitorder="little")[: count * bits].reshape(count, bits)
    both = np.packbits(stream, axis=1, bitorder="little").astype(np.uint16)
    return cast(Frames, both[:, 0] | both[:, 1] << 8)


def _demosaic(mosaic: Frames, order: str) -> Frames:
    import cv2

    code: int = getattr(cv2, f"COLOR_Bayer{_OPENCV_MOSAICS[order]}2RGB")
    return cast(Frames, cv2.cvtColor(mosaic, code))
