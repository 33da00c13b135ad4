"""Scene + rig + sequence -> capture, with its truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fringeworks.model import (
    Capture,
    Colour,
    Frames,
    GreyCurve,
    PatternSet,
    Progress,
    Rig,
    Sequence,
    no_progress,
)
from fringeworks.model.capture import to_grey
from fringeworks.patterns import render_sequence
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Scene
from fringeworks.twin.stage import Stage
from fringeworks.twin.truth import Truth


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A capture and, from the same scene at its first frame's start, what it should measure."""

    capture: Capture
    truth: Truth


def simulate(
    scene: Scene,
    rig: Rig,
    sequence: Sequence,
    *,
    effects: Effects | None = None,
    rng: np.random.Generator,
    curve: GreyCurve | None = None,
    progress: Progress = no_progress,
) -> Simulation:
    """Show a sequence image by image, one every `frame_interval_ms`, and take a frame of each.

    A colour camera's frames are kept as their luma, but for those of `Colour` sets and of the
    white and the black one, as a reader of its files would. The further places of a posed object
    are not looked at: a scene is one capture. `curve` pre-distorts what is shown.

    Raises
    ------
    UsageError
        A pattern cannot be drawn; the scene, the rig or the effects cannot be (`Stage`).
    ShapeError
        The sequence is not the projector's size.
    """
    effects = effects or Effects()
    stage = Stage(scene, rig, effects)
    images = _images(sequence, effects.projector.bits, curve)
    count = sum(item.image_count for item in sequence.sets)
    interval_s = effects.frame_interval_ms / 1000
    frames: list[list[Frames]] = [[] for _ in sequence.sets]
    colours: dict[int | None, Frames] = {}
    for number in progress(range(count), "simulating"):
        place, item, image = next(images)
        time_s = number * interval_s
        frame = stage.expose(image, rng=rng, time_s=time_s, exposure_ms=item.exposure_ms)
        if frame.ndim == 3:
            colours.setdefault(place, frame)
        frames[place].append(frame if isinstance(item.pattern, Colour) else to_grey(frame))
    stacks: list[Any] = [np.stack(stack) for stack in frames]
    capture = Capture(
        sequence,
        tuple(stacks),
        stage.sensor,
        colour=colours.get(sequence.white_set),
        dark_colour=colours.get(sequence.black_set),
        name=scene.name,
    )
    return Simulation(capture, stage.truth())


def _images(
    sequence: Sequence, bits: int, curve: GreyCurve | None
) -> Iterator[tuple[int, PatternSet, Frames]]:
    """Every image with its set and the set's place."""
    for place, (item, stack) in enumerate(render_sequence(sequence, bits=bits, curve=curve)):
        for image in stack:
            yield place, item, image
