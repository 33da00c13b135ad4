"""Patterns on a real X server, pixel by pixel."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import cast, get_args

import numpy as np
import pytest

from fringeworks.devices.window import WindowProjector, check_sizes
from fringeworks.errors import DeviceError, ShapeError
from fringeworks.files.station_devices import WindowSettings
from fringeworks.model import Frames
from fringeworks.patterns import make_sequence, render_sequence
from fringeworks.patterns.presets import Preset
from tests.devices.screens import Screens, open_screens

pygame = pytest.importorskip("pygame")

PATTERNS, BESIDE = (192, 256), (160, 120)
"""Widths and heights of two displays: the projector, and the one with the desktop."""

SHOWN_WITHIN_S = 2.0


@pytest.fixture(scope="module")
def screens() -> Iterator[Screens]:
    with open_screens(BESIDE, PATTERNS) as made:
        yield made


@pytest.fixture(autouse=True)
def on_the_screens(screens: Screens, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", screens.display)
    monkeypatch.setenv("SDL_VIDEODRIVER", "x11")


@pytest.fixture
def projector() -> Iterator[WindowProjector]:
    made = WindowProjector(WindowSettings(display=1, width=PATTERNS[0], height=PATTERNS[1]))
    yield made
    made.close()


def shown(screens: Screens, expected: Frames) -> Frames:
    """What the projector's screen shows, once it shows what is expected or gives up."""
    end_s = time.monotonic() + SHOWN_WITHIN_S
    while not np.array_equal(seen := screens.shot(1), expected) and time.monotonic() < end_s:
        time.sleep(0.002)
    return seen


def in_colour(image: Frames) -> Frames:
    return image if image.ndim == 3 else cast(Frames, np.stack([image] * 3, axis=2))


@pytest.mark.parametrize("preset", get_args(Preset))
def test_every_pattern_of_every_preset_is_shown_pixel_for_pixel(
    screens: Screens, projector: WindowProjector, preset: Preset
) -> None:
    width, height = PATTERNS
    sequence = make_sequence(preset, width=width, height=height)
    for _, stack in render_sequence(sequence, bits=projector.bits):
        for image in stack:
            projector.show(image)
            expected = in_colour(image)
            assert np.array_equal(shown(screens, expected), expected)


def test_colours_and_every_grey_level(screens: Screens, projector: WindowProjector) -> None:
    rng = np.random.default_rng(3)
    image = rng.integers(0, 256, (PATTERNS[1], PATTERNS[0], 3), dtype=np.uint8)
    image[:, :, 0] = np.arange(256, dtype=np.uint8)[:, np.newaxis]
    projector.show(image)
    assert np.array_equal(shown(screens, image), image)


def test_the_other_display_is_left_alone(screens: Screens, projector: WindowProjector) -> None:
    before = screens.shot(0)
    projector.show(np.full((PATTERNS[1], PATTERNS[0]), 200, np.uint8))
    assert np.array_equal(screens.shot(0), before)


def test_it_starts_and_ends_dark(screens: Screens) -> None:
    dark = np.zeros((PATTERNS[1], PATTERNS[0], 3), np.uint8)
    made = WindowProjector(WindowSettings(display=1))
    assert np.array_equal(shown(screens, dark), dark)
    made.show(np.full(dark.shape[:2], 255, np.uint8))
    made.close()
    made.close()
    assert np.array_equal(shown(screens, dark), dark)


def test_a_window_that_fails_at_the_end_is_let_go_of(
    screens: Screens, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = WindowProjector(WindowSettings(display=1))

    def fail(_: object) -> None:
        raise pygame.error("the renderer is lost")

    monkeypatch.setattr(made, "_present", fail)
    with pytest.raises(DeviceError, match="window failed: the renderer is lost"):
        made.close()
    assert not pygame.display.get_init()
    made.close()


def test_a_display_of_another_size_is_refused() -> None:
    with pytest.raises(DeviceError, match="display 0 must be 192x256 px, got 160x120: patterns"):
        WindowProjector(WindowSettings(display=0, width=192, height=256))


def test_a_display_that_is_not_there() -> None:
    with pytest.raises(DeviceError, match=r"one of 0 \(160x120\), 1 \(192x256\), got 2"):
        WindowProjector(WindowSettings(display=2))


def test_no_desktop_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":54321")
    with pytest.raises(DeviceError, match=r"no display can be used: .*x11"):
        WindowProjector(WindowSettings())


@pytest.mark.parametrize(
    ("window", "drawn"), [((128, 171), (192, 256)), ((192, 256), (288, 384)), ((128, 171),) * 2]
)
def test_a_scaled_display_is_refused(window: tuple[int, int], drawn: tuple[int, int]) -> None:
    with pytest.raises(DeviceError, match="the desktop scales it; set the scale"):
        check_sizes((192, 256), window=window, drawn=drawn)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((192, 256), np.uint8),
        np.zeros((256, 192), np.uint16),
        np.zeros((256, 192, 4), np.uint8),
    ],
)
def test_other_images_are_refused(projector: WindowProjector, image: Frames) -> None:
    with pytest.raises(ShapeError, match=r"image must be \(256, 192\) of uint8"):
        projector.show(image)


def test_a_window_that_was_closed(projector: WindowProjector) -> None:
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE))
    with pytest.raises(DeviceError, match="window was closed"):
        projector.show(np.zeros((PATTERNS[1], PATTERNS[0]), np.uint8))
