"""What faults are put into: a rig half the paper's size, scenes, sequences and captures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import TypeAlias

import numpy as np

from fringeworks.model import Capture, Frames, Fringe, GrayCode, Lens, Rig, Sequence
from fringeworks.patterns import make_sequence
from fringeworks.twin.effects import CameraEffects, Effects, ProjectorEffects
from fringeworks.twin.scene import Box, Material, Object, Plane, Scene
from fringeworks.twin.scenes import named_scene, paper_rig, place
from fringeworks.twin.simulate import simulate

Strength: TypeAlias = int
"""0, 1 or 2: how bad it is."""

WIDTH, HEIGHT = 304, 342
"""Of the projector."""

PROJECTOR = ProjectorEffects(blur_px=0.3)
CAMERA = CameraEffects(blur_px=0.4)
STILL = Effects(camera=CAMERA, projector=PROJECTOR)


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A capture with a fault, the rig that is told, and the name that must stand first."""

    capture: Capture
    rig: Rig
    expected: str


@cache
def half_rig() -> Rig:
    """The paper's rig with pixels twice as wide in both devices."""
    rig = paper_rig()
    camera = replace(rig.camera, width=376, height=240, lens=_halved(rig.camera.lens))
    projector = replace(rig.projector, width=WIDTH, height=HEIGHT, lens=_halved(rig.projector.lens))
    return replace(rig, camera=camera, projector=projector)


def _halved(lens: Lens) -> Lens:
    cx, cy = (lens.cx + 0.5) / 2 - 0.5, (lens.cy + 0.5) / 2 - 0.5
    return replace(lens, fx=lens.fx / 2, fy=lens.fy / 2, cx=cx, cy=cy)


def eight_steps() -> Sequence:
    """Preset measure: eight steps of 16 px and a complementary Gray code."""
    return make_sequence("measure", width=WIDTH, height=HEIGHT)


def four_steps() -> Sequence:
    """The same with four steps."""
    return make_sequence("measure", width=WIDTH, height=HEIGHT, steps=4)


def three_steps() -> Sequence:
    """Three steps of 16 px and a complementary Gray code."""
    return make_sequence("paper", width=WIDTH, height=HEIGHT, periods_px=(16.0,), codewords_px=())


def frequencies() -> Sequence:
    """Preset multi-frequency: four steps of three periods, no code."""
    return make_sequence("multi-frequency", width=WIDTH, height=HEIGHT)


SEQUENCES: Mapping[int, Callable[[], Sequence]] = {3: three_steps, 4: four_steps, 8: eight_steps}


def steps_of(number: int) -> Sequence:
    """Three, four or eight steps."""
    return SEQUENCES[(3, 4, 8)[number % 3]]()


def boxes(seed: int, *, velocity: float = 0.0) -> Scene:
    """Two boxes before a wall, placed and turned by the seed."""
    rng = np.random.default_rng(seed)
    wall = Object("wall", Plane(), place((0, 0, 720), (-6 + seed % 5, 8 - seed % 7, 0)))
    x, y = rng.uniform(-8, 8, 2)
    low = Object(
        "low",
        Box((50.0, 70.0, 20.0)),
        place((-30 + x, y, 700), (5, 10, float(rng.uniform(-20, 20)))),
        Material(0.75),
        velocity_mm_s=(velocity, 0.4 * velocity, 0.0),
    )
    high = Object(
        "high",
        Box((45.0, 60.0, 40.0)),
        place((30 + y, x, 690), (-5, -8, float(rng.uniform(-20, 20)))),
        Material(0.6),
        velocity_mm_s=(velocity, 0.4 * velocity, 0.0),
    )
    return Scene("boxes", (replace(wall, material=Material(0.8)), low, high))


def shoot(
    sequence: Sequence, seed: int, *, effects: Effects = STILL, scene: Scene | None = None
) -> Capture:
    """A capture of a scene, the boxes unless told."""
    scene = scene or boxes(seed)
    rng = np.random.default_rng(seed)
    return simulate(scene, half_rig(), sequence, effects=effects, rng=rng).capture


@lru_cache(maxsize=8)
def good(number: int, seed: int) -> Capture:
    """Nothing wrong: what faults of the list are made from."""
    return shoot(steps_of(number), seed)


def clean(number: int) -> Capture:
    """One of any number of captures with nothing wrong: scenes, sequences and exposures differ."""
    sequences = (eight_steps, three_steps, frequencies, four_steps)
    names = ("boxes", "wall", "two", "cylinder", "hand")
    name = names[number % len(names)]
    scene = boxes(number) if name == "boxes" else named_scene(name)
    share = (0.7, 1.0, 0.85)[number % 3]
    effects = replace(STILL, projector=replace(PROJECTOR, light_per_ms=0.08 * share))
    return shoot(sequences[number % len(sequences)](), number, effects=effects, scene=scene)


def with_set(capture: Capture, place_: int, stack: Frames) -> Capture:
    """The capture with other frames of one set."""
    frames = (*capture.frames[:place_], stack, *capture.frames[place_ + 1 :])
    return replace(capture, frames=frames)


def find_set(capture: Capture, kind: type[Fringe] | type[GrayCode], axis: str = "x") -> int:
    """Place of the first set of a kind along an axis."""
    return next(
        n
        for n, item in enumerate(capture.sequence.sets)
        if isinstance(item.pattern, kind) and item.pattern.axis == axis
    )
