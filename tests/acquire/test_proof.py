"""The corner code in camera frames: found, read, and proof against frames of other images."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fringeworks.acquire import Acquisition, Timing, acquire_sequence
from fringeworks.acquire.proof import CodeReader, find_code
from fringeworks.devices import Faults, SimulatedBench, VirtualClock
from fringeworks.errors import DeviceError, UsageError
from fringeworks.files import read_capture, read_image
from fringeworks.files.acquiring import ACQUIRING_JSON
from fringeworks.model import Camera, Frames, Fringe, Lens, PatternSet, Projector, Sequence, Uniform
from fringeworks.patterns import frame_names, render_sequence
from fringeworks.patterns.corner_code import CORNERS, NUMBERS, CornerCode
from fringeworks.twin.effects import Effects
from tests.devices.stages import MirrorStage, seen

WIDTH, HEIGHT = 96, 64
LENS = Lens(80, 80, 48, 32)
CODE = CornerCode(WIDTH, HEIGHT)
SEQUENCE = Sequence(
    WIDTH,
    HEIGHT,
    (
        PatternSet(Fringe("x", 16.0, tuple(np.arange(4) * np.pi / 2)), repeats=2),
        PatternSet(Fringe("y", 16.0, tuple(np.arange(4) * np.pi / 2)), exposure_ms=5.0),
        PatternSet(Uniform(1.0)),
    ),
)
NAMES = [name for row in frame_names(SEQUENCE) for name in row]
EXPOSURE_MS = 10.0


def as_it_is(image: Frames) -> Frames:
    return image


def dark() -> Frames:
    return np.zeros((HEIGHT, WIDTH), np.uint8)


def see(image: Frames, rng: np.random.Generator) -> Frames:
    """Turned, half as bright on one side, blurred, with other light and noise; 4 px a cell."""
    import cv2

    turned = cv2.warpAffine(
        image.astype(np.float64), np.array([[1.1, 0.2, 4.0], [-0.15, 1.05, 20.0]]), (130, 100)
    )
    light = 25 + 0.6 * cv2.GaussianBlur(turned, (0, 0), 0.6) * np.linspace(0.5, 1, 130)
    return np.rint(np.clip(light + rng.normal(0, 1.5, light.shape), 0, 255)).astype(np.uint8)


def found(view: Callable[[Frames], Frames]) -> CodeReader:
    return find_code(CODE, view, bits=8, full_scale=255.0)


def test_every_number_is_read_through_poor_optics() -> None:
    rng = np.random.default_rng(1)
    reader = found(lambda image: see(image, rng))
    assert reader.corners == CORNERS
    busy = np.full((HEIGHT, WIDTH), 128, np.uint8)
    for number in range(NUMBERS):
        assert reader.read(see(CODE.stamp(busy, number, white=255), rng)) == number


@pytest.mark.parametrize("gain", [0.3, 1.2])
def test_another_exposure_is_read_too(gain: float) -> None:
    rng = np.random.default_rng(2)
    reader = found(lambda image: see(image, rng))
    frame = see(CODE.stamp(dark(), 77, white=255), rng)
    assert reader.read((gain * frame).astype(np.uint8)) == 77


def test_a_mixture_of_neighbours_is_no_number() -> None:
    """By time or by rows; of the next image a share of 15 % is seen."""
    rng = np.random.default_rng(3)
    reader = found(lambda image: see(image, rng))
    for number in range(0, NUMBERS, 5):
        one, other = (
            see(CODE.stamp(dark(), which, white=255), rng) for which in (number, number + 1)
        )
        for share in (0.15, 0.5, 0.85):
            assert reader.read(np.rint(share * one + (1 - share) * other).astype(np.uint8)) is None
        torn = one.copy()
        torn[50:] = other[50:]
        assert reader.read(torn) is None


def test_one_corner_is_enough_and_none_is_told() -> None:
    def from_row(first: int, image: Frames) -> Frames:
        view = image.copy()
        view[first:] = 0
        return view

    reader = found(lambda image: from_row(40, image))
    assert reader.corners == 2
    assert reader.read(CODE.stamp(dark(), 9, white=255)) == 9
    with pytest.raises(DeviceError, match=r"no corner .* seen whole \(of the best one 12 of 24"):
        found(lambda image: from_row(12, image))


def test_colours_and_depths() -> None:
    def in_colour(image: Frames) -> Frames:
        return np.stack([image.astype(np.uint16) * k for k in (4, 1, 0)], axis=2)

    reader = find_code(CODE, in_colour, bits=10, full_scale=4095.0)
    wide = CODE.stamp(dark().astype(np.uint16), 200, white=1023)
    assert reader.read(in_colour(wide)) == 200


def test_dark_noise_is_no_number() -> None:
    rng = np.random.default_rng(4)
    reader = found(lambda image: see(image, rng))
    assert [reader.read(see(dark(), rng)) for _ in range(200)] == [None] * 200


def make_bench(**options: object) -> tuple[SimulatedBench, VirtualClock]:
    clock = VirtualClock()
    stage = MirrorStage(
        camera=Camera(WIDTH, HEIGHT, LENS),
        projector=Projector(WIDTH, HEIGHT, LENS),
        effects=Effects(frame_interval_ms=20.0),
    )
    rng = np.random.default_rng(0)
    return SimulatedBench(stage, rng=rng, clock=clock, **options), clock  # type: ignore[arg-type]


def acquire(
    folder: Path, bench: tuple[SimulatedBench, VirtualClock], *, settle_ms: float, proof: bool
) -> Acquisition:
    return acquire_sequence(
        SEQUENCE,
        bench[0].projector,
        bench[0].camera,
        folder=folder,
        exposure_ms=EXPOSURE_MS,
        timing=Timing(settle_ms=settle_ms),
        clock=bench[1],
        proof=proof,
    )


def wrong(folder: Path) -> list[str]:
    """Images that do not show their pattern outside the corners."""
    rows = zip(render_sequence(SEQUENCE), frame_names(SEQUENCE), strict=True)
    middle = (slice(27, 37), slice(36, 60))
    return [
        name
        for (item, stack), row in rows
        for name, image in zip(row, stack, strict=True)
        if not np.array_equal(
            read_image(folder / name)[middle], seen(image, item.exposure_ms or EXPOSURE_MS)[middle]
        )
    ]


@pytest.mark.parametrize("latency_ms", [25.0, 50.0, 110.0])
def test_it_catches_what_settles_too_late(tmp_path: Path, latency_ms: float) -> None:
    """Without the code most images show another pattern, and nothing tells."""
    without = acquire(
        tmp_path / "without", make_bench(latency_ms=latency_ms), settle_ms=5.0, proof=False
    )
    assert len(wrong(tmp_path / "without")) > len(NAMES) / 2
    assert without.frames.misplaced == 0
    done = acquire(tmp_path / "with", make_bench(latency_ms=latency_ms), settle_ms=5.0, proof=True)
    assert wrong(tmp_path / "with") == []
    assert done.frames.misplaced >= 9
    said = read_capture(tmp_path / "with").provenance
    assert said["frames"]["misplaced"] == done.frames.misplaced
    assert said["corner_code"] == "cells of 4 px"


def test_the_corners_are_dark_in_all_images(tmp_path: Path) -> None:
    """Else the code's changes would pass for fringes."""
    acquire(tmp_path, make_bench(), settle_ms=40.0, proof=True)
    for name in NAMES:
        image = read_image(tmp_path / name)
        for rows in (slice(20), slice(44, None)):
            for columns in (slice(28), slice(68, None)):
                assert not image[rows, columns].any()


def test_a_camera_that_sees_no_corner_sees_it_farther_in(tmp_path: Path) -> None:
    """Of 192 x 128 projector px the camera sees all but 12 px at each edge."""
    clock = VirtualClock()

    class Narrow(MirrorStage):
        def expose(self, image: Frames, **options: Any) -> Frames:
            view = super().expose(image, **options)
            inside = np.zeros_like(view)
            inside[12:-12, 12:-12] = view[12:-12, 12:-12]
            return inside

    stage = Narrow(camera=Camera(192, 128, LENS), projector=Projector(192, 128, LENS))
    bench = SimulatedBench(stage, rng=np.random.default_rng(0), clock=clock)
    sequence = Sequence(192, 128, (PatternSet(Uniform(1.0)), PatternSet(Uniform(0.5))))
    acquire_sequence(
        sequence,
        bench.projector,
        bench.camera,
        folder=tmp_path,
        exposure_ms=EXPOSURE_MS,
        clock=clock,
        proof=True,
    )
    white = read_image(tmp_path / frame_names(sequence)[0][0])
    assert not white[16:40, 24:56].any()
    assert (white[56:72, 20:172] == 128).all()


def test_a_code_that_never_comes_is_named(tmp_path: Path) -> None:
    bench = make_bench(latency_ms=20.0)
    show, shown = bench[0].projector.show, []

    def stuck(image: Frames) -> None:
        """After eleven images to find the code and three patterns the projector hangs."""
        shown.append(1)
        if len(shown) <= 14:
            show(image)

    bench[0].projector.show = stuck  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match=rf"^{NAMES[6]}: no frame with its corner code .*latency"):
        acquire(tmp_path, bench, settle_ms=40.0, proof=True)
    assert (tmp_path / ACQUIRING_JSON).exists()
    done = acquire(tmp_path, make_bench(faults=Faults(dropped=(60, 70))), settle_ms=40, proof=True)
    assert done.taken == len(NAMES) - 6
    assert wrong(tmp_path) == []


def test_with_and_without_do_not_mix(tmp_path: Path) -> None:
    bench = make_bench(faults=Faults(dropped=range(10, 1000)))
    with pytest.raises(DeviceError, match="no frame whose exposure"):
        acquire(tmp_path, bench, settle_ms=40.0, proof=False)
    with pytest.raises(UsageError, match="corner_code was not given, is cells of 4 px"):
        acquire(tmp_path, make_bench(), settle_ms=40.0, proof=True)
