"""A projector's window on a real display, and cameras that see what the display shows."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import cast

import numpy as np

from fringeworks.devices import Faults, Grab, SimulatedBench, VirtualClock
from fringeworks.devices.simulated import Exposing
from fringeworks.devices.window import WindowProjector
from fringeworks.model import Frames, Sensor
from tests.devices.screens import Screens

DRAWN_WITHIN_S = 2.0


class OnScreen:
    """A `ProjectorDevice`: the window is real, its light a screenshot before the twin's stage.

    Time is virtual: the display has drawn when `show` returns, and lights `latency_ms` later.
    """

    def __init__(self, window: WindowProjector, screens: Screens, bench: SimulatedBench) -> None:
        self._window, self._screens, self._bench = window, screens, bench
        self.name, self.bits = window.name, window.bits
        self.width, self.height = window.width, window.height

    def show(self, image: Frames) -> None:
        self._window.show(image)
        self._bench.projector.show(grey(drawn(self._screens, image)))

    def close(self) -> None:
        self._window.close()


def on_screen(
    window: WindowProjector,
    screens: Screens,
    stage: Exposing,
    *,
    seed: int,
    latency_ms: float,
    faults: Faults,
) -> tuple[OnScreen, SimulatedBench, VirtualClock]:
    """Display, screenshot, the stage as optics, and a camera that runs freely and fails."""
    clock, rng = VirtualClock(), np.random.default_rng(seed)
    bench = SimulatedBench(stage, rng=rng, clock=clock, latency_ms=latency_ms, faults=faults)
    return OnScreen(window, screens, bench), bench, clock


def drawn(screens: Screens, image: Frames) -> Frames:
    """``(H, W, 3)`` of the display when it has drawn an image, or what it shows instead."""
    end_s = time.monotonic() + DRAWN_WITHIN_S
    colours = image if image.ndim == 3 else np.stack([image] * 3, axis=2)
    while not np.array_equal(seen := screens.shot(), colours) and time.monotonic() < end_s:
        time.sleep(0.0005)
    return seen


def grey(image: Frames) -> Frames:
    return cast(Frames, np.ascontiguousarray(image[:, :, 1]))


class ScreenCamera:
    """A camera in real time: a thread takes a picture of the display every `interval_s`.

    What it sees is `late_s` old: the display's delay. Its frames are averages of what was shown
    during their exposure, from screenshots a millisecond or so apart.
    """

    name = "screen camera"

    def __init__(self, screens: Screens, *, interval_s: float, late_s: float) -> None:
        first = screens.shot()
        self.height, self.width = first.shape[:2]
        self.sensor = Sensor(255.0)
        self._screens, self._interval_s, self._late_s = screens, interval_s, late_s
        self._seen: deque[tuple[float, Frames]] = deque([(time.monotonic(), grey(first))])
        self._ended = threading.Event()
        self._number, self._next_s = -1, time.monotonic()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        now_s, exposure_s = time.monotonic(), exposure_ms / 1000
        over = max(0, int((now_s - self._next_s) / self._interval_s) - 1)
        self._number += 1 + over
        start_s = self._next_s + over * self._interval_s
        self._next_s = start_s + self._interval_s
        if (left_s := start_s + exposure_s - now_s) > timeout_s:
            time.sleep(timeout_s)
            raise TimeoutError
        time.sleep(max(0.0, left_s) + 0.004)
        image = self._exposed(start_s - self._late_s, exposure_s)
        return Grab(self._number, start_s, lambda: image)

    def close(self) -> None:
        self._ended.set()
        self._thread.join()

    def _look(self) -> None:
        """Keeps what changed in the last seconds, with the time at which it did."""
        while not self._ended.wait(0.001):
            shot = grey(self._screens.shot())
            if not np.array_equal(shot, self._seen[-1][1]):
                self._seen.append((time.monotonic(), shot))
            while len(self._seen) > 50:
                self._seen.popleft()

    def _exposed(self, start_s: float, exposure_s: float) -> Frames:
        seen = list(self._seen)
        ends = [*(begin_s for begin_s, _ in seen[1:]), float("inf")]
        total = np.zeros((self.height, self.width))
        for (begin_s, image), end_s in zip(seen, ends, strict=True):
            lit_s = min(end_s, start_s + exposure_s) - max(begin_s, start_s)
            total += max(0.0, lit_s) / exposure_s * image
        return cast(Frames, np.rint(total * 0.9).astype(np.uint8))


@contextmanager
def watched(screens: Screens, *, interval_s: float, late_s: float) -> Iterator[ScreenCamera]:
    camera = ScreenCamera(screens, interval_s=interval_s, late_s=late_s)
    try:
        yield camera
    finally:
        camera.close()
