"""The frame that shows an image, and no other.

A frame is used only if its exposure began when the image had settled on the projector: what was
in a buffer then, or was being exposed, is passed over. Nothing here looks at pixels: that an image
is lit after `Timing.settle_ms` is the station's word.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fringeworks.devices import CameraDevice, Clock, Grab, ProjectorDevice
from fringeworks.errors import DeviceError
from fringeworks.files.acquiring import Tally
from fringeworks.files.station import Timing
from fringeworks.model import Frames

GO_ON = "then give the same command again (without --overwrite): it goes on from this image"


@dataclass(frozen=True, slots=True)
class Shot:
    """One image to take: its file, which set and frame it shows, its exposure."""

    name: str
    place: int
    frame: int
    exposure_ms: float


class FrameTaker:
    """Shows images and takes the frames that show them; `tally` counts what was not used."""

    def __init__(
        self,
        projector: ProjectorDevice,
        camera: CameraDevice,
        *,
        clock: Clock,
        timing: Timing,
        tally: Tally,
    ) -> None:
        self.tally = tally
        self._projector, self._camera = projector, camera
        self._clock, self._timing = clock, timing
        self._showing: tuple[int, int] | None = None
        self._settled_s = 0.0
        self._exposure_ms: float | None = None
        self._last_number: int | None = None

    def take(self, shot: Shot, image: Frames) -> tuple[Frames, float]:
        """The frame that shows `image`, and when its exposure began, s on the clock.

        The image is shown unless it is already; a wait in vain shows it again.

        Raises
        ------
        DeviceError
            No frame came, a device failed, or the frame has another size than the camera said.
        """
        try:
            grab = self._try(shot, image)
            return self._checked(grab), grab.start_s
        except DeviceError as error:
            raise DeviceError(f"{shot.name}: {error}; {GO_ON}") from error

    def _try(self, shot: Shot, image: Frames) -> Grab:
        for attempt in range(self._timing.retries + 1):
            if attempt > 0 or self._showing != (shot.place, shot.frame):
                self._show(image)
                self._showing = (shot.place, shot.frame)
            before = self.tally
            grab = self._await(shot)
            if grab is not None:
                return grab
            self._count(timeouts=1)
        raise DeviceError(self._explain(before))

    def _show(self, image: Frames) -> None:
        settle_s = self._timing.settle_ms / 1000
        self._projector.show(image)
        self._settled_s = self._clock.now() + settle_s
        self._clock.sleep(settle_s)

    def _await(self, shot: Shot) -> Grab | None:
        """The first fresh frame; None if none comes in time."""
        if shot.exposure_ms != self._exposure_ms:
            # What is in the buffers is thrown away by the camera: a gap that is no loss.
            self._exposure_ms, self._last_number = shot.exposure_ms, None
        end_s = self._clock.now() + self._timing.timeout_s
        while (left_s := end_s - self._clock.now()) > 0:
            try:
                grab = self._camera.grab(exposure_ms=shot.exposure_ms, timeout_s=left_s)
            except TimeoutError:
                return None
            if self._is_fresh(grab):
                return grab
        return None

    def _is_fresh(self, grab: Grab) -> bool:
        last, self._last_number = self._last_number, grab.number
        if grab.number == last:
            self._count(repeated=1)
            return False
        if last is not None:
            # A smaller number is a camera that was started again: no gap.
            self._count(dropped=max(0, grab.number - last - 1))
        if grab.start_s < self._settled_s:
            self._count(stale=1)
            return False
        return True

    def _count(self, **more: int) -> None:
        counts = {name: getattr(self.tally, name) + count for name, count in more.items()}
        self.tally = replace(self.tally, **counts)

    def _checked(self, grab: Grab) -> Frames:
        image = grab.image()
        fits = image.shape[:2] == (self._camera.height, self._camera.width)
        if not fits or image.shape[2:] not in ((), (3,)):
            size = f"{self._camera.width}x{self._camera.height}"
            got = "x".join(map(str, (*reversed(image.shape[:2]), *image.shape[2:])))
            raise DeviceError(f"frame {grab.number} must be {size} px, got {got}")
        return image

    def _explain(self, before: Tally) -> str:
        """Why the last wait was in vain, and what to look at."""
        timing, tally = self._timing, self.tally
        came = f"{tally.stale - before.stale} older ones and {tally.repeated - before.repeated}"
        return (
            f"no frame whose exposure began {timing.settle_ms:g} ms or more after the image was "
            f"shown came within {timing.timeout_s:g} s, {timing.retries + 1} times in a row "
            f"({came} repeated ones came in the last wait); check the camera's cable, power and "
            "trigger, or raise timeout_s in [timing]"
        )
