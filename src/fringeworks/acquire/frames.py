"""The frame that shows an image, and no other.

A frame is used only if its exposure began when the image had settled on the projector: what was
in a buffer then, or was being exposed, is passed over. Nothing here looks at pixels: that an image
is lit after `Timing.settle_ms` is the station's word.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fringeworks.acquire.proof import CodeReader
from fringeworks.devices import CameraDevice, Clock, Grab, ProjectorDevice
from fringeworks.errors import DeviceError
from fringeworks.files.acquiring import Tally
from fringeworks.files.station import Timing
from fringeworks.model import Frames
from fringeworks.patterns.corner_code import NUMBERS

GO_ON = "then give the same command again (without --overwrite): it goes on from this image"


@dataclass(frozen=True, slots=True)
class Shot:
    """One image to take: its file, which set and frame it shows, its exposure, its corner code."""

    name: str
    place: int
    frame: int
    exposure_ms: float
    code: int = 0


class FrameTaker:
    """Shows images and takes the frames that show them; `tally` counts what was not used.

    With `proof` images bear their shot's corner code, and frames of another are not used.
    `advice` ends the message of every failure.
    """

    def __init__(
        self,
        projector: ProjectorDevice,
        camera: CameraDevice,
        *,
        clock: Clock,
        timing: Timing,
        tally: Tally,
        proof: CodeReader | None = None,
        advice: str = f"; {GO_ON}",
    ) -> None:
        self._advice = advice
        self.tally = tally
        self._proof = proof
        self._projector, self._camera = projector, camera
        self._clock, self._timing = clock, timing
        self._showing: tuple[int, int] | None = None
        self._settled_s = 0.0
        self._to_drop = 0
        self._exposure_ms: float | None = None
        self._last_number: int | None = None

    def take(self, shot: Shot, image: Frames) -> tuple[Frames, float]:
        """The frame that shows `image`, and when its exposure began, s on the clock.

        The image is shown unless it is already; a wait in vain shows it again. Pixels that see its
        corner code are 0.

        Raises
        ------
        DeviceError
            No frame came, a device failed, or the frame has another size than the camera said.
        """
        try:
            return self._try(shot, image)
        except DeviceError as error:
            raise DeviceError(f"{shot.name}: {error}{self._advice}") from error

    def _try(self, shot: Shot, image: Frames) -> tuple[Frames, float]:
        for attempt in range(self._timing.retries + 1):
            if attempt > 0 or self._showing != (shot.place, shot.frame):
                self._show(image)
                self._showing = (shot.place, shot.frame)
            before = self.tally
            taken = self._await(shot)
            if taken is not None:
                return taken
            self._count(timeouts=1)
        raise DeviceError(self._explain(before))

    def _show(self, image: Frames) -> None:
        settle_s = self._timing.settle_ms / 1000
        self._projector.show(image)
        self._settled_s = self._clock.now() + settle_s
        self._to_drop = self._timing.drop_frames
        self._clock.sleep(settle_s)

    def _await(self, shot: Shot) -> tuple[Frames, float] | None:
        """The first fresh frame of the shot, and its start; None if none comes in time."""
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
                image = self._checked(grab)
                if self._proof is None:
                    return image, grab.start_s
                if self._proof.read(image) == shot.code % NUMBERS:
                    return self._proof.blank(image), grab.start_s
                self._count(misplaced=1)
        return None

    def _is_fresh(self, grab: Grab) -> bool:
        last, self._last_number = self._last_number, grab.number
        if grab.number == last:
            self._count(repeated=1)
            return False
        if last is not None:
            # A smaller number is a camera that was started again: no gap.
            self._count(dropped=max(0, grab.number - last - 1))
        settled = grab.start_s >= self._settled_s
        if not settled or self._to_drop > 0:
            self._to_drop -= settled
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
        others = tally.misplaced - before.misplaced
        if others:
            return (
                f"no frame with its corner code came within {timing.timeout_s:g} s, "
                f"{timing.retries + 1} times in a row ({others} frames showed another image or a "
                "mixture in the last wait); raise settle_ms in [timing] (see `fringeworks "
                "latency`), and keep the corners of the projected image free"
            )
        return (
            f"no frame whose exposure began {timing.settle_ms:g} ms or more after the image was "
            f"shown came within {timing.timeout_s:g} s, {timing.retries + 1} times in a row "
            f"({came} repeated ones came in the last wait); check the camera's cable, power and "
            "trigger, or raise timeout_s in [timing]"
        )
