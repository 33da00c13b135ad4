"""Test frames of the twin: half the paper's rig, and projectors that work on their image first."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from fringeworks.model import Capture, Sequence
from fringeworks.patterns import probe_sequence, render_sequence
from fringeworks.twin.effects import CameraEffects, Effects, ProjectorEffects
from fringeworks.twin.scene import Material, Object, Plane, Scene
from fringeworks.twin.scenes import named_scene, place
from fringeworks.twin.stage import Stage
from tests.calibrate.faults import HEIGHT, WIDTH, half_rig

PROJECTOR = ProjectorEffects(blur_px=0.3)
CAMERA = CameraEffects(blur_px=0.4)
STILL = Effects(camera=CAMERA, projector=PROJECTOR, samples=1)

Warp = Callable[[Any], Any]


def probe(
    effects: Effects = STILL,
    *,
    scene: Scene | None = None,
    sequence: Sequence | None = None,
    warp: Warp = lambda image: image,
    seed: int = 0,
) -> Capture:
    """What the camera sees of a sequence, its images changed by the projector's electronics."""
    sequence = sequence or probe_sequence(width=WIDTH, height=HEIGHT)
    stage = Stage(scene or named_scene("wall"), half_rig(), effects)
    rng = np.random.default_rng(seed)
    stacks: list[Any] = []
    time_s = 0.0
    for item, images in render_sequence(sequence):
        frames = []
        for image in images:
            exposure_ms = item.exposure_ms
            frame = stage.expose(warp(image), rng=rng, time_s=time_s, exposure_ms=exposure_ms)
            frames.append(frame)
            time_s += effects.frame_interval_ms / 1000
        stacks.append(np.stack(frames))
    return Capture(sequence, tuple(stacks), stage.sensor)


def sharpened(strength: float) -> Warp:
    """Unsharp masking of three pixels."""

    def warp(image: Any) -> Any:
        smooth = cv2.blur(image.astype(np.float64), (3, 3))
        return np.clip(np.rint(image + strength * (image - smooth)), 0, 255).astype(np.uint8)

    return warp


def keystoned(share: float) -> Warp:
    """The upper edge is narrower by this share, by linear interpolation."""

    def warp(image: Any) -> Any:
        height, width = image.shape[:2]
        corners = [[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]]
        moved = np.array(corners, np.float32)
        moved[0, 0] += share * width / 2
        moved[1, 0] -= share * width / 2
        matrix = cv2.getPerspectiveTransform(np.array(corners, np.float32), moved)
        return cv2.warpPerspective(image, matrix, (width, height), flags=cv2.INTER_LINEAR)

    return warp


def scaled(share: float) -> Warp:
    """Overscan: all is shown this much smaller."""

    def warp(image: Any) -> Any:
        height, width = image.shape[:2]
        matrix = np.array([[share, 0, 1], [0, share, 1]], np.float32)
        return cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_LINEAR)

    return warp


def strips(albedos: tuple[float, ...], *, gloss: float = 0.0) -> Scene:
    """Upright strips side by side, each of one albedo."""
    width = 280 / len(albedos)
    return Scene(
        "strips",
        tuple(
            Object(
                f"strip_{number}",
                Plane(width, 300.0),
                place((width * (number + 0.5) - 140, 0, 680), (0, 0, 0)),
                Material(albedo, gloss=gloss),
            )
            for number, albedo in enumerate(albedos)
        ),
    )
