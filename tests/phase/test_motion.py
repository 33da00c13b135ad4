"""Even motion: frames of known motion by closed forms, and a moving scene of the twin."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.diagnose.image_motion import estimate_image_motion
from fringeworks.errors import DecodeError
from fringeworks.model import Capture, FloatMap, Fringe, PatternSet, Sensor, Sequence, Uniform
from fringeworks.patterns import equal_shifts
from fringeworks.phase.decode import decode_capture, decode_phases
from fringeworks.phase.motion import frame_times, hold_still

Array: TypeAlias = NDArray[np.float64]

WIDTH, HEIGHT, SPREAD = 240, 120, 0.5
"""Camera px; a camera px sees so many projector px."""


def shows(
    fringe: Fringe, *, image_px: float, rate_px: float, noise: float = 0.0, texture: bool = False
) -> Capture:
    """Frames of a slope that moves by `image_px` across and `rate_px` over the projector."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    rng = np.random.default_rng(1)
    stack = []
    for age, shift in enumerate(fringe.shifts_rad):
        at = x - image_px * age
        albedo = 0.7 + 0.2 * np.sin(at / 9) * np.sin(y / 11) if texture else np.ones_like(at)
        phase = 2 * np.pi * (SPREAD * at + rate_px * age) / fringe.period_px
        light = albedo * (20_000 + 12_000 * np.cos(phase - shift))
        stack.append(np.rint(light + noise * rng.standard_normal(light.shape)))
    frames = np.array(stack, np.uint16)
    return Capture(Sequence(608, 684, (PatternSet(fringe),)), (frames,), Sensor(65_535.0))


def error_rad(
    capture: Capture, fringe: Fringe, *, age: float, image_px: float, rate_px: float
) -> FloatMap:
    wrapped = decode_phases(capture).relative[0][0]
    x = np.arange(WIDTH) - image_px * age
    true = 2 * np.pi * (SPREAD * x + rate_px * age) / fringe.period_px
    off = np.angle(np.exp(1j * (wrapped.phase - true)))
    return np.asarray(off[np.isfinite(off)], np.float32)


@pytest.mark.parametrize("steps", [3, 4, 8])
@pytest.mark.parametrize(("image_px", "rate_px"), [(0.0, 0.6), (1.5, 0.75), (-0.7, 0.2)])
def test_known_motion_leaves_no_error(steps: int, image_px: float, rate_px: float) -> None:
    fringe = Fringe("x", 32.0, equal_shifts(steps))
    capture = shows(fringe, image_px=image_px, rate_px=rate_px, texture=bool(image_px))
    held, motion = hold_still(capture, (image_px, 0.0))

    middle = (steps - 1) / 2
    ways = {"age": middle, "image_px": image_px, "rate_px": rate_px}
    before, after = error_rad(capture, fringe, **ways), error_rad(held, fringe, **ways)
    # A rate that is off by 1 % of its own makes 1 % of the ripple that it leaves.
    assert motion.rates_px[0][1] == pytest.approx(rate_px, rel=0.01, abs=0.002)
    assert motion.reference == middle
    assert np.std(after) < 0.002 < np.std(before)
    assert motion.after < 0.2 * motion.before


@pytest.mark.parametrize("steps", [3, 4])
def test_a_still_capture_is_returned_as_it_is(steps: int) -> None:
    fringe = Fringe("x", 32.0, equal_shifts(steps))
    capture = shows(fringe, image_px=0.0, rate_px=0.0, noise=300.0)
    held, motion = hold_still(capture, (0.0, 0.0))

    assert motion.still
    assert held is capture


def test_pixels_that_left_the_image_are_void() -> None:
    fringe = Fringe("x", 32.0, equal_shifts(4))
    held, _ = hold_still(shows(fringe, image_px=2.0, rate_px=1.0), (2.0, 0.0))
    known = np.isfinite(decode_phases(held).relative[0][0].phase)

    # Ages -1.5 to 1.5 frames of 2 px: three columns at each side.
    assert known[:, 3:-3].all()
    assert not known[:, :3].any()
    assert not known[:, -3:].any()


def test_saturated_pixels_stay_saturated() -> None:
    fringe = Fringe("x", 32.0, equal_shifts(4))
    capture = shows(fringe, image_px=1.0, rate_px=0.5)
    capture.frames[0][:, 60, 100] = 65_535
    held, _ = hold_still(capture, (1.0, 0.0))

    assert (held.frames[0].max(axis=0) >= held.sensor.saturation)[60, 99:102].all()


def test_frames_are_timed_by_count_or_by_stamps() -> None:
    fringe = Fringe("x", 32.0, equal_shifts(3))
    stamped = (
        PatternSet(fringe, timestamps_s=(1.0, 1.1, 1.2)),
        PatternSet(Uniform(1.0), timestamps_s=(1.7,)),
    )
    counted = tuple(replace(item, timestamps_s=None) for item in stamped)

    assert np.allclose(np.concatenate(frame_times(Sequence(8, 8, stamped))), [0, 1, 2, 7])
    assert np.allclose(np.concatenate(frame_times(Sequence(8, 8, counted))), [0, 1, 2, 3])


def test_what_cannot_be_told_is_said() -> None:
    white = Capture(
        Sequence(8, 8, (PatternSet(Uniform(1.0)),)), (np.zeros((1, 8, 8), np.uint8),), Sensor(255.0)
    )
    with pytest.raises(DecodeError, match="has none"):
        hold_still(white, (1.0, 0.0))
    fringe = Fringe("x", 32.0, equal_shifts(4))
    with pytest.raises(DecodeError, match="--motion DX,DY"):
        estimate_image_motion(shows(fringe, image_px=0.0, rate_px=0.0))


def test_the_twin_in_motion(moving: tuple[Capture, Array]) -> None:
    """Half of what motion adds to the static depth error is gone; measured: docs/motion.md."""
    capture, truth = moving
    found = estimate_image_motion(capture)
    held, motion = hold_still(capture, found)

    assert found[0] == pytest.approx(1.0, abs=0.1)
    before, after = (column_error(item, truth) for item in (capture, held))
    assert after < 0.6 * before
    assert motion.after < motion.before


def column_error(capture: Capture, truth: Array) -> float:
    found = decode_capture(capture).column
    assert found is not None
    error = found.coordinate - truth
    return float(np.sqrt(np.nanmean(error**2)))


@pytest.fixture(scope="module")
def moving() -> tuple[Capture, Array]:
    from fringeworks.patterns.presets import make_sequence
    from fringeworks.twin.effects import Effects
    from fringeworks.twin.scenes import balls_scene, paper_rig
    from fringeworks.twin.simulate import simulate
    from fringeworks.twin.stage import Stage

    whole = paper_rig()
    lens = whole.camera.lens
    small = replace(lens, fx=lens.fx / 2, fy=lens.fy / 2, cx=lens.cx / 2, cy=lens.cy / 2)
    rig = replace(whole, camera=replace(whole.camera, width=376, height=240, lens=small))
    effects = replace(Effects(), samples=1)
    step_mm = 690 / 987  # a px of this camera at the balls
    speed = (step_mm / 0.0333, 0.0, 5.0)
    scene = balls_scene()
    scene = replace(
        scene, objects=tuple(replace(item, velocity_mm_s=speed) for item in scene.objects)
    )
    sequence = make_sequence("multi-frequency", width=608, height=684, axes=("x",))
    made = simulate(scene, rig, sequence, effects=effects, rng=np.random.default_rng(3))
    finest = hold_still(made.capture, (1.0, 0.0))[1].reference
    truth = Stage(scene, rig, effects).truth(finest * 0.0333 + 0.005)
    from scipy.ndimage import binary_erosion

    inside = binary_erosion(np.isfinite(truth.column), iterations=4)
    return made.capture, np.where(inside, truth.column, np.nan)
