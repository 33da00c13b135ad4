"""The simulated bench keeps its times: latency, rhythm, buffer, faults, mixtures."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import pytest

from fringeworks.devices import Faults, Grab, MonotonicClock, SimulatedBench, VirtualClock
from fringeworks.devices.simulated import BUFFERED_FRAMES
from fringeworks.errors import ShapeError
from fringeworks.twin.effects import LEAST_MS, Effects
from tests.devices.stages import HEIGHT, WIDTH, MirrorStage, flat, seen

INTERVAL_S = 0.0333
"""`Effects.frame_interval_ms` by default."""

EXPOSURE_MS = 10.0

Make = Callable[..., tuple[SimulatedBench, VirtualClock, MirrorStage]]


@pytest.fixture
def make() -> Make:
    def bench(**options: object) -> tuple[SimulatedBench, VirtualClock, MirrorStage]:
        clock, stage = VirtualClock(), MirrorStage()
        rng = np.random.default_rng(0)
        return SimulatedBench(stage, rng=rng, clock=clock, **options), clock, stage  # type: ignore[arg-type]

    return bench


def grab(bench: SimulatedBench, *, exposure_ms: float = EXPOSURE_MS) -> Grab:
    return bench.camera.grab(exposure_ms=exposure_ms, timeout_s=1.0)


def test_the_camera_runs_freely(make: Make) -> None:
    """Frame n starts n intervals after the first and is there when it is exposed."""
    bench, clock, _ = make()
    for number in range(5):
        frame = grab(bench)
        assert frame.number == number
        assert frame.start_s == pytest.approx(number * INTERVAL_S, abs=1e-12)
        assert clock.now() == pytest.approx(frame.start_s + EXPOSURE_MS / 1000, abs=1e-12)


def test_an_exposure_longer_than_the_interval_sets_the_rhythm(make: Make) -> None:
    bench, _, _ = make()
    first, second = grab(bench, exposure_ms=50.0), grab(bench, exposure_ms=50.0)
    assert second.start_s - first.start_s == pytest.approx(0.05)


def test_the_buffer_keeps_the_oldest_frames(make: Make) -> None:
    """A frame that finds it full is lost, and with it its number."""
    bench, clock, _ = make()
    clock.sleep(20.5 * INTERVAL_S)
    numbers = [grab(bench).number for _ in range(BUFFERED_FRAMES + 1)]
    assert numbers == [*range(BUFFERED_FRAMES), 21]


def test_light_follows_after_the_latency(make: Make) -> None:
    """50 ms: frames 0 and 1 (33.3 to 43.3 ms) are dark, frame 2 (66.6 ms) shows the image."""
    bench, _, _ = make(latency_ms=50.0)
    bench.projector.show(flat(200))
    levels = [int(grab(bench).image()[0, 0]) for _ in range(3)]
    assert levels == [0, 0, 100]


def test_a_change_within_an_exposure_mixes_by_time(make: Make) -> None:
    """Lit from 4 ms on, of the 10 ms of frame 0: 0.6 of the light, 60 of 100 levels."""
    bench, _, _ = make(latency_ms=4.0)
    bench.projector.show(flat(200))
    assert np.array_equal(grab(bench).image(), np.full((HEIGHT, WIDTH), 60))


def test_three_images_within_an_exposure(make: Make) -> None:
    """100 for 2 ms, 200 for 3 ms, of 10 ms, at half exposure: (2 * 50 + 3 * 100) / 10 = 40."""
    bench, clock, _ = make(latency_ms=0.0)
    for level, duration_s in ((100, 0.002), (200, 0.003), (0, 0.0)):
        bench.projector.show(flat(level))
        clock.sleep(duration_s)
    assert grab(bench).image()[0, 0] == 40


def test_a_shown_image_is_the_projectors_own(make: Make) -> None:
    """The caller may draw the next one into the same array."""
    bench, _, _ = make(latency_ms=0.0)
    image = flat(200)
    bench.projector.show(image)
    image[:] = 0
    assert grab(bench).image()[0, 0] == 100


def test_a_repeated_frame_has_one_number_and_one_image(make: Make) -> None:
    bench, _, stage = make(faults=Faults(repeated=(1,)))
    frames = [grab(bench) for _ in range(4)]
    assert [frame.number for frame in frames] == [0, 1, 1, 2]
    assert frames[1].image() is frames[2].image()
    assert len(stage.times_s) == 1


def test_a_dropped_frame_leaves_a_gap(make: Make) -> None:
    bench, _, _ = make(faults=Faults(dropped=range(1, 3)))
    assert [grab(bench).number for _ in range(3)] == [0, 3, 4]


def test_a_hanging_camera_times_out_and_comes_back(make: Make) -> None:
    bench, clock, _ = make(faults=Faults(dropped=range(1, 41)))
    grab(bench)
    before = clock.now()
    with pytest.raises(TimeoutError, match="no frame within 1 s"):
        grab(bench)
    assert clock.now() - before == pytest.approx(1.0)
    assert grab(bench).number == 41


def test_a_camera_that_hangs_for_good(make: Make) -> None:
    bench, clock, _ = make(faults=Faults(dropped=range(sys.maxsize)))
    for _ in range(3):
        with pytest.raises(TimeoutError):
            grab(bench)
    assert clock.now() == pytest.approx(3.0)


def test_another_exposure_empties_the_buffer(make: Make) -> None:
    """No frame of the old exposure is delivered; the numbers go on."""
    bench, clock, _ = make(latency_ms=0.0)
    bench.projector.show(flat(200))
    clock.sleep(2.5 * INTERVAL_S)
    frame = grab(bench, exposure_ms=5.0)
    assert frame.start_s == pytest.approx(2.5 * INTERVAL_S)
    assert frame.number == 3
    assert np.array_equal(frame.image(), seen(flat(200), 5.0))


def test_the_stage_is_told_the_time(make: Make) -> None:
    """Its time 0 is the bench's making; frames nobody looks at are not exposed."""
    bench, _, stage = make()
    grab(bench)
    grab(bench).image()
    assert stage.times_s == [pytest.approx(INTERVAL_S)]


def test_a_closed_projector_is_dark(make: Make) -> None:
    bench, clock, _ = make(latency_ms=0.0)
    bench.projector.show(flat(200))
    bench.projector.close()
    clock.sleep(INTERVAL_S)
    grab(bench)
    assert not grab(bench).image().any()


@pytest.mark.parametrize("image", [flat(0)[1:], flat(0).astype(np.uint16)])
def test_images_of_another_size_or_depth_are_refused(
    make: Make, image: np.ndarray[tuple[int, int], np.dtype[np.uint8]]
) -> None:
    bench, _, _ = make()
    with pytest.raises(ShapeError, match=r"image must be \(16, 24\) of uint8"):
        bench.projector.show(image)


def test_the_machines_clock() -> None:
    clock = MonotonicClock()
    before = clock.now()
    clock.sleep(0.01)
    assert clock.now() - before >= 0.01


def test_frames_that_nobody_fetches_cost_nothing(make: Make) -> None:
    """A minute of a hundred thousand frames a second."""
    bench, clock, stage = make(latency_ms=0.0)
    stage.effects = Effects(frame_interval_ms=LEAST_MS)
    grab(bench, exposure_ms=0.01)
    clock.sleep(60.0)
    numbers = [grab(bench, exposure_ms=0.01).number for _ in range(BUFFERED_FRAMES + 1)]
    assert numbers[:-1] == [1, 2, 3, 4]
    assert numbers[-1] == pytest.approx(6_000_000, abs=2)
