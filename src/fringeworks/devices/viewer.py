"""A window on the desktop with the live image of a camera."""

from __future__ import annotations

from typing import Any

from fringeworks.devices.window import ON_DISPLAY, import_pygame, list_displays
from fringeworks.errors import DeviceError, FringeworksError
from fringeworks.model import Frames

SHARE_OF_DISPLAY = 0.8


class Viewer:
    """A window on one display, as large as an image of this width and height, px, fits there.

    `alone` says that no projector's window is open: the desktop is let go of at the end.

    Raises
    ------
    MissingExtraError
        pygame-ce is not installed.
    DeviceError
        There is no such display, or no window can be opened.
    """

    def __init__(self, *, width: int, height: int, display: int, alone: bool) -> None:
        from pygame._sdl2.video import Renderer, Texture

        self._pygame = import_pygame()
        sizes = list_displays(self._pygame)
        if display >= len(sizes):
            raise DeviceError(f"there are {len(sizes)} displays, none for a preview")
        room = (SHARE_OF_DISPLAY * sizes[display][0], SHARE_OF_DISPLAY * sizes[display][1])
        scale = min(1.0, room[0] / width, room[1] / height)
        self._size, self._alone = (width, height), alone
        shown = (max(1, round(scale * width)), max(1, round(scale * height)))
        place = ON_DISPLAY + display
        try:
            self._window: Any = self._pygame.Window("fringeworks", shown, (place, place))
            self._renderer = Renderer(self._window)
            self._texture = Texture(self._renderer, self._size, depth=32, static=True)
        except self._pygame.error as error:
            raise DeviceError(f"display {display}: {error}") from error

    def show(self, image: Frames, title: str) -> bool:
        """Show ``(height, width, 3)`` RGB uint8 under a title; False once somebody closed it."""
        if self._window is None or self._is_closed():
            return False
        surface = self._pygame.image.frombuffer(image.tobytes(), self._size, "RGB")
        self._texture.update(surface)
        self._renderer.clear()
        self._texture.draw()
        self._renderer.present()
        self._window.title = title
        return True

    def close(self) -> None:
        """Take the window away; a second call does nothing."""
        if self._window is not None:
            self._window.destroy()
            self._window = None
            if self._alone:
                self._pygame.display.quit()

    def _is_closed(self) -> bool:
        pygame = self._pygame
        return any(
            event.type in (pygame.QUIT, pygame.WINDOWCLOSE)
            or (event.type == pygame.KEYDOWN and event.key in (pygame.K_ESCAPE, pygame.K_q))
            for event in pygame.event.get()
        )


def display_beside(projector: int | None) -> int | None:
    """A display that is not the projector's; None where there is none or none can be used."""
    try:
        count = len(list_displays(import_pygame()))
    except FringeworksError:
        return None
    return next((number for number in range(count) if number != projector), None)
