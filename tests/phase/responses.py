"""Scenes and figures for the tests of responses: a wall on the twin, and its ripple."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import (
    Camera,
    Capture,
    Fringe,
    GreyCurve,
    PatternSet,
    Response,
    Rig,
    Sequence,
)
from fringeworks.patterns import equal_shifts, make_sequence
from fringeworks.patterns.grey_levels import grey_levels
from fringeworks.phase.decode import decode_phases
from fringeworks.pipeline import cloud_of
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Object, Plane, Scene
from fringeworks.twin.scenes import PLASTER, paper_rig, place
from fringeworks.twin.simulate import Simulation, simulate

GAMMA = 2.2
PERIOD_PX = 32.0
ROWS = 160


def banded(rig: Rig) -> Rig:
    """A rig whose camera keeps its middle rows: a third of the time, the same ripple."""
    camera = rig.camera
    lens = replace(camera.lens, cy=camera.lens.cy - (camera.height - ROWS) / 2)
    return replace(rig, camera=Camera(camera.width, ROWS, lens))


RIG = banded(paper_rig())
WIDTH, HEIGHT = RIG.projector.width, RIG.projector.height


def levels_sequence() -> Sequence:
    return grey_levels(width=WIDTH, height=HEIGHT)


def three_steps(*further: Fringe) -> Sequence:
    """The paper's fringes with their Gray code, and `further` ones."""
    shown = make_sequence("paper", width=WIDTH, height=HEIGHT, axes=("x",), codewords_px=())
    return replace(shown, sets=(*shown.sets, *map(PatternSet, further)))


def fringes(period_px: float, steps: int) -> Fringe:
    return Fringe("x", period_px, equal_shifts(steps))


def see_wall(
    sequence: Sequence, z_mm: float = 650.0, *, seed: int = 0, curve: GreyCurve | None = None
) -> Simulation:
    """A wall square to the camera, shown by a projector of gamma 2.2."""
    wall = Object("wall", Plane(), place((0.0, 0.0, z_mm), (180.0, 0.0, 0.0)), PLASTER)
    effects = Effects()
    effects = replace(effects, projector=replace(effects.projector, gamma=GAMMA))
    rng = np.random.default_rng(seed)
    return simulate(Scene("wall", (wall,)), RIG, sequence, effects=effects, rng=rng, curve=curve)


def see(sequence: Sequence, z_mm: float = 650.0, *, seed: int = 0) -> Capture:
    return see_wall(sequence, z_mm, seed=seed).capture


def ripple_mm(seen: Simulation, response: Response | None = None) -> float:
    """Amplitude, mm of depth, of the three waves per period in a cloud less its truth."""
    decoding = decode_phases(seen.capture, response=response)
    cloud = cloud_of(seen.capture, decoding.projector_map(), RIG)
    off = cloud.xyz[..., 2] - seen.truth.xyz[..., 2]
    return float(np.abs(wave(off, seen.truth.column, 3 / PERIOD_PX)))


def wave(values: NDArray[np.floating], at: NDArray[np.floating], per_px: float) -> complex:
    """Amplitude and phase of one wave, by least squares with a constant."""
    good = np.isfinite(values) & np.isfinite(at)
    turns = 2 * np.pi * per_px * (at[good].astype(np.float64) + 0.5)
    design = np.column_stack([np.cos(turns), np.sin(turns), np.ones(len(turns))])
    real, imaginary, _ = np.linalg.lstsq(design, values[good].astype(np.float64), rcond=None)[0]
    return complex(real, imaginary)
