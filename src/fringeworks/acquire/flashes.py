"""Flashes the projector and notes when each frame began and how bright it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.acquire.proof import to_grey
from fringeworks.devices import CameraDevice, Clock, Grab, ProjectorDevice
from fringeworks.errors import DeviceError
from fringeworks.model.progress import Progress, no_progress

Floats: TypeAlias = NDArray[np.float64]

HOLD_S = 0.5
HOLD_FRAMES = 8
"""Each flash lasts for both, and a random part of the camera's interval."""

LEAST_STEP = 0.01
"""From black to white, as a share of the full scale, by which a flash can be told at all."""

SATURATED = 0.97
"""Share of the full scale above which a frame's light is no longer told."""

Seen: TypeAlias = tuple[Grab, float]
"""A frame and its brightness, grey levels."""


@dataclass(frozen=True, slots=True)
class Flash:
    """One change of the projected image, to white or to black, and when it was shown, s."""

    white: bool
    shown_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What was shown and what was seen.

    Attributes
    ----------
    flashes
        In their order; the first is not looked at, nothing is known from before it.
    numbers, starts_s, levels
        ``(n,)`` of the frames: the camera's count, start on the clock, mean grey level where the
        flash is seen.
    black, white
        Levels of two still images, black and white.
    full_scale, exposure_ms
        The camera's.
    saturated
        Share of the pixels that see the flash, and are too bright to tell its size.
    """

    flashes: tuple[Flash, ...]
    numbers: NDArray[np.int64]
    starts_s: Floats
    levels: Floats
    black: float
    white: float
    full_scale: float
    exposure_ms: float
    saturated: float


def record_flashes(
    projector: ProjectorDevice,
    camera: CameraDevice,
    *,
    clock: Clock,
    exposure_ms: float,
    rng: np.random.Generator,
    flashes: int,
    progress: Progress = no_progress,
) -> Record:
    """Show white and black in turn, each for half a second or more; the projector ends black.

    Raises
    ------
    DeviceError
        The flash is not seen, no frames come, or a device failed.
    """
    watch = _Watch(projector, camera, clock, exposure_ms)
    black, white = watch.still(white=False), watch.still(white=True)
    interval_s = watch.interval_s()
    where, saturated = _where_seen(black, white, camera.sensor.full_scale)
    hold_s = max(HOLD_S, HOLD_FRAMES * interval_s)
    shown: list[Flash] = []
    seen: list[Seen] = []
    for place in progress(range(flashes + 1), "flashing"):
        lit = bool(place % 2)
        shown.append(Flash(lit, watch.show(white=lit)))
        for grab in watch.frames(hold_s + rng.uniform(0, interval_s)):
            seen.append((grab, float(to_grey(grab.image())[where].mean())))
    watch.show(white=False)
    return Record(
        tuple(shown),
        np.array([grab.number for grab, _ in seen], np.int64),
        np.array([grab.start_s for grab, _ in seen]),
        np.array([level for _, level in seen]),
        float(black[where].mean()),
        float(white[where].mean()),
        camera.sensor.full_scale,
        exposure_ms,
        saturated,
    )


class _Watch:
    """A projector that is black or white, and all frames of a while."""

    def __init__(
        self, projector: ProjectorDevice, camera: CameraDevice, clock: Clock, exposure_ms: float
    ) -> None:
        self._projector, self._camera, self._clock = projector, camera, clock
        self._exposure_ms = exposure_ms
        self._grabs: list[Grab] = []

    def show(self, *, white: bool) -> float:
        """When the call had returned, s."""
        bits, size = self._projector.bits, (self._projector.height, self._projector.width)
        level = (2**bits - 1) * white
        wide = bits > 8
        image = np.full(size, level, np.uint16) if wide else np.full(size, level, np.uint8)
        self._projector.show(image)
        return self._clock.now()

    def frames(self, duration_s: float) -> list[Grab]:
        """All that come within a time, each once."""
        grabs: list[Grab] = []
        end_s = self._clock.now() + duration_s
        while (left_s := end_s - self._clock.now()) > 0:
            try:
                grab = self._camera.grab(exposure_ms=self._exposure_ms, timeout_s=left_s)
            except TimeoutError:
                break
            if not grabs or grab.number != grabs[-1].number:
                grabs.append(grab)
        self._clock.sleep(max(0.0, end_s - self._clock.now()))
        return grabs

    def still(self, *, white: bool) -> Floats:
        """The last frame of two seconds or so of one image."""
        self.show(white=white)
        least_s = 2 * HOLD_S + 2 * HOLD_FRAMES * self._exposure_ms / 1000
        self._grabs = self.frames(least_s)
        if len(self._grabs) < 2:
            raise DeviceError(
                f"{len(self._grabs)} frames came within {least_s:g} s; check the camera's cable, "
                "power and trigger"
            )
        return to_grey(self._grabs[-1].image())

    def interval_s(self) -> float:
        """From frame to frame, of the last still image."""
        return interval_of(
            np.array([grab.number for grab in self._grabs]),
            np.array([grab.start_s for grab in self._grabs]),
        )[0]


def interval_of(numbers: NDArray[np.int64], starts_s: Floats) -> tuple[float, float]:
    """Median time from frame to frame, s, and how far most (95 %) are from it; gaps allowed for."""
    count = np.diff(numbers)
    each = np.diff(starts_s)[count > 0] / count[count > 0]
    if not each.size:
        return 0.0, 0.0
    middle = float(np.median(each))
    return middle, float(np.quantile(np.abs(each - middle), 0.95))


def _where_seen(black: Floats, white: Floats, full_scale: float) -> tuple[NDArray[np.bool_], float]:
    """Pixels that see the flash well, and the share of saturated ones among those that see it."""
    step = white - black
    strong = float(np.quantile(step, 0.99))
    if strong < LEAST_STEP * full_scale:
        raise DeviceError(
            f"the flash is not seen: black {black.mean():.1f}, white {white.mean():.1f} of "
            f"{full_scale:g} grey levels; take off the lens cap, point camera and projector at one "
            "place, keep other light away, or expose longer"
        )
    seen = step > strong / 2
    clear = seen & (white < SATURATED * full_scale)
    saturated = 1 - float(clear.sum() / seen.sum())
    return (clear if clear.any() else seen), saturated


def levels_after(record: Record) -> Sequence[float]:
    """Level to which each flash leads: the median of the last third of its frames; NaN for none."""
    ends = [*(flash.shown_s for flash in record.flashes[1:]), np.inf]
    levels = []
    for flash, end_s in zip(record.flashes, ends, strict=True):
        during = record.starts_s >= flash.shown_s
        during &= record.starts_s + record.exposure_ms / 1000 <= end_s
        found = record.levels[during]
        last = found[-max(1, len(found) // 3) :]
        levels.append(float(np.median(last)) if last.size else float("nan"))
    return levels
