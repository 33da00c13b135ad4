"""Captures made with plain numpy from the formulas of docs/conventions.md.

Independent of `fringeworks.patterns` on purpose: what encodes here must not share an error with
the package. The scene is a row of projector coordinates, known at every camera pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import (
    Axis,
    Capture,
    Frames,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Sensor,
    Sequence,
    Uniform,
)

Array = NDArray[np.float64]

SENSOR_8 = Sensor(255.0)
SENSOR_16 = Sensor(65535.0)


def equal_shifts(count: int) -> tuple[float, ...]:
    return tuple(2 * np.pi * n / count for n in range(count))


def fringe_waves(fringe: Fringe, u: Array) -> Array:
    """cos(2 pi (u - zero) / P - shift), -1 to 1, one frame per shift."""
    turns = (u - fringe.zero_px) / fringe.period_px
    return np.stack([np.cos(2 * np.pi * turns - shift) for shift in fringe.shifts_rad])


def gray_rows(code: GrayCode) -> NDArray[np.bool_]:
    """``(n, cells)``: lit or not, frame by frame; cells are halves where there is a complement.

    Written as the list of codewords: the one before, then the same in reverse with the bit set.
    """
    words = [""]
    for _ in range(code.bits + code.complementary):
        words = ["0" + word for word in words] + ["1" + word for word in reversed(words)]
    rows = np.array([[bit == "1" for bit in word] for word in words]).T
    if code.inverted:
        rows = np.concatenate([rows, ~rows[: code.bits]])
    return rows


def gray_light(code: GrayCode, u: Array, *, blur_px: float = 0.0) -> Array:
    """Share of a box of `blur_px` about u that is lit, 0 to 1 (blur_px = 0: lit or not).

    The first and the last cell go on for ever.
    """
    rows = gray_rows(code)
    if blur_px == 0:
        cell = np.floor((u + 0.5) / code.code_px).astype(int)
        return rows[:, np.clip(cell, 0, rows.shape[1] - 1)].astype(float)
    edges = np.arange(rows.shape[1] + 1) * code.code_px - 0.5
    edges[0], edges[-1] = edges[0] - blur_px, edges[-1] + blur_px
    shares = []
    for row in rows:
        lit_until = np.concatenate([[0.0], np.cumsum(row * np.diff(edges))])
        upper, lower = (np.interp(u + s * blur_px / 2, edges, lit_until) for s in (1, -1))
        shares.append((upper - lower) / blur_px)
    return np.stack(shares)


@dataclass(frozen=True)
class Scene:
    """What a camera of `sensor` sees of light from projector coordinates `u` along `axis`.

    A fringe has grey levels ``offset + modulation * wave``; dark and bright are the ends of that.
    `offset` and `modulation` are numbers or ``(H, W)``. Noise has the variance
    ``read^2 + gain * grey`` (`read`, `gain`), added where a generator is given.
    """

    u: Array
    extent: int
    axis: Axis = "x"
    offset: Array | float = 120.0
    modulation: Array | float = 100.0
    sensor: Sensor = SENSOR_8
    read: float = 0.0
    gain: float = 0.0
    blur_px: float = 0.0

    @property
    def eight_bits(self) -> bool:
        return self.sensor.full_scale <= 255

    def light(self, pattern: Pattern) -> Array:
        """-1 (dark) to 1 (bright)."""
        match pattern:
            case Fringe():
                return fringe_waves(pattern, self.u)
            case GrayCode():
                return 2 * gray_light(pattern, self.u, blur_px=self.blur_px) - 1
            case Uniform():
                return np.full((1, *self.u.shape), 2 * pattern.level - 1)
        raise NotImplementedError(type(pattern).__name__)

    def expose(self, light: Array, rng: np.random.Generator | None = None) -> Frames:
        grey = np.asarray(self.offset + self.modulation * light)
        if rng is not None:
            grey = grey + rng.standard_normal(grey.shape) * np.sqrt(self.read**2 + self.gain * grey)
        levels = np.clip(np.rint(grey), 0, self.sensor.full_scale)
        return levels.astype(np.uint8) if self.eight_bits else levels.astype(np.uint16)

    def frames(self, pattern: Pattern, rng: np.random.Generator | None = None) -> Frames:
        return self.expose(self.light(pattern), rng)

    def capture(self, *patterns: Pattern, rng: np.random.Generator | None = None) -> Capture:
        return capture_of(
            *((pattern, self.frames(pattern, rng)) for pattern in patterns),
            extent=self.extent,
            sensor=self.sensor,
        )


def capture_of(
    *sets: tuple[Pattern | PatternSet, Frames], extent: int, sensor: Sensor = SENSOR_8
) -> Capture:
    """A capture of given frames; the projector is square."""
    items = tuple(p if isinstance(p, PatternSet) else PatternSet(p) for p, _ in sets)
    return Capture(Sequence(extent, extent, items), tuple(frames for _, frames in sets), sensor)


def repeated(frames: Frames, times: int) -> Frames:
    """Each frame so many times, next to each other."""
    return frames[np.repeat(np.arange(len(frames)), times)]


def sweep(extent: int, *, samples_per_px: int, rows: int = 1) -> Array:
    """``(rows, n)`` coordinates over the whole projector, none of them on a cell's edge.

    Row r is shifted by a fraction of the sampling, so that all sub-pixel offsets occur.
    """
    count = extent * samples_per_px
    starts = (np.arange(rows)[:, np.newaxis] + 0.5) / rows
    return np.asarray((np.arange(count) + starts) / samples_per_px - 0.5)


WHITE, BLACK = Uniform(1.0), Uniform(0.0)
