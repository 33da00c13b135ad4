"""A projector that is a display: one window over all of it, pixel for pixel.

SDL draws without scaling or dithering and presents with the display's vertical sync. What a desktop
does behind it (scaled displays, night colours, a projector's keystone correction) cannot all be
seen from here: where window, drawing and display differ in size, the display is refused.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from fringeworks.errors import DeviceError, MissingExtraError, ShapeError
from fringeworks.files.station_devices import WindowSettings
from fringeworks.model import Frames

if TYPE_CHECKING:
    from types import ModuleType

Size = tuple[int, int]
"""Width, height, px."""

ON_DISPLAY = 0x2FFF0000
"""SDL's window position that means the middle of the display whose number is added."""

DESKTOPS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Where Linux says how displays are reached."""

BITS = 8


class WindowProjector:
    """A `ProjectorDevice` on one display, dark until it shows something.

    Raises
    ------
    MissingExtraError
        pygame-ce is not installed.
    DeviceError
        There is no such display, its size is not the settings', or it is shown scaled.
    """

    bits = BITS

    def __init__(self, settings: WindowSettings) -> None:
        self._pygame = import_pygame()
        self._window: Any = None
        try:
            self.width, self.height = find_display(self._pygame, settings)
            self._open(settings.display)
        except self._pygame.error as error:
            self._pygame.display.quit()
            raise DeviceError(f"display {settings.display}: {error}") from error
        except DeviceError:
            self.close()
            raise

    @property
    def name(self) -> str:
        return f"window, {self._pygame.display.get_driver()}"

    def show(self, image: Frames) -> None:
        """See `ProjectorDevice`; returns when the image is on its way with the next refresh.

        Raises
        ------
        ShapeError
            Another size than the display's, or not 8 bit.
        DeviceError
            The window was closed or left.
        """
        fits = image.shape[:2] == (self.height, self.width) and image.shape[2:] in ((), (3,))
        if not fits or image.dtype != np.uint8:
            raise ShapeError(
                f"image must be {(self.height, self.width)} of uint8, "
                f"got {image.shape} of {image.dtype}"
            )
        try:
            self._listen()
            self._present(image)
        except self._pygame.error as error:
            raise DeviceError(f"the projector's window failed: {error}") from error

    def close(self) -> None:
        """Go dark and take the window away; the desktop may shine through then."""
        window, self._window = self._window, None
        try:
            if window is not None:
                self._present(np.zeros((self.height, self.width), np.uint8))
        except self._pygame.error as error:
            raise DeviceError(f"the projector's window failed: {error}") from error
        finally:
            if window is not None:
                window.destroy()
            self._pygame.display.quit()

    def _open(self, display: int) -> None:
        from pygame._sdl2.video import Renderer, Texture

        place = ON_DISPLAY + display
        self._window = self._pygame.Window(
            "fringeworks",
            (self.width, self.height),
            (place, place),
            fullscreen_desktop=True,
            allow_high_dpi=True,
        )
        self._renderer = Renderer(self._window, vsync=True)
        self._texture = Texture(self._renderer, (self.width, self.height), depth=32, static=True)
        self._pygame.mouse.set_visible(False)
        display_px = (self.width, self.height)
        drawn = self._renderer.get_viewport()
        window = self._window.size
        check_sizes(display_px, window=(window[0], window[1]), drawn=(drawn.width, drawn.height))
        self._present(np.zeros((self.height, self.width), np.uint8))

    def _present(self, image: Frames) -> None:
        colours = image if image.ndim == 3 else np.repeat(image[:, :, np.newaxis], 3, axis=2)
        surface = self._pygame.image.frombuffer(colours.tobytes(), (self.width, self.height), "RGB")
        self._texture.update(surface)
        self._renderer.clear()
        self._texture.draw(dstrect=(0, 0, self.width, self.height))
        self._renderer.present()

    def _listen(self) -> None:
        """A window that answers no events is taken for hung, and covered, by the desktop."""
        pygame = self._pygame
        if self._window is None:
            raise DeviceError("the projector's window is closed")
        for event in pygame.event.get():
            escaped = event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE
            if escaped or event.type in (pygame.QUIT, pygame.WINDOWCLOSE):
                raise DeviceError("the projector's window was closed")


def find_display(pygame: ModuleType, settings: WindowSettings) -> Size:
    """Width and height of the display of the settings, px.

    Raises
    ------
    DeviceError
        There is no such display, or it has another size than the settings say.
    """
    sizes = list_displays(pygame)
    if settings.display >= len(sizes):
        there = ", ".join(f"{number} ({w}x{h})" for number, (w, h) in enumerate(sizes))
        raise DeviceError(f"display must be one of {there}, got {settings.display}")
    width, height = sizes[settings.display]
    wanted = (settings.width or width, settings.height or height)
    if wanted != (width, height):
        raise DeviceError(
            f"display {settings.display} must be {wanted[0]}x{wanted[1]} px, got "
            f"{width}x{height}: patterns are never scaled; set the display to the projector's own "
            "resolution"
        )
    return width, height


def list_displays(pygame: ModuleType) -> list[Size]:
    """Width and height of each display, px.

    Raises
    ------
    DeviceError
        There is none: SDL would draw into memory, and nobody would see it.
    """
    if sys.platform == "linux" and not any(map(os.environ.get, DESKTOPS)):
        raise DeviceError(f"there is no display here: neither {' nor '.join(DESKTOPS)} is set")
    try:
        pygame.display.init()
    except pygame.error as error:
        raise DeviceError(f"no display can be used: {error}") from error
    sizes: list[Size] = pygame.display.get_desktop_sizes()
    return sizes


def check_sizes(display: Size, *, window: Size, drawn: Size) -> None:
    """Refuse a display whose window or drawing has other pixels than it.

    Raises
    ------
    DeviceError
        The desktop scales it.
    """
    if window != display or drawn != display:
        sizes = " and ".join(f"{w}x{h}" for w, h in dict.fromkeys((window, drawn)))
        raise DeviceError(
            f"the window on a display of {display[0]}x{display[1]} px has {sizes}: the desktop "
            "scales it; set the scale of this display to 100 %"
        )


def import_pygame() -> ModuleType:
    """pygame-ce, set up for windows that are not scaled; MissingExtraError without it."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    os.environ.setdefault("SDL_WINDOWS_DPI_AWARENESS", "permonitorv2")
    os.environ.setdefault("SDL_VIDEO_MINIMIZE_ON_FOCUS_LOSS", "0")
    try:
        import pygame
    except ImportError:
        raise MissingExtraError(
            "a projector window needs pygame-ce: pip install 'fringeworks[hardware]'"
        ) from None
    return pygame
