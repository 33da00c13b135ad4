"""Poses with a projected checkerboard: made up without images, and simulated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.projected.camera import PosedView
from fringeworks.calibrate.projected.corners import ProjectedCorners
from fringeworks.geometry.lens import project
from fringeworks.model import (
    Capture,
    Checkerboard,
    Fringe,
    Lens,
    Pattern,
    PatternSet,
    Projector,
    Rig,
    Sequence,
    Uniform,
)
from fringeworks.patterns import equal_shifts
from fringeworks.twin.scene import Board, Object, Scene
from fringeworks.twin.scenes import PAPER, board_scene, paper_rig, place
from fringeworks.twin.simulate import simulate
from tests.calibrate.synthetic import BOARD, on_board, read_maps, views_of

Array = NDArray[np.float64]

SHOWN_POSES = (1, 3, 5, 8, 13)
COARSE = 1.05


def made_up(state: RigState, *, sigma: float = 0.0, seed: int = 1) -> list[PosedView]:
    """What a camera finds in each pose, with normal noise: all printed corners, 108 projected."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-10, 140, 12), np.linspace(-8, 98, 9))
    places = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    out = []
    for index, view in enumerate(views_of(state, sigma=sigma, rng=rng)):
        pose = state.camera_from_board[index]
        camera_px = project(on_board(pose, np.zeros(2), places), state.camera)
        drawn = read_maps(state, index, camera_px)
        seen = camera_px + rng.normal(0, sigma, camera_px.shape)
        projected = ProjectedCorners(
            drawn, seen, np.full_like(seen, max(sigma, 0.01)), ("",) * len(seen), cut=3
        )
        void = np.full((BOARD.corner_count, 2), np.nan)
        printed = replace(view, projector_px=void, projector_sigma_px=void)
        out.append(PosedView(printed, projected))
    return out


def shown_sequence(width: int, height: int, square_px: float, *, coded: bool = True) -> Sequence:
    """What is needed, and one coarse fringe per axis: it knows a coordinate to a pixel or two."""
    shifts = equal_shifts(3)
    fringes = [Fringe("x", COARSE * width, shifts), Fringe("y", COARSE * height, shifts)]
    patterns: list[Pattern] = [*(fringes if coded else [])]
    patterns += [Checkerboard(square_px), Uniform(1.0), Uniform(0.0)]
    return Sequence(width, height, tuple(PatternSet(pattern) for pattern in patterns))


def photograph(scene: Scene, rig: Rig, sequence: Sequence, seed: int) -> Capture:
    """A noisy capture called like the scene."""
    made = simulate(scene, rig, sequence, rng=np.random.default_rng(seed))
    return replace(made.capture, name=scene.name)


def paper_captures(count: int = len(SHOWN_POSES)) -> tuple[Capture, ...]:
    """The first of five poses before the paper's rig; squares of 20 px."""
    return tuple(paper_capture(pose) for pose in SHOWN_POSES[:count])


@cache
def paper_capture(pose: int) -> Capture:
    rig, scenes = paper_rig(), board_scene().views()
    sequence = shown_sequence(rig.projector.width, rig.projector.height, 20.0)
    return photograph(scenes[pose], rig, sequence, seed=pose)


@cache
def whole_capture() -> tuple[Capture, Rig, Scene]:
    """A small projector image, 9 x 8 squares, all of it on a large sheet; nothing coded."""
    aimed = paper_rig().projector_from_camera
    rig = Rig(
        paper_rig().camera, Projector(288, 256, Lens(1500.0, 1500.0, 143.5, 402.0)), aimed, None
    )
    sheet = Board(5, 4, 13.0, margin_mm=60.0)
    scene = Scene("whole", (Object("board", sheet, place((-26.0, -19.5, 650.0)), PAPER),))
    return photograph(scene, rig, shown_sequence(288, 256, 32.0, coded=False), 5), rig, scene


def without(capture: Capture, *, keep: tuple[int, ...]) -> Capture:
    """A capture with some of its sets."""
    shown = capture.sequence
    return replace(
        capture,
        sequence=Sequence(shown.width, shown.height, tuple(shown.sets[i] for i in keep)),
        frames=tuple(capture.frames[i] for i in keep),
    )
