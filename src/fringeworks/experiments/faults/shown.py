"""Faults of light, scene and optics: what the camera sees is not what it should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fringeworks.experiments.faults.base import (
    CAMERA,
    PROJECTOR,
    STILL,
    Case,
    Strength,
    boxes,
    eight_steps,
    find_set,
    good,
    half_rig,
    shoot,
    steps_of,
    with_set,
)
from fringeworks.model import Fringe, GrayCode
from fringeworks.twin.effects import AmbientEffects, Effects
from fringeworks.twin.scene import Scene


def overexposed(strength: Strength, seed: int) -> Case:
    """Too much light."""
    projector = replace(PROJECTOR, light_per_ms=0.08 * (2.3, 3.0, 4.5)[strength])
    effects = replace(STILL, projector=projector)
    return Case(shoot(steps_of(seed), seed, effects=effects), half_rig(), "saturation")


def underexposed(strength: Strength, seed: int) -> Case:
    """Too little of it."""
    share = (0.22, 0.17, 0.12)[strength]
    effects = replace(
        STILL,
        projector=replace(PROJECTOR, light_per_ms=0.08 * share),
        ambient=AmbientEffects(light_per_ms=0.006 * share),
    )
    return Case(shoot(steps_of(seed), seed, effects=effects), half_rig(), "too dark")


def ambient(strength: Strength, seed: int) -> Case:
    """A bright room."""
    effects = replace(
        STILL,
        projector=replace(PROJECTOR, light_per_ms=0.055),
        ambient=AmbientEffects(light_per_ms=(0.035, 0.045, 0.055)[strength]),
    )
    return Case(shoot(steps_of(seed), seed, effects=effects), half_rig(), "ambient light")


def lamp_flicker(strength: Strength, seed: int) -> Case:
    """Each frame in a light of its own."""
    projector = replace(PROJECTOR, flicker=(0.025, 0.04, 0.08)[strength])
    sequence = steps_of(2 - seed % 3)
    capture = shoot(sequence, seed, effects=replace(STILL, projector=projector))
    return Case(capture, half_rig(), "flicker")


def mains(strength: Strength, seed: int) -> Case:
    """Short exposures under a room's light that pulses with the mains."""
    share = (0.3, 0.5, 0.8)[strength]
    effects = Effects(
        camera=replace(CAMERA, exposure_ms=3.0),
        projector=replace(PROJECTOR, light_per_ms=0.2),
        ambient=AmbientEffects(light_per_ms=0.05, ripple=share),
        frame_interval_ms=37.3,
    )
    return Case(shoot(eight_steps(), seed, effects=effects), half_rig(), "flicker")


def lamp_drift(strength: Strength, seed: int) -> Case:
    """The light changes between the sets, as automatic exposure does."""
    capture = good(seed % 3, seed)
    factor = (0.93, 0.88, 0.8)[strength]
    place_ = find_set(capture, Fringe, "y")
    stack = np.rint(capture.frames[place_] * factor).astype(np.uint8)
    return Case(with_set(capture, place_, stack), half_rig(), "light drift")


def bumped(strength: Strength, seed: int) -> Case:
    """All was pushed aside between two sets."""
    move = (0.4, 0.8, 1.5)[strength]
    before = good(seed % 3, seed)
    scene = boxes(seed)
    objects = tuple(
        replace(
            item,
            camera_from_object=replace(
                item.camera_from_object,
                translation_mm=item.camera_from_object.translation_mm
                + np.array([move, 0.3 * move, 0]),
            ),
        )
        for item in scene.objects
    )
    after = shoot(steps_of(seed), seed + 1000, scene=Scene("boxes", objects))
    half = find_set(before, Fringe, "y")
    frames = before.frames[:half] + after.frames[half:]
    return Case(replace(before, frames=frames), half_rig(), "motion")


def moving(strength: Strength, seed: int) -> Case:
    """The boxes are carried past."""
    velocity = (1.0, 2.0, 4.0)[strength]
    capture = shoot(steps_of(seed), seed, scene=boxes(seed, velocity=velocity))
    return Case(capture, half_rig(), "motion")


def gamma(strength: Strength, seed: int) -> Case:
    """Light that is a power of the grey level."""
    projector = replace(PROJECTOR, gamma=(1.4, 1.8, 2.2)[strength])
    sequence = steps_of(seed % 2)
    capture = shoot(sequence, seed, effects=replace(STILL, projector=projector))
    return Case(capture, half_rig(), "gamma")


def projector_blur(strength: Strength, seed: int) -> Case:
    """A projector out of focus."""
    projector = replace(PROJECTOR, blur_px=(3.4, 3.8, 4.4)[strength])
    capture = shoot(steps_of(seed), seed, effects=replace(STILL, projector=projector))
    return Case(capture, half_rig(), "blur")


def camera_blur(strength: Strength, seed: int) -> Case:
    """A camera out of focus."""
    camera = replace(CAMERA, blur_px=(4.5, 5.0, 6.0)[strength])
    capture = shoot(steps_of(seed), seed, effects=replace(STILL, camera=camera))
    return Case(capture, half_rig(), "blur")


def code_darker(strength: Strength, seed: int) -> Case:
    """The code was taken at another exposure than white and black."""
    capture = good(seed % 3, seed)
    factor = (0.7, 0.6, 0.5)[strength]
    frames = tuple(
        np.rint(stack * factor).astype(np.uint8) if isinstance(item.pattern, GrayCode) else stack
        for item, stack in capture
    )
    return Case(replace(capture, frames=frames), half_rig(), "gray margin")
