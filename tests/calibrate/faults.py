"""Captures of a board with one thing wrong, made by the twin with a rig half the paper's size.

`TAKEN` is what may be wrong with a capture as it lies on disk, `SHOWN` what may become of an image
on its way to the projector's panel; each is one fault by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from collections.abc import Sequence as Sequences
from dataclasses import replace
from functools import cache
from typing import Any, TypeAlias

import cv2
import numpy as np

from fringeworks.model import AXES, Capture, Frames, Fringe, GrayCode, Lens, Pose, Rig, Sequence
from fringeworks.patterns import make_sequence, render_sequence
from fringeworks.twin.effects import CameraEffects, Effects, ProjectorEffects
from fringeworks.twin.scene import Board, Material, Object, Scene
from fringeworks.twin.scenes import PAPER, paper_rig, place, target_of
from fringeworks.twin.stage import Stage

Change: TypeAlias = Callable[[Frames], Frames]
Place: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float]]

BOARD = Board(columns=7, rows=5, square_mm=19.0)
TARGET = target_of(BOARD)
WIDTH, HEIGHT = 304, 342
"""Of the projector."""

PLACES: tuple[Place, ...] = (
    ((-20, -4, 600), (0, 28, 4)),
    ((20, 4, 610), (4, -30, -3)),
    ((14, 8, 630), (28, 3, 2)),
    ((-14, -8, 630), (-30, -2, -4)),
)
"""The board's middle, mm, and its rotation vector, degrees."""

EFFECTS = Effects(camera=CameraEffects(blur_px=0.4), projector=ProjectorEffects(blur_px=0.3))


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


def three_steps(width: int = WIDTH, height: int = HEIGHT) -> Sequence:
    """Three steps of 16 px and a Gray code of five bits and its complement along each axis."""
    return make_sequence("paper", width=width, height=height, periods_px=(16.0,), codewords_px=())


def _pose(where: Place) -> Pose:
    turned = place(*where)
    middle = np.array([BOARD.columns - 1, BOARD.rows - 1, 0]) * BOARD.square_mm / 2
    return replace(turned, translation_mm=turned.translation_mm - turned.rotation @ middle)


def shoot(
    where: Place,
    name: str,
    *,
    board: Board = BOARD,
    material: Material = PAPER,
    effects: Effects = EFFECTS,
    shown: Change | None = None,
    sequence: Sequence | None = None,
    sets: Sequences[int] | None = None,
) -> Capture:
    """A capture of a board in a place; `shown` is what becomes of an image before the panel.

    Frames of other sets than these, if told, are left black.
    """
    thing = Object("board", board, _pose(where), material)
    stage = Stage(Scene("board", (thing,)), half_rig(), effects)
    rng = np.random.default_rng(7)
    sequence = sequence or three_steps()

    def take(image: Frames) -> Frames:
        return stage.expose(shown(image) if shown else image, rng=rng)

    camera = stage.rig.camera
    stacks: list[Any] = [
        np.stack([take(image) for image in stack])
        if sets is None or number in sets
        else np.zeros((len(stack), camera.height, camera.width), np.uint8)
        for number, (_, stack) in enumerate(render_sequence(sequence))
    ]
    return Capture(sequence, tuple(stacks), stage.sensor, name=name)


def shoot_all(count: int, **what: Any) -> list[Capture]:
    """The first places of `PLACES`, as pose_0 and so on."""
    return [shoot(where, f"pose_{n}", **what) for n, where in enumerate(PLACES[:count])]


def moved(capture: Capture, where: Place, sets: Sequences[int]) -> Capture:
    """The capture with these of its sets taken after the board had moved to a place."""
    after = shoot(where, capture.name, sets=sets)
    frames = tuple(
        (after if index in sets else capture).frames[index] for index in range(len(capture.frames))
    )
    return replace(capture, frames=frames)


def _flip_camera(capture: Capture) -> Capture:
    return replace(capture, frames=tuple(stack[..., ::-1] for stack in capture.frames))


def _blur(capture: Capture) -> Capture:
    def blurred(frame: Frames) -> Any:
        return cv2.GaussianBlur(frame, (0, 0), 2.0)

    stacks: list[Any] = [np.stack([blurred(one) for one in stack]) for stack in capture.frames]
    return replace(capture, frames=tuple(stacks))


def _swap_axes(capture: Capture) -> Capture:
    """The images of each axis are listed under the other one."""
    other = dict(zip(AXES, AXES[::-1], strict=True))
    sets = tuple(
        replace(item, pattern=replace(item.pattern, axis=other[item.pattern.axis]))
        if isinstance(item.pattern, Fringe | GrayCode)
        else item
        for item in capture.sequence.sets
    )
    return replace(capture, sequence=replace(capture.sequence, sets=sets))


def resized(width: int, height: int) -> Callable[[Capture], Capture]:
    """The projector has another size in capture.toml than on the table."""

    def change(capture: Capture) -> Capture:
        sequence = replace(capture.sequence, width=width, height=height)
        return replace(capture, sequence=sequence)

    return change


def reordered(order: Callable[[int], Sequences[int]]) -> Callable[[Capture], Capture]:
    """The bits of every Gray code stand in another order, what follows them where it was."""

    def change(capture: Capture) -> Capture:
        frames = []
        for item, stack in capture:
            places = list(range(len(stack)))
            if isinstance(item.pattern, GrayCode):
                places[: item.pattern.bits] = order(item.pattern.bits)
            frames.append(stack[places])
        return replace(capture, frames=tuple(frames))

    return change


TAKEN: Mapping[str, Callable[[Capture], Capture]] = {
    "camera flipped": _flip_camera,
    "blurred": _blur,
    "axes swapped": _swap_axes,
    "size exchanged": resized(HEIGHT, WIDTH),
    "size of another": resized(640, 400),
    "bits reversed": reordered(lambda bits: range(bits)[::-1]),
    "two bits swapped": reordered(lambda bits: (*range(bits - 3), bits - 2, bits - 3, bits - 1)),
}


def _scaled(interpolation: int) -> Change:
    """What a graphics driver makes of an image of another size than the panel's."""

    def change(image: Frames) -> Frames:
        scaled: Any = cv2.resize(image, (WIDTH, HEIGHT), interpolation=interpolation)
        return np.asarray(scaled, dtype=np.uint8)

    return change


SHOWN: Mapping[str, Change] = {
    "left to right": lambda image: image[:, ::-1],
    "top to bottom": lambda image: image[::-1],
    "half a turn": lambda image: image[::-1, ::-1],
    "to the nearest pixel": _scaled(cv2.INTER_NEAREST),
    "smoothly": _scaled(cv2.INTER_LINEAR),
}
"""The last two take images of another size: shoot with a `sequence` of that size."""
