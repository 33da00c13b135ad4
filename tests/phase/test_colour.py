"""Colour-coded orders, from captures made with numpy alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import Capture, Colour, Frames, Fringe, Pattern, Sensor, Uniform
from fringeworks.phase.colour import order_by_colour
from fringeworks.phase.demodulate import demodulate
from fringeworks.phase.orders import AxisFrames
from fringeworks.phase.window import CoordinateWindow
from tests.phase.encoding import Array, capture_of, equal_shifts, fringe_waves, sweep

EXTENT = 608
FRINGE = Fringe("x", 32.0, equal_shifts(3))
PAINT = {"red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "yellow": (1, 1, 0)}
# Any three neighbours stand once among 20, written by trying.
NAMES = "red red red green green green red blue blue red yellow red blue green yellow yellow blue"
UNIQUE = Colour("x", 32.0, (*NAMES.split(), "yellow", "green", "blue"))
REPEATING = Colour("x", 32.0, ("red", "green", "blue"))


@dataclass(frozen=True)
class Scene:
    """Coordinates `u`; shares of the primaries in the channels; colour ``(3, H, W)`` of objects."""

    u: Array
    colour: Colour = UNIQUE
    mixing: Array | None = None
    surface: Array | float = 1.0
    sigma: float = 0.0
    blur_px: float = 1.0

    def primaries(self, u: Array) -> Array:
        order = np.floor((u + 0.5) / self.colour.period_px + 0.5).astype(int)
        palette = np.array([PAINT[name] for name in self.colour.palette], float)
        return np.moveaxis(palette[order % len(palette)], -1, 0)

    def channels(self, light: Array, seed: int) -> Frames:
        """Grey levels ``(H, W, 3)`` of primaries ``(3, H, W)``."""
        mixing = np.eye(3) if self.mixing is None else self.mixing
        seen = 20 + 200 * np.tensordot(mixing, light * self.surface, axes=1)
        noise = np.random.default_rng(seed).standard_normal(seen.shape)
        return np.moveaxis(np.clip(np.rint(seen + self.sigma * noise), 0, 255), 0, -1).astype(
            np.uint8
        )

    def capture(self) -> Capture:
        taps = np.linspace(-2, 2, 21) * self.blur_px
        painted = np.mean([self.primaries(self.u + tap) for tap in taps], axis=0)
        flat = np.ones((3, *self.u.shape))
        white, black = self.channels(flat, 1), self.channels(0 * flat, 2)
        waves = (1 + fringe_waves(FRINGE, self.u)) / 2
        seen: list[Any] = [self.channels(flat * wave, 3)[..., 1] for wave in waves]
        fringes: Frames = np.stack(seen)
        sets: tuple[tuple[Pattern, Frames], ...] = (
            (FRINGE, fringes),
            (self.colour, self.channels(painted, 4)[None]),
            (Uniform(1.0), white[None, ..., 1]),
            (Uniform(0.0), black[None, ..., 1]),
        )
        sensor = Sensor(255.0, gain=0.0, read_noise=self.sigma)
        grey = capture_of(*sets, extent=EXTENT, sensor=sensor)
        return replace(grey, colour=white, dark_colour=black)


def frames_of(capture: Capture, window: CoordinateWindow | None = None) -> AxisFrames:
    wrapped = demodulate(capture.frames[0], FRINGE, capture.sensor)
    return AxisFrames(capture, "x", (wrapped,), window)


def true_order(u: Array, frames: AxisFrames) -> Array:
    return np.asarray(np.rint((u + 0.5) / 32 - frames.finest.phase / (2 * np.pi)))


def wrong(u: Array, frames: AxisFrames) -> NDArray[np.bool_]:
    """Certain pixels whose order is not the truth's."""
    ordered = order_by_colour(frames).phase
    return np.asarray(np.isfinite(ordered.margin) & (ordered.order != true_order(u, frames)))


U = sweep(EXTENT, samples_per_px=1, rows=12)
CROSSTALK = np.array([[0.7, 0.3, 0.0], [0.3, 0.4, 0.3], [0.0, 0.3, 0.7]])


def _hide(capture: Capture, *columns: slice) -> None:
    for stack in capture.frames:
        for part in columns:
            stack[:, :, part] = 20


def test_the_palette_of_these_tests_is_unique() -> None:
    names = UNIQUE.palette
    assert len(names) == 20
    assert len({names[i : i + 3] for i in range(18)}) == 18


@pytest.mark.parametrize("mixing", [None, CROSSTALK], ids=["none", "crosstalk"])
def test_every_order(mixing: Array | None) -> None:
    frames = frames_of(Scene(U, mixing=mixing, sigma=1.0).capture())
    ordered = order_by_colour(frames)
    assert np.isfinite(ordered.phase.margin).all()
    np.testing.assert_array_equal(ordered.phase.order, true_order(U, frames))
    assert ordered.route == ("colour frame of 4 colours",)


def test_colours_of_the_surface_and_crosstalk_together() -> None:
    """Islands of three fringes, reflectances of 0.15 to 1 in every patch and channel.

    With the crosstalk left at none a fifth of the pixels stays relative (tried).
    """
    patches = np.random.default_rng(5).uniform(0.15, 1, (3, 3, 38))
    surface = np.asarray(np.kron(patches, np.ones((1, 4, 16))), np.float64)
    capture = Scene(U, mixing=CROSSTALK, surface=surface, sigma=1.0).capture()
    _hide(capture, *(slice(at, at + 30) for at in range(70, EXTENT, 130)))
    frames = frames_of(capture)
    seen = np.isfinite(frames.finest.phase)
    assert np.isfinite(order_by_colour(frames).phase.margin[seen]).all()
    assert not wrong(U, frames).any()


def test_dark_pixels_count_as_what_they_are() -> None:
    """White itself is a tenth of what it is elsewhere in one channel of the right half."""
    surface = np.ones((3, *U.shape))
    surface[0, :, 304:] = 0.1
    frames = frames_of(Scene(U, surface=surface, sigma=1.0).capture())
    np.testing.assert_array_equal(order_by_colour(frames).phase.order, true_order(U, frames))


def test_islands_that_show_too_few_fringes_stay_relative() -> None:
    """Three fringes of the left half are certain; a single fringe of another place is not."""
    scene = Scene(U, sigma=1.0)
    capture = scene.capture()
    _hide(capture, slice(None, 100), slice(196, 400), slice(420, None))
    frames = frames_of(capture)
    phase = order_by_colour(frames).phase
    assert np.isfinite(phase.margin[:, 100:196]).all()
    assert np.isnan(phase.margin[:, 400:420]).all()
    assert (phase.order[:, 400:420] == -1).all()
    assert not wrong(U, frames).any()


def test_a_repeating_palette_needs_the_window() -> None:
    capture = Scene(U, colour=REPEATING, sigma=1.0).capture()
    _hide(capture, slice(None, 100), slice(300, None))
    assert np.isnan(order_by_colour(frames_of(capture)).phase.margin).all()
    low = (U - 40).astype(np.float32)
    frames = frames_of(capture, CoordinateWindow(low, low + 80))
    assert np.isfinite(order_by_colour(frames).phase.margin[:, 100:300]).all()
    assert not wrong(U, frames).any()


def test_what_it_does_not_find() -> None:
    capture = Scene(U).capture()
    seen_in_grey = replace(
        capture, frames=(capture.frames[0], capture.frames[1][..., 0], *capture.frames[2:])
    )
    with pytest.raises(DecodeError, match="seen in grey: record it with a colour camera"):
        order_by_colour(frames_of(seen_in_grey))
    with pytest.raises(DecodeError, match="the capture has no black frame in colour"):
        order_by_colour(frames_of(replace(capture, dark_colour=None)))
    with pytest.raises(DecodeError, match="no colour frame along y"):
        order_by_colour(replace(frames_of(capture), axis="y"))
    other = replace(Fringe("x", 16.0, equal_shifts(3)))
    wrapped = demodulate(capture.frames[0], other, capture.sensor)
    with pytest.raises(DecodeError, match="the colour frame along x changes every 32 px, and no"):
        order_by_colour(AxisFrames(capture, "x", (wrapped,)))
