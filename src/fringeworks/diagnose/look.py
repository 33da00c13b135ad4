"""A set of fringes as the checks look at it: its sinusoid and what every frame leaves of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Capture, FloatMap, Fringe, GrayCode, Pattern, Uniform
from fringeworks.phase.demodulate import solve_shifts
from fringeworks.phase.noise import high_pass_noise, noise_rows

Bits = NDArray[np.bool_]

LIT_SHARE = 8 / 255
"""Modulation, share of full scale, from which a pixel is lit by the fringes."""

LIT_CONTRAST = 0.1
"""White less black, share of full scale, from which a pixel tells light from dark."""

LEAST_PIXELS = 500
"""Fewer lit pixels tell nothing."""

NOISE_STEPS = 4080
"""Of full scale, in which noise is counted: sixteenths of a level of 8 bits."""


@dataclass(frozen=True, eq=False)
class Look:
    """One set of fringes.

    Attributes
    ----------
    place
        Of the set in the sequence.
    frames
        ``(N, H, W)`` grey levels, means of the repeats.
    offset, modulation, phase
        ``(H, W)`` of the least-squares sinusoid, no pixel masked.
    clipped
        ``(H, W)``: a frame is saturated though the fringes move.
    lit
        ``(H, W)``: fringes are seen, and nothing is clipped.
    full_scale
        Of the sensor, grey levels.
    """

    place: int
    fringe: Fringe
    frames: FloatMap
    offset: FloatMap
    modulation: FloatMap
    phase: FloatMap
    clipped: Bits
    lit: Bits
    full_scale: float

    @property
    def name(self) -> str:
        return name_of(self.fringe)

    @property
    def where(self) -> str:
        return f"set {self.place + 1}, {self.name}"

    @property
    def enough(self) -> bool:
        """Whether there are pixels enough to tell something."""
        return int(np.count_nonzero(self.lit)) >= LEAST_PIXELS

    @property
    def light(self) -> float:
        """Mean grey level: the exposure's rank among those of the same fringes."""
        return float(self.offset.mean())

    @cached_property
    def noise(self) -> float:
        """Of one frame, grey levels, from high-pass differences between frames."""
        scale = NOISE_STEPS / self.full_scale
        rows = noise_rows(self.lit.shape)
        whole = np.rint(scale * self.frames[:, rows]).astype(np.uint16)
        use = self.lit[rows] if self.enough else np.ones_like(self.lit[rows])
        return high_pass_noise(whole, use, black_level=0.0).read / scale

    def noise_px(self, *, frames: int | None = None) -> float:
        """Error of the coordinate that noise makes, px rms, where so many frames are left.

        ``sigma_phi = sqrt(2 / N) sigma / B``, at most that of a pixel known to a period alone.
        """
        period, count = self.fringe.period_px, frames or self.fringe.frame_count
        strength = float(np.median(self.modulation[self.lit])) if self.lit.any() else 0.0
        least = np.sqrt(2 / count) * self.noise * period / (2 * np.pi)
        worst = period / np.sqrt(12)
        return float(min(least / strength, worst)) if strength > 0 else float(worst)

    def residual(self) -> FloatMap:
        """``(N, H, W)`` grey levels that the sinusoid leaves."""
        turns = self.phase - np.asarray(self.fringe.shifts_rad, np.float32)[:, None, None]
        return np.asarray(self.frames - self.offset - self.modulation * np.cos(turns))


def name_of(pattern: Pattern) -> str:
    """What a pattern is called in a sentence."""
    match pattern:
        case Fringe(axis=axis, period_px=period):
            return f"fringes of {period:.4g} px along {axis}"
        case GrayCode(axis=axis):
            return f"Gray code along {axis}"
        case Uniform(level=level):
            return "white" if level > 0.5 else "black"
        case _:
            return type(pattern).__name__.lower()


def uniform_at(capture: Capture, exposure_ms: float | None) -> tuple[FloatMap, FloatMap] | None:
    """White and black, of several exposures those of this one; None where one is missing."""
    alike = capture.at_exposure(exposure_ms)
    white, black = alike.white(), alike.black()
    return None if white is None or black is None else (white, black)


def one_per_fringe(looks: Sequence[Look], rank: Callable[[Look], float]) -> list[Look]:
    """Of several exposures of the same fringes the one that ranks highest."""
    best: dict[Fringe, Look] = {}
    for look in looks:
        if look.fringe not in best or rank(look) > rank(best[look.fringe]):
            best[look.fringe] = look
    return list(best.values())


def look_at(capture: Capture) -> list[Look]:
    """Every set of fringes of a capture (of one group)."""
    return [
        _look(capture, place, item.pattern)
        for place, item in enumerate(capture.sequence.sets)
        if isinstance(item.pattern, Fringe)
    ]


def _look(capture: Capture, place: int, fringe: Fringe) -> Look:
    stack = capture.frames[place].astype(np.float32)
    frames = stack.reshape(fringe.frame_count, -1, *capture.shape).mean(axis=1)
    solution = solve_shifts(np.asarray(fringe.shifts_rad))
    offset, cosine, sine = np.tensordot(solution.solve, frames, axes=1)
    modulation = np.hypot(cosine, sine)
    swing = frames.max(axis=0) - frames.min(axis=0)
    least = LIT_SHARE * capture.sensor.full_scale
    clipped = (stack.max(axis=0) >= capture.sensor.saturation) & (swing > 2 * least)
    lit = (modulation > least) & ~clipped
    phase = np.arctan2(sine, cosine)
    return Look(
        place, fringe, frames, offset, modulation, phase, clipped, lit, capture.sensor.full_scale
    )


def codes_in_light(capture: Capture) -> Iterator[tuple[int, GrayCode, FloatMap, FloatMap, Bits]]:
    """Gray codes whose light and dark are known, each with where it stands in the sequence.

    Behind it ``(H, W)``: black, white less black, and where that is a tenth of full scale.
    """
    for place, item in enumerate(capture.sequence.sets):
        uniform = uniform_at(capture, item.exposure_ms)
        if not isinstance(item.pattern, GrayCode) or item.repeats != 1 or uniform is None:
            continue
        white, black = uniform
        contrast: FloatMap = np.asarray(white - black)
        lit = np.asarray(contrast > LIT_CONTRAST * capture.sensor.full_scale)
        if np.count_nonzero(lit) >= LEAST_PIXELS:
            yield place, item.pattern, black, contrast, lit
