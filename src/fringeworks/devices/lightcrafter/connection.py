"""Commands and answers over one TCP connection."""

from __future__ import annotations

import socket
import time

from fringeworks.devices.lightcrafter.packets import (
    CHECKSUM_BYTES,
    HEADER,
    REFUSALS,
    Command,
    Kind,
    Packet,
    payload_length,
    read_packet,
    split_payload,
)
from fringeworks.errors import DeviceError

ANSWER_S = 5.0
"""Longest wait for an answer: the board unpacks an image before it gives one."""

BUSY_RETRY_S = 0.05
"""Pause before a command is given again to a board that is busy, up to `ANSWER_S` in all."""


class Connection:
    """The board at an address. Every failure closes it: what was half said cannot be taken up.

    Raises
    ------
    DeviceError
        Nothing answers there.
    """

    def __init__(self, host: str, port: int, *, answer_s: float = ANSWER_S) -> None:
        self._place, self._answer_s = f"{host}:{port}", answer_s
        self._open = True
        try:
            self._socket = socket.create_connection((host, port), timeout=answer_s)
        except OSError as error:
            raise DeviceError(
                f"LightCrafter at {self._place}: no connection ({error.strerror or error}); check "
                "its power, the USB or network cable, and host and port in [projector]"
            ) from error

    def write(self, command: Command, payload: bytes = b"") -> None:
        """Give a command; returns when the board has taken it."""
        self._exchange(Kind.WRITE, command, payload)

    def read(self, command: Command, payload: bytes = b"") -> bytes:
        """Ask for something."""
        return self._exchange(Kind.READ, command, payload)

    def close(self) -> None:
        """Hang up; a second call does nothing."""
        if self._open:
            self._open = False
            self._socket.close()

    def _exchange(self, kind: Kind, command: Command, payload: bytes) -> bytes:
        answer = b""
        try:
            for packet in split_payload(kind, command, payload):
                answer = self._until_taken(packet)
        except (DeviceError, OSError) as error:
            self.close()
            raise DeviceError(f"LightCrafter at {self._place}: {_reason(error)}") from error
        return answer

    def _until_taken(self, packet: Packet) -> bytes:
        if not self._open:
            raise DeviceError("the connection is closed after an earlier failure")
        end_s = time.monotonic() + self._answer_s
        while True:
            self._socket.sendall(packet.to_bytes())
            answer = self._receive()
            if answer.kind != Kind.BUSY:
                return _accepted(answer, packet)
            if time.monotonic() > end_s:
                raise DeviceError(f"it has been busy for {self._answer_s:g} s")
            time.sleep(BUSY_RETRY_S)

    def _receive(self) -> Packet:
        head = self._exactly(HEADER.size)
        return read_packet(head + self._exactly(payload_length(head) + CHECKSUM_BYTES))

    def _exactly(self, count: int) -> bytes:
        """TCP delivers a packet in pieces of any size."""
        data = bytearray()
        while len(data) < count:
            piece = self._socket.recv(count - len(data))
            if not piece:
                raise DeviceError(
                    f"it hung up after {len(data)} of {count} bytes of an answer"
                    if data
                    else "it hung up"
                )
            data += piece
        return bytes(data)


def _accepted(answer: Packet, packet: Packet) -> bytes:
    """The payload of an answer that says yes.

    Its part is not looked at: boards answer every part of a long payload as if it were whole.
    """
    name = Command(packet.command).name.lower().replace("_", " ")
    if answer.kind == Kind.ERROR:
        codes = answer.payload or b"\x00"
        reasons = [REFUSALS.get(code, f"unknown reason {code}") for code in codes]
        raise DeviceError(f"it refused '{name}': {', '.join(reasons)}")
    if answer.kind != packet.kind + 1 or answer.command != packet.command:
        raise DeviceError(
            f"it answered '{name}' ({packet.command:#06x}) with a packet of type {answer.kind} "
            f"for {answer.command:#06x}"
        )
    return answer.payload


def _reason(error: Exception) -> str:
    if isinstance(error, TimeoutError):
        return "no answer in time"
    return str(getattr(error, "strerror", None) or error)
