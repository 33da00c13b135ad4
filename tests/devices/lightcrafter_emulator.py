"""A LightCrafter's command server on loopback: the same packets, and what it was told to show."""

from __future__ import annotations

import socketserver
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import cast

import cv2
import numpy as np

from fringeworks.model import Frames

HEIGHT, WIDTH = 684, 608
VERSION = b"4.0.1".ljust(32, b"\0")
BUSY, ERROR, WRITE, READ = 0, 1, 2, 4
FAILED, UNKNOWN, PARAMETER, NOT_READY, SUM, LENGTH, ORDER = 1, 2, 3, 7, 9, 10, 11


@dataclass
class Faults:
    """What goes wrong, each once.

    Attributes
    ----------
    busy
        How many packets are answered by "busy".
    refuse
        Commands that are refused, with the code.
    wrong_sum, cut, hang_up, mute
        Commands whose answer has a wrong checksum, ends in its middle, or does not come since the
        server hangs up or says nothing.
    pieces
        Whether answers come byte by byte.
    """

    busy: int = 0
    refuse: dict[int, int] = field(default_factory=dict)
    wrong_sum: set[int] = field(default_factory=set)
    cut: set[int] = field(default_factory=set)
    hang_up: set[int] = field(default_factory=set)
    mute: set[int] = field(default_factory=set)
    pieces: bool = False


@dataclass
class Board:
    """State of the board. `shown` is ``(684, 608, 3)`` RGB; `session` all bytes, by direction."""

    faults: Faults = field(default_factory=Faults)
    mode: int = 2
    led_current: tuple[int, ...] = (0, 0, 0)
    signal: tuple[int, ...] = ()
    sequence: tuple[int, ...] = ()
    running: bool = False
    shown: Frames = field(default_factory=lambda: np.full((HEIGHT, WIDTH, 3), 77, np.uint8))
    pattern: Frames | None = None
    session: list[tuple[str, bytes]] = field(default_factory=list)
    refused: list[int] = field(default_factory=list)
    _parts: bytes = b""
    _after: int = 0

    def answer(self, data: bytes) -> bytes:
        """The packet that answers one packet."""
        kind, first, second, part, length = struct.unpack("<BBBBH", data[:6])
        command, payload = 256 * first + second, data[6:-1]
        if self.faults.busy:
            self.faults.busy -= 1
            return packet(BUSY, command)
        code, reply = self._take(kind, command, part, payload)
        if sum(data[:-1]) % 256 != data[-1]:
            code = SUM
        elif length != len(payload):
            code = LENGTH
        code = self.faults.refuse.pop(command, code)
        if code:
            self.refused.append(code)
            return packet(ERROR, command, bytes([code]))
        answer = packet(kind + 1, command, reply)
        if command in self.faults.wrong_sum:
            self.faults.wrong_sum.remove(command)
            answer = answer[:-1] + bytes([(answer[-1] + 1) % 256])
        return answer

    def _take(self, kind: int, command: int, part: int, payload: bytes) -> tuple[int, bytes]:
        """Code, or 0 and the answer's payload; parts are put together first (0 1 2 3 as ruled)."""
        if (part in (2, 3)) != (self._after == command and bool(self._after)):
            return ORDER, b""
        self._parts = self._parts + payload if part in (2, 3) else payload
        self._after = command if part in (1, 2) else 0
        if self._after:
            return 0, b""
        if kind == READ:
            return (0, VERSION) if command == 0x0100 else (UNKNOWN, b"")
        return self._write(command, self._parts), b""

    def _write(self, command: int, payload: bytes) -> int:
        match command:
            case 0x0101 if len(payload) == 1 and payload[0] in (0, 1, 2, 4):
                self.mode = payload[0]
            case 0x0104 if len(payload) == 6:
                self.led_current = struct.unpack("<3H", payload)
            case 0x0105 if self.mode == 0:
                return self._show(decode(payload))
            case 0x0106 if self.mode == 0 and len(payload) == 4:
                self.shown = np.full((HEIGHT, WIDTH, 3), tuple(payload[:3]), np.uint8)
            case 0x0404 if len(payload) == 11:
                self.signal = struct.unpack("<BBBII", payload)
            case 0x0480 if self.mode == 4 and len(payload) == 19:
                self.sequence = struct.unpack("<BHBBIIIBB", payload)
            case 0x0401 if self.sequence and not self.running:
                self.pattern = decode(payload[1:])
                return 0 if self.pattern is not None else LENGTH
            case 0x0402 if self.mode == 4 and payload == b"\0":
                self.running = False
            case 0x0402 if self.mode == 4 and payload == b"\1":
                self.running = True
                return self._show(self.pattern)
            case 0x0105 | 0x0106 | 0x0401 | 0x0402 | 0x0480:
                return NOT_READY
            case 0x0101 | 0x0104 | 0x0404:
                return PARAMETER
            case _:
                return UNKNOWN
        return 0

    def _show(self, image: Frames | None) -> int:
        if image is None:
            return LENGTH
        self.shown = image
        return 0


def packet(kind: int, command: int, payload: bytes = b"") -> bytes:
    """As written in the interface guide, apart from the driver's own."""
    body = bytes([kind, command >> 8, command & 255, 0, len(payload) & 255, len(payload) >> 8])
    body += payload
    return body + bytes([sum(body) & 255])


def decode(data: bytes) -> Frames | None:
    """RGB of a BMP that fills the mirrors, else None."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None or image.shape[:2] != (HEIGHT, WIDTH):
        return None
    return cast(Frames, np.ascontiguousarray(image[..., ::-1]))


class _Handler(socketserver.BaseRequestHandler):
    server: _Server

    def handle(self) -> None:
        board = self.server.board
        while head := self._exactly(6):
            rest = self._exactly(int.from_bytes(head[4:6], "little") + 1)
            board.session.append(("to", head + rest))
            if not self._say(board, 256 * head[1] + head[2], board.answer(head + rest)):
                return

    def _say(self, board: Board, command: int, answer: bytes) -> bool:
        faults = board.faults
        if command in faults.hang_up:
            faults.hang_up.remove(command)
            return False
        if command in faults.mute:
            faults.mute.remove(command)
            return True
        if command in faults.cut:
            faults.cut.remove(command)
            self.request.sendall(answer[:3])
            return False
        board.session.append(("from", answer))
        for piece in [answer[i : i + 1] for i in range(len(answer))] if faults.pieces else [answer]:
            self.request.sendall(piece)
        return True

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            try:
                piece = self.request.recv(count - len(data))
            except OSError:
                return b""
            if not piece:
                return b""
            data += piece
        return data


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, board: Board) -> None:
        self.board = board
        super().__init__(("127.0.0.1", 0), _Handler)


@contextmanager
def emulate(faults: Faults | None = None) -> Iterator[tuple[Board, int]]:
    """A board and the port that it listens at."""
    board = Board(faults or Faults())
    with _Server(board) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield board, server.server_address[1]
        finally:
            server.shutdown()
            thread.join()
