"""Capture after capture of one sequence, in memory: nothing is written, nothing resumed."""

from __future__ import annotations

from typing import Any

import numpy as np

from fringeworks.acquire.frames import FrameTaker
from fringeworks.acquire.sequence import check_sequence, plan_shots, shown_images
from fringeworks.devices import CameraDevice, Clock, MonotonicClock, ProjectorDevice
from fringeworks.files.acquiring import Tally
from fringeworks.files.station import Timing
from fringeworks.model import Capture, Colour, Frames, GreyCurve, Sequence
from fringeworks.model.capture import to_grey
from fringeworks.patterns import render_sequence


class CaptureTaker:
    """Takes captures of one sequence; its images are rendered once.

    Parameters
    ----------
    sequence
        What to show; its sets' `repeats` and `exposure_ms` are honoured.
    projector, camera
        Of the same `clock` (the machine's, unless given); they stay open.
    exposure_ms
        Of sets that do not say their own.
    timing
        How long to wait.
    curve
        Pre-distorts what is shown.

    Raises
    ------
    UsageError
        The sequence cannot be shown, or not be seen in time.
    """

    def __init__(
        self,
        sequence: Sequence,
        projector: ProjectorDevice,
        camera: CameraDevice,
        *,
        exposure_ms: float,
        timing: Timing | None = None,
        clock: Clock | None = None,
        curve: GreyCurve | None = None,
    ) -> None:
        self._sequence, self._projector, self._camera = sequence, projector, camera
        self._timing, self._clock = timing or Timing(), clock or MonotonicClock()
        self._shots = plan_shots(sequence, exposure_ms)
        check_sequence(sequence, projector, shots=self._shots, timing=self._timing)
        rendered = render_sequence(sequence, bits=projector.bits, curve=curve)
        self._images = list(shown_images(self._shots, rendered))

    def take(self) -> Capture:
        """One capture; colour as a reader of its files would keep it.

        Raises
        ------
        DeviceError
            No frame that shows an image came, or a device failed; the message names the image.
        """
        # A taker of its own: frames that went by between two captures are no loss.
        taker = FrameTaker(
            self._projector,
            self._camera,
            clock=self._clock,
            timing=self._timing,
            tally=Tally(),
            advice="",
        )
        sets = self._sequence.sets
        frames: list[list[Frames]] = [[] for _ in sets]
        colours: dict[int | None, Frames] = {}
        for shot, image in zip(self._shots, self._images, strict=True):
            frame, _ = taker.take(shot, image)
            if frame.ndim == 3:
                colours.setdefault(shot.place, frame)
            whole = isinstance(sets[shot.place].pattern, Colour)
            frames[shot.place].append(frame if whole else to_grey(frame))
        stacks: list[Any] = [np.stack(stack) for stack in frames]
        return Capture(
            self._sequence,
            tuple(stacks),
            self._camera.sensor,
            colour=colours.get(self._sequence.white_set),
            dark_colour=colours.get(self._sequence.black_set),
        )
