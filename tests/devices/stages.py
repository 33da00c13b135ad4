"""A stage without optics: the camera's image is the projector's, darker at shorter exposures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import numpy as np

from fringeworks.model import Camera, Frames, Lens, Pose, Projector, Rig, Sensor
from fringeworks.twin.effects import Effects

WIDTH, HEIGHT = 24, 16
FULL_EXPOSURE_MS = 20.0
"""Exposure at which the camera's grey levels are the projector's."""

RIG = Rig(
    Camera(WIDTH, HEIGHT, Lens(20, 20, 12, 8)),
    Projector(WIDTH, HEIGHT, Lens(20, 20, 12, 8)),
    Pose.identity(),
)


@dataclass
class MirrorStage:
    """Meets what a simulated bench needs of a stage; `times_s` are those of its exposures."""

    camera: Camera = RIG.camera
    projector: Projector = RIG.projector
    effects: Effects = field(default_factory=Effects)
    sensor: Sensor = field(default_factory=lambda: Sensor(255.0))
    times_s: list[float] = field(default_factory=list)

    def expose(
        self,
        image: Frames,
        *,
        rng: np.random.Generator,
        time_s: float = 0.0,
        exposure_ms: float | None = None,
    ) -> Frames:
        assert exposure_ms is not None
        self.times_s.append(time_s)
        return seen(image, exposure_ms)


def seen(image: Frames, exposure_ms: float) -> Frames:
    """What the mirror's camera makes of a projected image."""
    light = image * (exposure_ms / FULL_EXPOSURE_MS)
    return cast(Frames, np.rint(np.minimum(light, 255)).astype(np.uint8))


def flat(level: int) -> Frames:
    return np.full((HEIGHT, WIDTH), level, np.uint8)
