"""End to end without a bench: a real display, its screenshot, the twin as optics, a poor camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.acquire import Acquisition, Timing, acquire_sequence
from fringeworks.acquire.flashes import record_flashes
from fringeworks.acquire.latency import find_latency
from fringeworks.devices import Faults, MonotonicClock
from fringeworks.devices.window import WindowProjector
from fringeworks.files import read_capture, read_image
from fringeworks.files.station_devices import WindowSettings
from fringeworks.model import Camera, Frames, Lens, Pose, Projector, Rig
from fringeworks.patterns import frame_names, make_sequence, render_sequence
from fringeworks.pipeline import scan
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Object, Plane, Scene
from fringeworks.twin.stage import Stage
from tests.devices.onlooker import on_screen, watched
from tests.devices.screens import Screens, open_screens

pytest.importorskip("pygame")

WIDTH, HEIGHT = 96, 64
DEPTH_MM = 600.0
RIG = Rig(
    Camera(96, 72, Lens(130.0, 130.0, 47.5, 35.5)),
    Projector(WIDTH, HEIGHT, Lens(130.0, 130.0, 47.5, 31.5)),
    Pose(np.eye(3), np.array([-40.0, 0.0, 0.0])),
)
"""On the wall at `DEPTH_MM` pixels are of one size, and the camera sees the left corners."""

SEQUENCE = make_sequence("measure", width=WIDTH, height=HEIGHT, axes=("x",), steps=3)
NAMES = [name for row in frame_names(SEQUENCE) for name in row]
EXPOSURE_MS, INTERVAL_MS = 10.0, 20.0
RUNS = 100
NOISE_LEVELS, STRAY_LEVELS = 3, 650
"""Of 65535; a hundredth near corners, whose light goes astray."""


@pytest.fixture(scope="module")
def screens() -> Iterator[Screens]:
    with open_screens((WIDTH, HEIGHT)) as made:
        yield made


@pytest.fixture
def window(screens: Screens, monkeypatch: pytest.MonkeyPatch) -> Iterator[WindowProjector]:
    monkeypatch.setenv("DISPLAY", screens.display)
    monkeypatch.setenv("SDL_VIDEODRIVER", "x11")
    made = WindowProjector(WindowSettings(width=WIDTH, height=HEIGHT))
    yield made
    made.close()


@pytest.fixture(scope="module")
def stage() -> Stage:
    """Quiet: what a camera sees tells to a grey level what was shown."""
    wall = Scene("wall", (Object("wall", Plane(), Pose(np.eye(3), np.array([0, 0, DEPTH_MM]))),))
    ideal = Effects.ideal()
    quiet = replace(
        ideal,
        camera=replace(ideal.camera, shot_noise=True, full_well_e=1e12),
        projector=replace(ideal.projector, bits=8),
        frame_interval_ms=INTERVAL_MS,
    )
    return Stage(wall, RIG, quiet)


@pytest.fixture(scope="module")
def expected(stage: Stage) -> dict[str, Frames]:
    rng = np.random.default_rng(0)
    rows = zip(render_sequence(SEQUENCE), frame_names(SEQUENCE), strict=True)
    return {
        name: stage.expose(image, rng=rng, exposure_ms=EXPOSURE_MS)
        for (_, stack), row in rows
        for name, image in zip(row, stack, strict=True)
    }


class Runs:
    """Acquisitions with other faults and another delay by each seed."""

    def __init__(self, window: WindowProjector, screens: Screens, stage: Stage) -> None:
        self._window, self._screens, self._stage = window, screens, stage

    def one(
        self, folder: Path, seed: int, *, settle_ms: float, proof: bool, most_ms: float = 60.0
    ) -> Acquisition:
        rng = np.random.default_rng(seed)
        frames = np.arange(2000)
        faults = Faults(
            dropped=frozenset(frames[rng.random(2000) < 0.15].tolist()),
            repeated=frozenset(frames[rng.random(2000) < 0.15].tolist()),
        )
        projector, bench, clock = on_screen(
            self._window,
            self._screens,
            self._stage,
            seed=seed,
            latency_ms=rng.uniform(0, most_ms),
            faults=faults,
        )
        return acquire_sequence(
            SEQUENCE,
            projector,
            bench.camera,
            folder=folder,
            exposure_ms=EXPOSURE_MS,
            timing=Timing(settle_ms=settle_ms, timeout_s=0.5, retries=10),
            clock=clock,
            proof=proof,
        )


@pytest.fixture
def runs(window: WindowProjector, screens: Screens, stage: Stage) -> Runs:
    return Runs(window, screens, stage)


def mixed(folder: Path, expected: dict[str, Frames], *, corners: bool = False) -> list[str]:
    """Images that show anything but their pattern; with `corners`, where they are not blank."""
    wrong = []
    for name in NAMES:
        image = read_image(folder / name)
        off = np.abs(image.astype(int) - expected[name].astype(int))
        if (off[image > 0] > STRAY_LEVELS).any() if corners else (off > NOISE_LEVELS).any():
            wrong.append(name)
    return wrong


def depth_error_mm(folder: Path) -> float:
    cloud = scan(read_capture(folder), RIG)
    error = cloud.xyz[..., 2][cloud.valid] - DEPTH_MM
    assert cloud.valid.sum() > 1000
    return float(np.abs(error).max())


@pytest.mark.slow
def test_no_mixed_frame_gets_through(
    tmp_path: Path, runs: Runs, expected: dict[str, Frames]
) -> None:
    """100 runs, 15 % of the frames lost, 15 % repeated, delays up to the settling time."""
    taken = [runs.one(tmp_path / str(n), n, settle_ms=60.0, proof=False) for n in range(RUNS)]
    assert [mixed(tmp_path / str(n), expected) for n in range(RUNS)] == [[]] * RUNS
    for count in ("stale", "repeated", "dropped"):
        assert sum(getattr(done.frames, count) for done in taken) > RUNS
    assert max(depth_error_mm(tmp_path / str(n)) for n in range(0, RUNS, 10)) < 1.0


@pytest.mark.slow
def test_too_short_a_wait_is_caught_by_the_code_alone(
    tmp_path: Path, runs: Runs, expected: dict[str, Frames]
) -> None:
    """Delays of up to 60 ms, a wait of 10: without the code wrong captures, with it none."""
    without = [runs.one(tmp_path / f"{n}", n, settle_ms=10.0, proof=False) for n in range(10)]
    wrong = [mixed(tmp_path / f"{n}", expected) for n in range(10)]
    assert sum(map(bool, wrong)) >= 7
    assert sum(done.frames.misplaced for done in without) == 0
    done = [runs.one(tmp_path / f"p{n}", n, settle_ms=10.0, proof=True) for n in range(10)]
    assert [mixed(tmp_path / f"p{n}", expected, corners=True) for n in range(10)] == [[]] * 10
    assert sum(item.frames.misplaced for item in done) > 50
    assert max(depth_error_mm(tmp_path / f"p{n}") for n in range(10)) < 1.0


def test_the_delay_of_a_real_display_is_found(window: WindowProjector, screens: Screens) -> None:
    """In real time: 40 ms are put on top of the window's own delay.

    That is a few ms, by the machine's load; or less than none, where `show` waits for the next
    refresh when the display has drawn already.
    """
    with watched(screens, interval_s=0.025, late_s=0.04) as camera:
        record = record_flashes(
            window,
            camera,
            clock=MonotonicClock(),
            exposure_ms=12.0,
            rng=np.random.default_rng(0),
            flashes=6,
        )
    found = find_latency(record)
    assert 20 < np.median(found.delays_ms) < 60
    assert found.timing.settle_ms >= found.delays_ms.max()


def test_a_capture_in_real_time(tmp_path: Path, window: WindowProjector, screens: Screens) -> None:
    """The display itself is the scene: 0.9 of the pattern's grey level, or no frame of it."""
    with watched(screens, interval_s=0.012, late_s=0.02) as camera:
        acquire_sequence(
            SEQUENCE,
            window,
            camera,
            folder=tmp_path,
            exposure_ms=8.0,
            timing=Timing(settle_ms=80.0),
        )
    rows = zip(render_sequence(SEQUENCE), frame_names(SEQUENCE), strict=True)
    for (_, stack), row in rows:
        for name, image in zip(row, stack, strict=True):
            assert np.array_equal(read_image(tmp_path / name), np.rint(image * 0.9))
