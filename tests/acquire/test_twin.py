"""The whole bench over the real stage: what is acquired is what is simulated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.acquire import acquire_sequence
from fringeworks.devices import Faults, SimulatedBench, VirtualClock
from fringeworks.files import read_capture
from fringeworks.model import Camera, Lens, Pose, Projector, Rig
from fringeworks.patterns import make_sequence
from fringeworks.phase.decode import decode_phases
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Object, Plane, Scene
from fringeworks.twin.simulate import simulate
from fringeworks.twin.stage import Stage

RIG = Rig(
    Camera(48, 40, Lens(120.0, 120.0, 23.5, 19.5)),
    Projector(64, 48, Lens(110.0, 110.0, 31.5, 23.5)),
    Pose(np.eye(3), np.array([-40.0, 0.0, 0.0])),
)
WALL = Scene("wall", (Object("wall", Plane(), Pose(np.eye(3), np.array([0.0, 0.0, 600.0]))),))
SEQUENCE = make_sequence("measure", width=64, height=48, axes=("x",), steps=3)
FAULTS = Faults(dropped=range(3, 40, 7), repeated=range(0, 40, 5))


ELECTRONS = 1e12
"""So many at full scale that shot noise is a millionth: all but `Effects.ideal`."""


def quiet() -> Effects:
    ideal = Effects.ideal()
    return replace(ideal, camera=replace(ideal.camera, shot_noise=True, full_well_e=ELECTRONS))


def still(effects: Effects) -> Effects:
    """Without the ripple of the ambient light, the one effect that the frames' times decide."""
    return replace(effects, ambient=replace(effects.ambient, ripple=0.0))


@pytest.mark.parametrize("effects", [quiet(), still(Effects())], ids=["quiet", "noisy"])
def test_an_acquisition_is_a_simulation(tmp_path: Path, effects: Effects) -> None:
    """Frames that are passed over draw no noise, so even that is the same."""
    rng, clock = np.random.default_rng(1), VirtualClock()
    stage = Stage(WALL, RIG, effects)
    bench = SimulatedBench(stage, rng=rng, clock=clock, faults=FAULTS)
    done = acquire_sequence(
        SEQUENCE,
        bench.projector,
        bench.camera,
        folder=tmp_path,
        exposure_ms=effects.camera.exposure_ms,
        clock=clock,
    )
    assert min(done.frames.stale, done.frames.repeated, done.frames.dropped) > 0
    acquired = read_capture(tmp_path)
    wanted = simulate(WALL, RIG, SEQUENCE, effects=effects, rng=np.random.default_rng(1)).capture
    assert acquired.sensor == wanted.sensor
    for stack, other in zip(acquired.frames, wanted.frames, strict=True):
        assert np.array_equal(stack, other)


def test_an_acquisition_measures_the_wall(tmp_path: Path) -> None:
    """By hand: the wall's point at camera column c is x = (c - 23.5) * 600 / 120 mm, and the
    projector, 40 mm to the right, lights it with column 31.5 + 110 (x - 40) / 600.

    Levels are rounded twice, pattern and camera, of which at least 10000 are modulation: five
    sigma of that, P / (2 pi) sqrt(2 / N) sqrt(2 / 12) / B, are 4.3e-4 px.
    """
    effects, clock = quiet(), VirtualClock()
    bench = SimulatedBench(
        Stage(WALL, RIG, effects), rng=np.random.default_rng(0), clock=clock, faults=FAULTS
    )
    acquire_sequence(
        SEQUENCE, bench.projector, bench.camera, folder=tmp_path, exposure_ms=10.0, clock=clock
    )
    column = decode_phases(read_capture(tmp_path)).projector_map().axes[0].coordinate
    seen = 31.5 + 110 * ((np.arange(48) - 23.5) * 5 - 40) / 600
    lit = (seen > 0) & (seen < 63)
    error = (column - seen)[:, lit]
    assert lit.sum() > 30
    assert np.abs(error).max() < 4.3e-4
