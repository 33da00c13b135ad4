"""A real X server that draws into memory, and what it shows."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fringeworks.model import Frames

DEPTH = 24


@dataclass(frozen=True)
class Screens:
    """An X server: `display` is its name, `folder` holds a frame buffer for each of its screens."""

    display: str
    folder: Path

    def shot(self, screen: int = 0) -> Frames:
        """``(H, W, 3)`` RGB, what a screen shows now (an X window dump, big-endian header)."""
        raw = (self.folder / f"Xvfb_screen{screen}").read_bytes()
        header = np.frombuffer(raw[:100], ">u4")
        width, height, stride, colours = (int(header[i]) for i in (4, 5, 12, 19))
        start = int(header[0]) + 12 * colours
        pixels = np.frombuffer(raw, np.uint8, count=height * stride, offset=start)
        return pixels.reshape(height, stride)[:, : 4 * width].reshape(height, width, 4)[..., 2::-1]


@contextmanager
def open_screens(*sizes: tuple[int, int]) -> Iterator[Screens]:
    """A server with a screen of each size, width and height in px; skips where there is none."""
    program = shutil.which("Xvfb")
    if program is None:
        pytest.skip("needs Xvfb (Debian package xvfb)")
    screens = [
        word
        for number, (width, height) in enumerate(sizes)
        for word in ("-screen", str(number), f"{width}x{height}x{DEPTH}")
    ]
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "-displayfd", "1", *screens, "-fbdir", folder, "-noreset"]
        server = subprocess.Popen(
            [*command, "-nolisten", "tcp"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        try:
            assert server.stdout is not None
            yield Screens(f":{server.stdout.readline().decode().strip()}", Path(folder))
        finally:
            server.terminate()
            server.wait()
            if server.stdout is not None:
                server.stdout.close()
