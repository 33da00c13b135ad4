"""The whole way from a grey level to a grey level, by hand; blur, flicker, motion, order."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import ShapeError, UsageError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import (
    Colour,
    Frames,
    Fringe,
    Lens,
    Pattern,
    PatternSet,
    Pose,
    Sequence,
    Uniform,
)
from fringeworks.patterns import equal_shifts, render
from fringeworks.twin.effects import (
    AmbientEffects,
    CameraEffects,
    Effects,
    Lattice,
    ProjectorEffects,
    crosstalk_response,
)
from fringeworks.twin.scene import Object, Plane, Scene, Sphere
from fringeworks.twin.simulate import simulate
from fringeworks.twin.stage import Stage
from tests.twin.pinholes import CAMERA, NO_NOISE, PROJECTOR, RIG, at, only, wall

IDEAL = Effects.ideal()
SHAPE = (PROJECTOR.height, PROJECTOR.width)


def uniform(level: int, *, bits: int = 16) -> Frames:
    return np.full(SHAPE, level, np.uint8) if bits == 8 else np.full(SHAPE, level, np.uint16)


def expose(scene: Scene, effects: Effects, image: Frames) -> NDArray[np.float64]:
    return Stage(scene, RIG, effects).expose(image, rng=NO_NOISE).astype(np.float64)


def test_a_grey_level_by_hand() -> None:
    """Every effect that is not random, at camera pixel (70, 30) that looks at (10, -5, 500) mm."""
    effects = Effects(
        CameraEffects(
            bits=12,
            exposure_ms=8.0,
            read_noise_e=0.0,
            black_level=10.0,
            prnu=0.0,
            dsnu=0.0,
            blur_px=0.0,
            vignetting=0.2,
            shot_noise=False,
        ),
        ProjectorEffects(
            light_per_ms=0.05,
            bits=8,
            gamma=2.2,
            black_light=0.01,
            blur_px=0.3,
            focus_mm=600.0,
            vignetting=0.3,
            flicker=0.0,
        ),
        AmbientEffects(light_per_ms=0.01, ripple=0.0),
        samples=1,
    )
    found = expose(wall(500.0, albedo=0.8), effects, uniform(128, bits=8))[30, 70]
    # The projector stands at (100, 0, 0): the point is at its pixel (10, 45), 90^2 + 5^2 + 500^2 =
    # 258125 mm^2 away.
    cosine = 500 / math.sqrt(258125)
    near = 600**2 / 258125
    level = 0.01 + 0.99 * (128 / 255) ** 2.2
    corner = 1 - 0.3 * (90**2 + 5**2) / (100.5**2 + 50.5**2)
    camera_corner = 1 - 0.2 * (20**2 + 10**2) / (50.5**2 + 40.5**2)
    projected = 8 * 0.05 * 0.8 * cosine * near * level * corner
    ambient = 8 * 0.01 * 0.8
    expected = 10 + 4095 * camera_corner * (projected + ambient)
    assert expected == pytest.approx(588.03, abs=0.005)
    assert found == round(expected)


# Blur of the camera


def edge_moments(row: NDArray[np.float64]) -> tuple[float, float]:
    slope, place = np.diff(row), np.arange(len(row) - 1) + 0.5
    mean = float(slope @ place / slope.sum())
    return mean, float(slope @ (place - mean) ** 2 / slope.sum())


@pytest.mark.parametrize("sigma", [0.3, 0.6, 1.5])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_camera_blurs_a_step_by_its_sigma(axis: str, sigma: float) -> None:
    # The edge of a sheet in even ambient light, 3.07 mm from the middle: pixel 50 + 6.14 = 56.14.
    size = (200.0, 2000.0) if axis == "x" else (2000.0, 200.0)
    middle = (-96.93, 0.0, 500.0) if axis == "x" else (0.0, -96.93, 500.0)
    scene = only(Plane(*size), at(*middle))
    effects = replace(
        IDEAL,
        camera=replace(IDEAL.camera, blur_px=sigma),
        ambient=AmbientEffects(light_per_ms=0.05, ripple=0.0),
        samples=16,
    )
    frame = expose(scene, effects, uniform(0))
    line = frame[40, 30:] if axis == "x" else frame[20:, 50]
    mean, variance = edge_moments(line)
    start, centre = (30, 50) if axis == "x" else (20, 40)
    # 16 rays per pixel in as many columns.
    assert mean + start == pytest.approx(centre + 6.14, abs=1 / 16)
    # Pixels integrate over 1 px, and so do differences between them: 1/12 each. Rounding: half of
    # one of 32768 grey levels at each of 70 pixels, times (20 px)^2. A narrow edge lies otherwise
    # on the pixels than on average, by what its blur leaves of one cycle per pixel.
    between = math.exp(-2 * math.pi**2 * sigma**2) / math.pi**2
    assert variance == pytest.approx(sigma**2 + 1 / 6, abs=0.02 + between)


@pytest.mark.parametrize("sigma", [0.5, 0.6, 1.0])
def test_camera_passes_contrast_as_a_gaussian_does(sigma: float) -> None:
    """An edge's differences, taken to frequencies: box and difference are sinc each, and 16 rays
    stand for the box to within 2 % up to 0.4 cycles per pixel."""
    scene = only(Plane(200.0, 2000.0), at(-96.93, 0.0, 500.0))
    camera = replace(IDEAL.camera, blur_px=sigma)
    ambient = AmbientEffects(light_per_ms=0.05, ripple=0.0)
    effects = replace(IDEAL, camera=camera, ambient=ambient, samples=16)
    slope = np.diff(expose(scene, effects, uniform(0))[40, 30:])
    place = np.arange(len(slope)) - 25.64  # 56.14 - 30 - 1/2
    for frequency in (0.1, 0.2, 0.3):
        passed = float(slope @ np.cos(2 * np.pi * frequency * place) / slope.sum())
        gauss = math.exp(-2 * math.pi**2 * sigma**2 * frequency**2)
        folded = math.exp(-2 * math.pi**2 * sigma**2 * (1 - frequency) ** 2)
        expected = gauss * np.sinc(frequency) ** 2
        assert passed == pytest.approx(expected, abs=0.02 + folded * np.sinc(1 - frequency) ** 2)


# Blur of the projector


@pytest.mark.parametrize("z", [600.0, 650.0, 800.0])
@pytest.mark.parametrize("lattice", ["square", "diamond"])
def test_projector_blurs_a_step_by_its_defocus(lattice: Lattice, z: float) -> None:
    # Camera pixels of z / 8000 mm beside projector columns of z / 500: 16 per column.
    camera = replace(CAMERA, width=401, lens=Lens(8000.0, 8000.0, 200.0, 40.0))
    u = 100 - 500 * 100 / z  # seen in the camera's middle
    image = uniform(0)
    edge = round(u) + 0.5
    image[:, round(u) + 1 :] = 65535
    effects = replace(
        IDEAL,
        projector=replace(
            IDEAL.projector,
            lattice=lattice,
            blur_px=0.4,
            focus_mm=650.0,
            defocus_px_m=3.2,
        ),
    )
    rig = replace(RIG, camera=camera)
    frame = Stage(wall(z), rig, effects).expose(image, rng=NO_NOISE).astype(np.float64)
    # The mean over rows, and the gain's slope taken out.
    flat = Stage(wall(z), rig, effects).expose(uniform(65535), rng=NO_NOISE)
    rows = slice(24, 56)  # 32 rows of 1 / 16 row: a period of the lattice
    profile = (frame[rows] / flat[rows]).mean(axis=0)
    mean, variance = edge_moments(profile)
    expected = 0.4**2 + (3.2 * (1000 / z - 1000 / 650)) ** 2
    zigzag = (0.25, 1 / 48) if lattice == "diamond" else (0.0, 0.0)
    assert u + (mean - 200) / 16 == pytest.approx(edge + zigzag[0], abs=0.01)
    # One percent of sigma, as the table has it.
    assert variance / 16**2 - zigzag[1] == pytest.approx(expected, rel=0.02)


# What changes from frame to frame


def test_flicker_has_its_magnitude() -> None:
    effects = replace(IDEAL, projector=replace(IDEAL.projector, flicker=0.02))
    stage = Stage(wall(650.0), RIG, effects)
    rng = np.random.default_rng(7)
    levels = [stage.expose(uniform(30000), rng=rng)[40, 90] for _ in range(400)]
    # 400 draws: sd 2 % / 20, and its own spread 1 / sqrt(800) = 3.5 %; 5 sigma.
    still = Stage(wall(650.0), RIG, IDEAL).expose(uniform(30000), rng=NO_NOISE)[40, 90]
    assert np.mean(levels) / still == pytest.approx(1, abs=5e-3)
    assert np.std(levels) / still == pytest.approx(0.02, rel=0.18)


def test_exposure_scales_light() -> None:
    stage = Stage(wall(650.0), RIG, IDEAL)
    long, short = (
        stage.expose(uniform(40000), rng=NO_NOISE, exposure_ms=ms).astype(float) for ms in (8, 2)
    )
    np.testing.assert_allclose(short, long / 4, atol=0.7)


def test_a_moving_object_is_where_it_is_at_mid_exposure() -> None:
    ball = Object("ball", Sphere(12.0), at(5.0, 0.0, 600.0), velocity_mm_s=(40.0, -20.0, 100.0))
    moving = Scene("moving", (ball, *wall(700.0).objects))
    # From 0.2 s for 20 ms: 0.21 s.
    there = replace(ball, camera_from_object=at(13.4, -4.2, 621.0), velocity_mm_s=(0.0, 0.0, 0.0))
    still = Scene("still", (there, *wall(700.0).objects))
    image = render(Fringe("x", 16.0, (0.0, 1.0, 2.0)), width=201, height=101, bits=16)[0]
    stage = Stage(moving, RIG, IDEAL)
    before = stage.expose(image, rng=NO_NOISE, exposure_ms=20.0)
    frame = stage.expose(image, rng=NO_NOISE, time_s=0.2, exposure_ms=20.0)
    assert np.mean(frame != before) > 0.02
    expected = Stage(still, RIG, IDEAL).expose(image, rng=NO_NOISE, exposure_ms=20.0)
    # Rounding of the place may move a silhouette's ray.
    assert np.mean(frame != expected) < 1e-3
    truth = stage.truth(0.21)
    np.testing.assert_allclose(truth.xyz, Stage(still, RIG, IDEAL).truth().xyz, atol=1e-6)


def test_frames_repeat_without_noise() -> None:
    stage = Stage(wall(650.0), RIG, Effects().without_noise())
    first, second = (stage.expose(uniform(200), rng=NO_NOISE) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_same_seed_same_frames() -> None:
    image = uniform(200, bits=8)
    stage = Stage(wall(650.0), RIG)
    one, same, other = (stage.expose(image, rng=np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()


# Simulation


def test_simulation_in_order() -> None:
    fringe = PatternSet(Fringe("x", 32.0, equal_shifts(3)), repeats=2, exposure_ms=4.0)
    sequence = Sequence(201, 101, (fringe, PatternSet(Uniform(1.0))))
    effects = replace(IDEAL, projector=replace(IDEAL.projector, bits=10))
    made = simulate(wall(650.0), RIG, sequence, effects=effects, rng=NO_NOISE)
    stage = Stage(wall(650.0), RIG, effects)
    shown = render(fringe.pattern, width=201, height=101, bits=10)
    assert [stack.shape for stack in made.capture.frames] == [(6, 81, 101), (1, 81, 101)]
    for index in range(6):
        expected = stage.expose(shown[index // 2], rng=NO_NOISE, exposure_ms=4.0)
        np.testing.assert_array_equal(made.capture.frames[0][index], expected)
    white = stage.expose(uniform(1023), rng=NO_NOISE)
    np.testing.assert_array_equal(made.capture.frames[1][0], white)
    assert made.capture.sensor == stage.sensor
    np.testing.assert_array_equal(made.truth.xyz, stage.truth().xyz)


def test_frames_follow_the_clock() -> None:
    # Ambient light ripples at 100 Hz: frames 2.5 ms apart see it at a quarter of a period each.
    effects = replace(
        IDEAL,
        ambient=AmbientEffects(light_per_ms=0.2, ripple=0.5, mains_hz=50.0),
        camera=replace(IDEAL.camera, exposure_ms=1.0),
        frame_interval_ms=2.5,
    )
    sequence = Sequence(201, 101, (PatternSet(Uniform(0.0), repeats=4),))
    made = simulate(wall(650.0), RIG, sequence, effects=effects, rng=NO_NOISE)
    levels = made.capture.frames[0][:, 40, 50] / (0.2 * 65535)
    middle = 0.5e-3 + 2.5e-3 * np.arange(4)
    expected = 1 + 0.5 * np.sinc(0.1) * np.cos(2 * np.pi * 100 * middle)
    np.testing.assert_allclose(levels, expected, atol=1e-4)


def test_colour_is_shown_as_its_mean() -> None:
    colour = Sequence(201, 101, (PatternSet(Colour("x", 20.0, ("red", "white", "black"))),))
    made = simulate(wall(650.0), RIG, colour, effects=IDEAL, rng=NO_NOISE)
    image = render(colour.sets[0].pattern, width=201, height=101, bits=16)[0]
    grey = np.round(image.mean(axis=-1)).astype(np.uint16)
    assert {0, 21845, 65535} == set(np.unique(grey).tolist())
    expected = Stage(wall(650.0), RIG, IDEAL).expose(grey, rng=NO_NOISE)
    np.testing.assert_array_equal(made.capture.frames[0][0], expected)


RESPONSE = ((0.9, 0.1, 0.0), (0.2, 0.6, 0.1), (0.0, 0.3, 0.5))
COLOUR = replace(
    IDEAL,
    camera=replace(IDEAL.camera, colour_response=RESPONSE),
    ambient=AmbientEffects(light_per_ms=0.02, ripple=0.0),
)


def test_a_colour_camera_by_hand() -> None:
    """Light of the primaries (1, 0.5, 0) through the response, and ambient as white of all three.

    A wall of albedo 1, 10 ms; half a level of rounding in 16 bits for
    the grey frame and the seen one, and that of 32768 as a half.
    """
    image = np.zeros((*SHAPE, 3), np.uint16)
    image[..., 0], image[..., 1] = 65535, 32768
    seen = expose(wall(650.0), COLOUR, image)
    grey = expose(wall(650.0), IDEAL, uniform(65535))
    ambient = 0.02 * 10 * 65535
    rows = np.array(RESPONSE)
    expected = grey[..., None] * (rows @ [1.0, 0.5, 0.0]) + ambient * rows.sum(axis=1)
    lit = grey > 0
    np.testing.assert_allclose(seen[lit], expected[lit], atol=3)


def test_a_colour_camera_keeps_colour_where_it_is_read() -> None:
    fringe = Fringe("x", 20.0, equal_shifts(3))
    painted = Colour("x", 20.0, ("red", "blue"))
    shown: tuple[Pattern, ...] = (painted, fringe, Uniform(1.0), Uniform(0.0))
    sequence = Sequence(201, 101, tuple(map(PatternSet, shown)))
    capture = simulate(wall(650.0), RIG, sequence, effects=COLOUR, rng=NO_NOISE).capture
    assert capture.frames[0].shape == (1, *capture.shape, 3)
    assert capture.frames[1].shape == (3, *capture.shape)
    stage = Stage(wall(650.0), RIG, COLOUR)
    black = stage.expose(np.zeros(SHAPE, np.uint16), rng=NO_NOISE)
    assert capture.colour is not None
    assert capture.dark_colour is not None
    np.testing.assert_array_equal(capture.dark_colour, black)
    assert capture.colour.shape == (*capture.shape, 3)
    luma = capture.colour @ [0.299, 0.587, 0.114]
    np.testing.assert_allclose(capture.frames[2][0], luma, atol=1)


def test_crosstalk_passes_white_on() -> None:
    rows = np.array(crosstalk_response(0.15))
    np.testing.assert_allclose(rows.sum(axis=1), 1, rtol=1e-12)
    assert rows[0].tolist() == [0.85, 0.15, 0.0]


def test_progress_counts_frames() -> None:
    seen: list[tuple[int, str]] = []

    def note(items, description):  # type: ignore[no-untyped-def]
        seen.append((len(items), description))
        return items

    sequence = Sequence(201, 101, (PatternSet(Uniform(1.0)), PatternSet(Uniform(0.0), repeats=3)))
    simulate(wall(650.0), RIG, sequence, effects=IDEAL, rng=NO_NOISE, progress=note)
    assert seen == [(4, "simulating")]


# What cannot be


def test_images_that_do_not_fit() -> None:
    stage = Stage(wall(650.0), RIG, IDEAL)
    with pytest.raises(ShapeError, match=r"image must be \(101, 201\)"):
        stage.expose(np.zeros((101, 200), np.uint16), rng=NO_NOISE)
    with pytest.raises(UsageError, match="exposure_ms must be above 0, got 0"):
        stage.expose(uniform(1), rng=NO_NOISE, exposure_ms=0.0)
    sequence = Sequence(64, 64, (PatternSet(Uniform(1.0)),))
    with pytest.raises(ShapeError, match=r"image must be \(101, 201\), got \(64, 64\)"):
        simulate(wall(650.0), RIG, sequence, effects=IDEAL, rng=NO_NOISE)


def test_scenes_and_rigs_that_do_not_fit() -> None:
    with pytest.raises(UsageError, match="sees nothing"):
        Stage(only(Sphere(10.0), at(0.0, 0.0, -500.0)), RIG)
    turned = Pose(rotation_matrix(np.array([0.0, 3.0, 0.0])), np.zeros(3))
    away = replace(RIG, projector_from_camera=turned)
    with pytest.raises(UsageError, match="points away"):
        Stage(wall(650.0), away)
    with pytest.raises(UsageError, match="exposure_ms must be"):
        Stage(wall(650.0), RIG, replace(IDEAL, camera=replace(IDEAL.camera, exposure_ms=0.0)))
