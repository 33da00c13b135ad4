"""A projector and a camera over the digital twin's stage, with the faults of real ones.

The projector's light follows `show` by a constant latency. The camera runs freely: a frame
starts every interval, whether or not anybody asks for it. Finished frames wait in a buffer in
their order; where it is full the newer frame is lost, as with drivers whose queue of buffers has
run dry. So `grab` delivers stale frames, and their content is what was lit while they were
exposed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Container
from dataclasses import dataclass
from functools import cache, partial
from typing import Protocol

import numpy as np

from fringeworks.devices.protocols import Clock, Grab
from fringeworks.errors import ShapeError
from fringeworks.model import Frames, Sensor
from fringeworks.twin.effects import Effects

BUFFERED_FRAMES = 4
"""How many finished frames a camera's driver keeps."""

Lit = list[tuple[float, Frames]]
"""Images, each with its share of an exposure."""


class Extent(Protocol):
    """Size of a device's image, px."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...


class Exposing(Protocol):
    """What a bench needs of `twin.stage.Stage`."""

    @property
    def camera(self) -> Extent: ...

    @property
    def projector(self) -> Extent: ...

    @property
    def effects(self) -> Effects: ...

    @property
    def sensor(self) -> Sensor: ...

    def expose(
        self,
        image: Frames,
        *,
        rng: np.random.Generator,
        time_s: float = 0.0,
        exposure_ms: float | None = None,
    ) -> Frames: ...


@dataclass(frozen=True, slots=True)
class Faults:
    """What goes wrong, by frame number; the camera counts all its frames from 0.

    Attributes
    ----------
    dropped
        Frames that are lost on their way: a gap in the numbers. A camera that hangs loses all,
        as ``range(40, 60)``.
    repeated
        Frames that are delivered twice, under one number. (An old image under a new number is
        nothing that numbers could tell.)
    """

    dropped: Container[int] = ()
    repeated: Container[int] = ()


class SimulatedBench:
    """A projector and a camera before one stage.

    Parameters
    ----------
    stage
        Exposes what the projector shows (`twin.stage.Stage`).
    rng
        The noise of the frames, in the order in which their images are asked for.
    clock
        Times both devices; the stage's time 0 is when the bench is made.
    latency_ms
        From `show` to the image's light.
    faults
        What goes wrong.
    """

    def __init__(
        self,
        stage: Exposing,
        *,
        rng: np.random.Generator,
        clock: Clock,
        latency_ms: float = 20.0,
        faults: Faults | None = None,
    ) -> None:
        self.projector = SimulatedProjector(stage, clock, latency_s=latency_ms / 1000)
        self.camera = SimulatedCamera(
            stage, self.projector, rng=rng, clock=clock, faults=faults or Faults()
        )


class SimulatedProjector:
    """A `ProjectorDevice`, dark until it shows something."""

    name = "simulated"

    def __init__(self, stage: Exposing, clock: Clock, *, latency_s: float) -> None:
        device = stage.projector
        self.width, self.height = device.width, device.height
        self.bits = stage.effects.projector.bits
        self._clock = clock
        self._latency_s = latency_s
        self._dark = np.zeros((self.height, self.width), np.uint8 if self.bits == 8 else np.uint16)
        self._shown = [(-math.inf, self._dark)]

    def show(self, image: Frames) -> None:
        """See `ProjectorDevice`; ShapeError for another size or type of image."""
        fits = image.shape[:2] == self._dark.shape and image.shape[2:] in ((), (3,))
        if not fits or image.dtype != self._dark.dtype:
            raise ShapeError(
                f"image must be {self._dark.shape} of {self._dark.dtype}, "
                f"got {image.shape} of {image.dtype}"
            )
        self._shown.append((self._clock.now() + self._latency_s, image.copy()))

    def close(self) -> None:
        """Show black."""
        self.show(self._dark)

    def lit(self, start_s: float, end_s: float) -> Lit:
        """Images that are lit in this interval; asked for in the order of the frames."""
        ends = [*(begin for begin, _ in self._shown[1:]), math.inf]
        over = sum(end <= start_s for end in ends)
        self._shown, ends = self._shown[over:], ends[over:]
        spans = [
            (min(end, end_s) - max(begin, start_s), image)
            for (begin, image), end in zip(self._shown, ends, strict=True)
        ]
        return [(span / (end_s - start_s), image) for span, image in spans if span > 0]


class SimulatedCamera:
    """A `CameraDevice` that takes a frame every `Effects.frame_interval_ms`."""

    name = "simulated"

    def __init__(
        self,
        stage: Exposing,
        projector: SimulatedProjector,
        *,
        rng: np.random.Generator,
        clock: Clock,
        faults: Faults,
    ) -> None:
        self.width, self.height = stage.camera.width, stage.camera.height
        self.sensor = stage.sensor
        self._stage, self._projector, self._rng = stage, projector, rng
        self._clock, self._faults = clock, faults
        self._bench_start_s = clock.now()
        self._exposure_ms = stage.effects.camera.exposure_ms
        self._number = 0
        self._start_s = clock.now()
        self._buffer: deque[Grab] = deque()

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        """See `CameraDevice`."""
        self._collect()
        self._set_exposure(exposure_ms)
        end_s = self._clock.now() + timeout_s
        while not self._buffer:
            wake_s = min(self._done_s, end_s)
            self._clock.sleep(max(0.0, wake_s - self._clock.now()))
            self._collect()
            if not self._buffer and self._done_s > end_s:
                self._clock.sleep(max(0.0, end_s - self._clock.now()))
                raise TimeoutError(f"no frame within {timeout_s:g} s")
        return self._buffer.popleft()

    def close(self) -> None:
        """Nothing to let go of."""

    @property
    def _done_s(self) -> float:
        """When the frame that is being taken will be finished."""
        return self._start_s + self._exposure_ms / 1000

    def _set_exposure(self, exposure_ms: float) -> None:
        if exposure_ms != self._exposure_ms:
            self._buffer.clear()
            self._exposure_ms, self._start_s = exposure_ms, self._clock.now()

    def _collect(self) -> None:
        """Take up all frames that are finished by now."""
        interval_ms = max(self._stage.effects.frame_interval_ms, self._exposure_ms)
        while (late_s := self._clock.now() - self._done_s) >= 0:
            if len(self._buffer) == BUFFERED_FRAMES:  # all further ones are lost
                lost = 1 + int(late_s * 1000 / interval_ms)
                self._number += lost
                self._start_s += lost * interval_ms / 1000
                continue
            for _ in range(1 + (self._number in self._faults.repeated)):
                if self._number not in self._faults.dropped:
                    self._keep()
            self._number += 1
            self._start_s += interval_ms / 1000

    def _keep(self) -> None:
        if len(self._buffer) == BUFFERED_FRAMES:  # by the repetition of a frame
            return
        twice = bool(self._buffer) and self._buffer[-1].number == self._number
        self._buffer.append(self._buffer[-1] if twice else self._frame())

    def _frame(self) -> Grab:
        lit = self._projector.lit(self._start_s, self._done_s)
        image = cache(partial(self._expose, lit, self._start_s, self._exposure_ms))
        return Grab(self._number, self._start_s, image)

    def _expose(self, lit: Lit, start_s: float, exposure_ms: float) -> Frames:
        """Frames of all images that are lit, mixed by their shares of the time.

        Light adds up so; the noise of a mixture comes out a little small.
        """
        time_s = start_s - self._bench_start_s
        seen = [
            self._stage.expose(image, rng=self._rng, time_s=time_s, exposure_ms=exposure_ms)
            for _, image in lit
        ]
        if len(seen) == 1:
            return seen[0]
        mixed: Frames = np.empty_like(seen[0])
        mixed[:] = np.rint(sum(share * frame for (share, _), frame in zip(lit, seen, strict=True)))
        return mixed
