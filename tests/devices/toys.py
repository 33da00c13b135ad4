"""An installed package that brings a projector and a camera by entry points."""

from __future__ import annotations

from pathlib import Path

import pytest

MODULE = '''
"""A screen that remembers, and a camera that sees it."""
import time

import numpy as np

from fringeworks.devices import Grab
from fringeworks.model import Sensor

shown = np.zeros((16, 24), np.uint8)


class Screen:
    name, width, height, bits = "toy screen", 24, 16, 8

    def __init__(self, *, bulb="new"):
        if bulb == "broken":
            raise RuntimeError("no light")

    def show(self, image):
        global shown
        shown = image.copy()

    def close(self):
        self.show(np.zeros((16, 24), np.uint8))


class Eye:
    name, width, height, sensor = "toy eye", 24, 16, Sensor(255.0)

    def __init__(self, *, darker=1):
        self.darker, self.count = darker, 0

    def grab(self, *, exposure_ms, timeout_s):
        self.count += 1
        start_s = time.monotonic()
        seen = shown // self.darker
        return Grab(self.count, start_s, lambda: seen)

    def close(self):
        pass


def half_made():
    return object()
'''

ENTRY_POINTS = """
[fringeworks.cameras]
toy = fringeworks_toys:Eye
[fringeworks.projectors]
toy = fringeworks_toys:Screen
"""


def install_toys(
    folder: Path, monkeypatch: pytest.MonkeyPatch, *, entry_points: str = ENTRY_POINTS
) -> None:
    """As pip would: a module, and its metadata beside it."""
    site = folder / "site"
    metadata = site / "fringeworks_toys-1.0.dist-info"
    metadata.mkdir(parents=True)
    (site / "fringeworks_toys.py").write_text(MODULE)
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: fringeworks-toys\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(entry_points)
    monkeypatch.syspath_prepend(str(site))
