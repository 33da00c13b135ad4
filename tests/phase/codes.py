"""Code frames and their fringes made with plain numpy, as a blurred projector shows them.

Independent of `fringeworks.patterns` and of `phase.transfer` on purpose: the projector's image is
drawn pixel by pixel, spread over a fine line and blurred there by a sampled Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Capture, Codeword, Fringe, Pattern, PatternSet, Sensor, Sequence

Array = NDArray[np.float64]

FINE = 16
"""Samples per projector px."""

SHIFTS = (2 * np.pi / 3, 0.0, -2 * np.pi / 3)
PAPER = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
ROBUST = (3.0, 4.0, 5.0, 6.0, 8.0, 11.0)


def true_order(u: Array, period_px: float) -> NDArray[np.int64]:
    """k of Phi in (2 pi k - pi, 2 pi k + pi], zero at the image's edge."""
    return np.asarray(np.ceil((u + 0.5) / period_px - 0.5), dtype=np.int64)


def code_line(code: Codeword, extent: int) -> Array:
    """The code frame's pixels, -1 to 1: cos(2 pi (xi - 1/2) / p), xi counted in its fringe."""
    u = np.arange(extent, dtype=float)
    order = true_order(u, code.period_px)
    xi = u + 0.5 - (order - 0.5) * code.period_px
    return np.asarray(np.cos(2 * np.pi * (xi - 0.5) / [code.codeword_of(k) for k in order]))


def fringe_lines(fringe: Fringe, extent: int) -> Array:
    turns = (np.arange(extent) - fringe.zero_px) / fringe.period_px
    return np.stack([np.cos(2 * np.pi * turns - shift) for shift in fringe.shifts_rad])


def show(line: Array, u: Array, blur_px: float) -> Array:
    """What is seen at coordinates u of a line of square pixels, blurred."""
    reach = round(6 * blur_px * FINE) + 1
    places = np.arange(-reach, reach + 1) / FINE
    weights = np.exp(-0.5 * np.square(places / blur_px))
    fine = np.pad(np.repeat(line, FINE), reach, mode="edge")
    light = np.convolve(fine, weights / weights.sum(), mode="valid")
    at = (np.arange(light.size) + 0.5) / FINE - 0.5
    return np.interp(u, at, light)


@dataclass(frozen=True)
class Shown:
    """A scene of known coordinates `u` ``(H, W)`` under fringes and a code frame.

    Frames have grey levels ``offset + modulation * light`` and noise of `sigma`.
    """

    u: Array
    code: Codeword
    extent: int = 608
    blur_px: float = 0.8
    offset: Array | float = 70.0
    modulation: Array | float = 50.0
    sigma: float = 1.0

    @property
    def fringe(self) -> Fringe:
        return Fringe(self.code.axis, self.code.period_px, SHIFTS)

    @property
    def order(self) -> NDArray[np.int64]:
        return true_order(self.u, self.code.period_px)

    def expose(self, line: Array, rng: np.random.Generator) -> NDArray[np.uint8]:
        grey = self.offset + self.modulation * show(line, self.u, self.blur_px)
        grey = np.nan_to_num(grey) + self.sigma * rng.standard_normal(self.u.shape)
        return np.clip(np.rint(grey), 0, 255).astype(np.uint8)

    def capture(self, *, seed: int = 0, with_fringes: bool = True) -> Capture:
        """Fringes, then the code frame; pixels whose u is NaN are dark."""
        rng = np.random.default_rng(seed)
        fringes = [self.expose(line, rng) for line in fringe_lines(self.fringe, self.extent)]
        code = self.expose(code_line(self.code, self.extent), rng)
        shown: list[tuple[Pattern, list[NDArray[np.uint8]]]] = [(self.code, [code])]
        if with_fringes:
            shown.insert(0, (self.fringe, fringes))
        sets = tuple(PatternSet(pattern) for pattern, _ in shown)
        frames = tuple(np.stack(images) for _, images in shown)
        return Capture(Sequence(self.extent, self.extent, sets), frames, Sensor(255.0))
