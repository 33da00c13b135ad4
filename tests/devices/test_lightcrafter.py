"""The LightCrafter's packets, held against an emulator of its server and recorded sessions."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from fringeworks.devices.lightcrafter import LightCrafterProjector
from fringeworks.devices.lightcrafter.connection import Connection
from fringeworks.devices.lightcrafter.packets import (
    Command,
    Kind,
    Packet,
    Part,
    read_packet,
    split_payload,
)
from fringeworks.devices.lightcrafter.projector import to_bmp
from fringeworks.errors import DeviceError, ShapeError
from fringeworks.files.station_devices import LightCrafterSettings
from fringeworks.model import Frames
from tests.devices.lightcrafter_emulator import HEIGHT, WIDTH, Faults, decode, emulate

SESSIONS = Path(__file__).parent / "sessions"
MODE, IMAGE, COLOUR, RUN = 0x0101, 0x0105, 0x0106, 0x0402


def noise(*shape: int) -> Frames:
    return np.random.default_rng(5).integers(0, 256, (HEIGHT, WIDTH, *shape), dtype=np.uint8)


def settings(port: int, **more: object) -> LightCrafterSettings:
    return LightCrafterSettings(host="127.0.0.1", port=port, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("shape", [(), (3,)])
def test_an_image_is_shown_mirror_for_mirror_and_it_ends_dark(shape: tuple[int, ...]) -> None:
    image = noise(*shape)
    with emulate() as (board, port):
        projector = LightCrafterProjector(settings(port, led_current=(100, 200, 274)))
        assert projector.name == "LightCrafter 4.0.1"
        assert not board.shown.any()
        projector.show(image)
        assert np.array_equal(board.shown, image if shape else np.stack([image] * 3, axis=2))
        assert board.led_current == (100, 200, 274)
        projector.close()
        projector.close()
        assert not board.shown.any()
    assert board.refused == []


def test_patterns_of_one_led_are_repeated_and_signalled() -> None:
    image = noise()
    with emulate() as (board, port):
        given = settings(port, led="green", frame_ms=16.5, trigger_out=True)
        projector = LightCrafterProjector(given)
        for shown in (image, noise(1)[::-1, :, 0]):
            projector.show(shown)
            assert board.running
            assert np.array_equal(board.shown[..., 1], shown)
        with pytest.raises(ShapeError, match="patterns of one LED must be grey"):
            projector.show(noise(3))
        assert board.sequence == (8, 1, 0, 1, 0, 16500, 16500, 1, 1)
        assert board.signal == (1, 0, 0, 0, 200)
        projector.close()
        assert (board.mode, board.shown.max()) == (0, 0)
    assert board.refused == []


@pytest.mark.parametrize("name", ["static", "patterns"])
def test_sessions_are_as_recorded_byte_for_byte(name: str) -> None:
    """Images are a ramp, of which the record keeps every packet's start and a checksum of all."""
    recorded = json.loads((SESSIONS / f"lightcrafter_{name}.json").read_text())
    ramp = np.broadcast_to((np.arange(WIDTH) % 256).astype(np.uint8), (HEIGHT, WIDTH))
    led = {} if name == "static" else {"led": "red", "trigger_out": True}
    with emulate() as (board, port):
        projector = LightCrafterProjector(settings(port, led_current=(1, 2, 274), **led))
        projector.show(ramp)
        projector.close()
    said = [[way, data[:48].hex(), len(data), data[-1]] for way, data in board.session]
    assert said == recorded


def test_a_packet_by_hand() -> None:
    """Static image mode: 02 01 01 00 01 00 00 and their sum, 05."""
    asked = Packet(Kind.WRITE, Command.DISPLAY_MODE, payload=b"\0")
    assert asked.to_bytes() == bytes.fromhex("0201010001000005")
    assert read_packet(asked.to_bytes()) == asked


@pytest.mark.parametrize(
    ("length", "parts"),
    [
        (0, [Part.WHOLE]),
        (65535, [Part.WHOLE]),
        (65536, [Part.FIRST, Part.LAST]),
        (200000, [Part.FIRST, Part.MIDDLE, Part.MIDDLE, Part.LAST]),
    ],
)
def test_long_payloads_are_split(length: int, parts: list[Part]) -> None:
    payload = bytes(range(256)) * (length // 256) + bytes(length % 256)
    packets = list(split_payload(Kind.WRITE, Command.STATIC_IMAGE, payload))
    assert [packet.part for packet in packets] == parts
    assert b"".join(packet.payload for packet in packets) == payload


def test_a_bitmap_by_another_reader() -> None:
    image = noise(3)
    read = decode(to_bmp(image))
    assert read is not None
    assert np.array_equal(read, image)
    assert struct.unpack("<ii", to_bmp(image)[18:26]) == (WIDTH, HEIGHT)


def test_a_busy_board_is_asked_again_and_answers_may_come_in_pieces() -> None:
    with emulate(Faults(pieces=True)) as (board, port):
        projector = LightCrafterProjector(settings(port))
        board.faults.busy = 3
        projector.show(noise())
        assert board.shown.any()
        projector.close()


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        (Faults(refuse={IMAGE: 4}), "refused 'static image': it is out of memory"),
        (Faults(refuse={IMAGE: 99}), "unknown reason 99"),
        (Faults(wrong_sum={IMAGE}), "came with checksum 0x.., its bytes sum to 0x.."),
        (Faults(cut={IMAGE}), "it hung up after 3 of 6 bytes"),
        (Faults(hang_up={IMAGE}), "it hung up"),
        (Faults(mute={IMAGE}), "no answer in time"),
    ],
)
def test_what_fails_is_told_and_it_is_dark_in_the_end(
    faults: Faults, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with emulate(faults) as (board, port):
        projector = LightCrafterProjector(settings(port))
        monkeypatch.setattr(projector._line, "_answer_s", 0.3)
        projector._line._socket.settimeout(0.3)
        with pytest.raises(DeviceError, match=f"LightCrafter at 127.0.0.1:{port}: .*{message}"):
            projector.show(noise())
        with pytest.raises(DeviceError, match="closed after an earlier failure"):
            projector.show(noise())
        projector.close()
        assert not board.shown.any()
        said = len(board.session)
        projector.close()
        assert len(board.session) == said


def test_always_busy() -> None:
    with emulate(Faults(busy=10**6)) as (_, port):
        line = Connection("127.0.0.1", port, answer_s=0.1)
        with pytest.raises(DeviceError, match="it has been busy for"):
            line.write(Command.DISPLAY_MODE, b"\0")


def test_nobody_there() -> None:
    with pytest.raises(DeviceError, match=r"no connection \(Connection refused\); check its power"):
        LightCrafterProjector(settings(1))


def test_a_refused_set_up_is_told() -> None:
    refusing = emulate(Faults(refuse={MODE: 7}))
    with refusing as (_, port), pytest.raises(DeviceError, match="not set up before"):
        LightCrafterProjector(settings(port))


def test_other_sizes_are_refused() -> None:
    with emulate() as (_, port):
        projector = LightCrafterProjector(settings(port))
        with pytest.raises(ShapeError, match=r"\(684, 608\) of uint8, got \(608, 684\)"):
            projector.show(np.zeros((608, 684), np.uint8))
        projector.close()


def test_an_answer_to_something_else(monkeypatch: pytest.MonkeyPatch) -> None:
    with emulate() as (board, port):
        projector = LightCrafterProjector(settings(port))
        monkeypatch.setattr(board, "answer", lambda _: bytes.fromhex("0301060000000a"))
        with pytest.raises(DeviceError, match=r"answered 'static image' \(0x0105\) with a packet"):
            projector.show(noise())
        projector.close()
