"""Finds the corner code before the first image is taken."""

from __future__ import annotations

from dataclasses import replace

from fringeworks.acquire.frames import FrameTaker, Shot
from fringeworks.acquire.proof import CodeReader, UnseenError, find_code
from fringeworks.devices import CameraDevice, Clock, ProjectorDevice
from fringeworks.files.acquiring import Tally
from fringeworks.files.station import Timing
from fringeworks.model import Frames
from fringeworks.patterns.corner_code import CornerCode

LEAST_SETTLE_MS, LEAST_DROPPED = 500.0, 2
"""The patience with which the code is looked for: nothing proves those frames."""

INSETS = (0.0, 1 / 8, 1 / 4)
"""Where it is shown, until the camera sees one of its corners."""


def locate_code(
    projector: ProjectorDevice,
    camera: CameraDevice,
    *,
    clock: Clock,
    timing: Timing,
    exposure_ms: float,
) -> tuple[CornerCode, CodeReader]:
    """A code that the camera sees, and where; eleven images or more, their frames not counted.

    Raises
    ------
    DeviceError
        No frame came, a device failed, or as `find_code`.
    """
    patient = replace(
        timing,
        settle_ms=max(timing.settle_ms, LEAST_SETTLE_MS),
        drop_frames=max(timing.drop_frames, LEAST_DROPPED),
    )
    taker = FrameTaker(projector, camera, clock=clock, timing=patient, tally=Tally())
    shown: list[Shot] = []

    def take(image: Frames) -> Frames:
        shown.append(Shot(f"corner code, image {len(shown)}", 0, len(shown), exposure_ms))
        return taker.take(shown[-1], image)[0]

    for inset in INSETS:
        code = CornerCode(projector.width, projector.height, inset)
        try:
            reader = find_code(code, take, bits=projector.bits, full_scale=camera.sensor.full_scale)
        except UnseenError as error:
            unseen = error
        else:
            return code, reader
    raise unseen
