"""Levels packed by the definitions of the formats, bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from fringeworks.devices.pixel_formats import choose_format, read_format, unpack
from fringeworks.errors import DeviceError
from fringeworks.model import Frames

SHAPE = (3, 5)


def levels(bits: int) -> Frames:
    rng = np.random.default_rng(bits)
    if bits == 8:
        return rng.integers(0, 2**bits, SHAPE, dtype=np.uint8)
    return rng.integers(0, 2**bits, SHAPE, dtype=np.uint16)


def bit_stream(values: Frames, bits: int) -> bytes:
    """Lowest bit first, one level after the other, as one large number."""
    flat: list[int] = values.ravel().tolist()
    number = sum(value << bits * place for place, value in enumerate(flat))
    return number.to_bytes(-(-values.size * bits // 8), "little")


def packed(values: Frames, bits: int) -> bytes:
    """GigE Vision: upper eight bits of two levels, and between them what is left of both."""
    flat = [*values.ravel().tolist(), 0]
    spare = bits - 8
    triples = [
        bytes([a >> spare, (a % 2**spare) | (b % 2**spare) << 4, b >> spare])
        for a, b in zip(flat[0::2], flat[1::2], strict=False)
    ]
    return b"".join(triples)


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_grey_levels_unpacked(bits: int) -> None:
    values = levels(bits)
    form = read_format(f"Mono{bits}")
    read = unpack(values.tobytes() + b"padding", SHAPE, form)
    assert np.array_equal(read, values)
    assert read.dtype == values.dtype
    assert form.full_scale == 2**bits - 1


@pytest.mark.parametrize("bits", [10, 12])
@pytest.mark.parametrize("packing", ["p", "Packed"])
def test_grey_levels_packed(bits: int, packing: str) -> None:
    values = levels(bits)
    data = bit_stream(values, bits) if packing == "p" else packed(values, bits)
    read = unpack(data, SHAPE, read_format(f"Mono{bits}{packing}"))
    assert np.array_equal(read, values)


@pytest.mark.parametrize("order", ["RG", "GR", "GB", "BG"])
@pytest.mark.parametrize("bits", [8, 12])
def test_a_mosaic_of_an_even_colour_is_that_colour(order: str, bits: int) -> None:
    colour = {"R": 200, "G": 120, "B": 40}
    last = {"R": "B", "B": "R", "G": "G"}
    rows = [[order[0], order[1]], [{"RG": "G", "BG": "G"}.get(order, last[order[1]]), ""]]
    rows[1][1] = {"RG": "B", "BG": "R"}.get(order, "G")
    tile = np.array([[colour[name] for name in row] for row in rows])
    mosaic = np.tile(tile, (4, 4)).astype(np.uint8 if bits == 8 else np.uint16)
    read = unpack(mosaic.tobytes(), (8, 8), read_format(f"Bayer{order}{bits}"))
    assert read.dtype == mosaic.dtype
    assert (read[2:-2, 2:-2] == [200, 120, 40]).all()


def test_colours_come_as_rgb() -> None:
    pixels = np.arange(45, dtype=np.uint8)
    rgb = unpack(pixels.tobytes(), SHAPE, read_format("RGB8"))
    bgr = unpack(pixels.tobytes(), SHAPE, read_format("BGR8"))
    assert np.array_equal(rgb, pixels.reshape(*SHAPE, 3))
    assert np.array_equal(bgr, rgb[..., ::-1])


def test_too_few_bytes() -> None:
    with pytest.raises(DeviceError, match="a frame of Mono12p must have 23 bytes, got 22"):
        unpack(bytes(22), SHAPE, read_format("Mono12p"))


@pytest.mark.parametrize("name", ["Mono11", "YUV422Packed", "BayerRG12p", "Mono8Packed", ""])
def test_formats_that_are_not_read(name: str) -> None:
    with pytest.raises(DeviceError, match="pixel_format must be one of Mono12, "):
        read_format(name)


def test_grey_and_twelve_bits_are_chosen_first() -> None:
    assert choose_format(["RGB8", "BayerRG12", "Mono8", "Mono12Packed"]) == "Mono12Packed"
    assert choose_format(["RGB8", "BayerRG8"]) == "BayerRG8"
    with pytest.raises(DeviceError, match="can be read: YUV422"):
        choose_format(["YUV422"])
