"""Packets of the LightCrafter's command interface (TI, DLPU007, section 2).

Six bytes of header, the payload, and one byte that is the sum of all before it modulo 256. The
header is the packet's type, two bytes of command, a flag that says which part of a longer payload
this is, and the payload's length, low byte first.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

from fringeworks.errors import DeviceError

HEADER = struct.Struct("<BBBBH")
CHECKSUM_BYTES = 1
MOST_PAYLOAD = 0xFFFF

REFUSALS = {
    1: "it could not carry the command out",
    2: "it does not know the command",
    3: "it does not take the command's parameters",
    4: "it is out of memory",
    5: "its hardware failed",
    6: "its hardware is busy",
    7: "what the command needs was not set up before",
    8: "what the command names is not there",
    9: "a packet reached it with a wrong checksum",
    10: "a packet reached it with a payload of the wrong length",
    11: "the parts of a payload reached it out of order",
}
"""What the codes of an error packet mean (section 2.1)."""


class Kind(IntEnum):
    """Types of packet; the answer to a request has the next number."""

    BUSY = 0
    ERROR = 1
    WRITE = 2
    WRITTEN = 3
    READ = 4
    ANSWER = 5


class Part(IntEnum):
    """Which part of a payload a packet carries."""

    WHOLE = 0
    FIRST = 1
    MIDDLE = 2
    LAST = 3


class Command(IntEnum):
    """Commands that this driver gives (sections 2.3 and 2.4)."""

    VERSION = 0x0100
    DISPLAY_MODE = 0x0101
    LED_CURRENT = 0x0104
    STATIC_IMAGE = 0x0105
    STATIC_COLOUR = 0x0106
    PATTERN_IMAGE = 0x0401
    PATTERN_RUN = 0x0402
    TRIGGER_OUT = 0x0404
    PATTERN_SEQUENCE = 0x0480


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet; `command` has its first byte above its second."""

    kind: int
    command: int
    part: int = Part.WHOLE
    payload: bytes = b""

    def to_bytes(self) -> bytes:
        first, second = divmod(self.command, 256)
        head = HEADER.pack(self.kind, first, second, self.part, len(self.payload))
        return head + self.payload + bytes([checksum(head + self.payload)])


def checksum(body: bytes) -> int:
    """The sum of all bytes modulo 256."""
    return sum(body) % 256


def payload_length(head: bytes) -> int:
    """Bytes of payload that follow this header."""
    length: int = HEADER.unpack(head)[4]
    return length


def read_packet(data: bytes) -> Packet:
    """The packet that these bytes are.

    Raises
    ------
    DeviceError
        The checksum is wrong.
    """
    body, given = data[:-CHECKSUM_BYTES], data[-1]
    if checksum(body) != given:
        raise DeviceError(
            f"a packet came with checksum {given:#04x}, its bytes sum to {checksum(body):#04x}"
        )
    kind, first, second, part, _ = HEADER.unpack(body[: HEADER.size])
    return Packet(kind, 256 * first + second, part, body[HEADER.size :])


def split_payload(kind: Kind, command: Command, payload: bytes) -> Iterator[Packet]:
    """The packets that carry a payload of any length."""
    starts = range(0, max(len(payload), 1), MOST_PAYLOAD)
    for start in starts:
        first, last = start == 0, start == starts[-1]
        part = (
            (Part.WHOLE if last else Part.FIRST) if first else (Part.LAST if last else Part.MIDDLE)
        )
        yield Packet(kind, command, part, payload[start : start + MOST_PAYLOAD])
