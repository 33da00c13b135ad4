"""No frame lands under another pattern's name, whatever the camera does."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fringeworks.acquire import Tally, Timing, acquire_sequence
from fringeworks.devices import CameraDevice, Faults, Grab, MonotonicClock, SimulatedBench
from fringeworks.errors import DeviceError
from fringeworks.files import read_capture, read_image
from fringeworks.model import Frames, Sensor
from fringeworks.twin.effects import Effects
from tests.acquire.benches import (
    EXPOSURE_MS,
    NAMES,
    SEQUENCE,
    acquire,
    assert_every_image_shows_its_pattern,
    expected,
    make_bench,
)
from tests.devices.stages import HEIGHT, WIDTH, MirrorStage, flat

PATTERNS = len({name.partition("_r")[0] for name in NAMES})
FRAMES = st.frozensets(st.integers(0, 80), max_size=30)


def test_frames_from_before_are_passed_over(tmp_path: Path) -> None:
    """60 ms of settling at 33.3 ms a frame leave at least one stale frame per pattern shown."""
    done = acquire(tmp_path)
    assert_every_image_shows_its_pattern(tmp_path)
    assert (done.images, done.taken) == (len(NAMES), len(NAMES))
    assert done.frames.stale >= PATTERNS
    assert (done.frames.repeated, done.frames.dropped, done.frames.timeouts) == (0, 0, 0)


@settings(max_examples=60)
@given(
    dropped=FRAMES,
    repeated=FRAMES,
    latency_ms=st.floats(0.0, 60.0),
    interval_ms=st.floats(10.0, 200.0),
)
def test_no_fault_mixes_frames_up(
    dropped: frozenset[int], repeated: frozenset[int], latency_ms: float, interval_ms: float
) -> None:
    """Any latency up to the settling time, any rhythm, drops and repeats in any mixture."""
    faults = Faults(dropped=dropped, repeated=repeated)
    bench = make_bench(faults=faults, latency_ms=latency_ms, interval_ms=interval_ms)
    with TemporaryDirectory() as folder:
        acquire(Path(folder), bench, timing=Timing(retries=20))
        assert_every_image_shows_its_pattern(Path(folder))


def test_settling_shorter_than_the_latency_is_seen(tmp_path: Path) -> None:
    """The bench is honest: what the settling time is there for happens without it."""
    acquire(tmp_path, make_bench(latency_ms=50.0), timing=Timing(settle_ms=0.0))
    wanted = expected()
    wrong = [
        name for name in NAMES if not np.array_equal(read_image(tmp_path / name), wanted[name])
    ]
    assert len(wrong) > len(NAMES) / 2


def test_repeats_are_different_frames(tmp_path: Path) -> None:
    """Every frame comes twice: two images of one pattern are still two exposures."""
    done = acquire(tmp_path, make_bench(faults=Faults(repeated=range(sys.maxsize))))
    assert_every_image_shows_its_pattern(tmp_path)
    times = read_capture(tmp_path).sequence.sets[0].timestamps_s
    assert times is not None
    assert (np.diff(times) > 0.03).all()
    assert done.frames.repeated >= 3


def test_dropped_frames_are_counted_and_replaced(tmp_path: Path) -> None:
    lost = Faults(dropped=(2, 5, 6, 13))
    done = acquire(tmp_path, make_bench(faults=lost))
    assert_every_image_shows_its_pattern(tmp_path)
    assert done.frames.dropped == 4


def test_a_wait_in_vain_shows_the_pattern_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """40 frames are 1.3 s: two waits of 0.5 s in vain, the third brings a frame."""
    bench, clock = make_bench(faults=Faults(dropped=range(10, 50)))
    shown: list[Frames] = []
    show = bench.projector.show

    def note(image: Frames) -> None:
        shown.append(image)
        show(image)

    monkeypatch.setattr(bench.projector, "show", note)
    done = acquire(tmp_path, (bench, clock), timing=Timing(timeout_s=0.5, retries=3))
    assert_every_image_shows_its_pattern(tmp_path)
    assert done.frames.timeouts == 2
    assert len(shown) == PATTERNS + 2


def test_a_camera_that_hangs_is_named_with_the_image(tmp_path: Path) -> None:
    bench = make_bench(faults=Faults(dropped=range(10, sys.maxsize)))
    with pytest.raises(DeviceError) as caught:
        acquire(tmp_path, bench, timing=Timing(timeout_s=0.5, retries=2))
    assert caught.value.exit_status == 3
    taken = sorted(path.name for path in tmp_path.glob("*.png"))
    following = NAMES[len(taken)]
    assert str(caught.value).startswith(f"{following}: no frame whose exposure began 60 ms")
    for words in ("within 0.5 s, 3 times in a row", "cable", "timeout_s", "same command again"):
        assert words in str(caught.value)
    assert taken == sorted(NAMES[: len(taken)])
    assert not (tmp_path / "capture.toml").exists()

    assert acquire(tmp_path).taken == len(NAMES) - len(taken)
    assert_every_image_shows_its_pattern(tmp_path)


@dataclass
class Stub:
    """A camera that gives what it is told, one frame every 10 ms."""

    frames: list[Grab | Exception]
    width: int = WIDTH
    height: int = HEIGHT
    name: str = "stub"
    sensor: Sensor = field(default_factory=lambda: Sensor(255.0))

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        following = self.frames.pop(0)
        if isinstance(following, Exception):
            raise following
        return following

    def close(self) -> None: ...


def test_a_devices_own_words_are_kept(tmp_path: Path) -> None:
    camera = Stub([DeviceError("the camera was unplugged")])
    with pytest.raises(DeviceError, match=f"^{NAMES[0]}: the camera was unplugged; then give"):
        acquire(tmp_path, camera=camera)


def test_a_frame_of_another_size_is_refused(tmp_path: Path) -> None:
    camera = Stub([Grab(3, 1.0, lambda: flat(0)[:, 1:])])
    with pytest.raises(DeviceError, match=r"frame 3 must be 24x16 px, got 23x16"):
        acquire(tmp_path, camera=camera)


def test_a_camera_that_was_started_again_leaves_no_gap(tmp_path: Path) -> None:
    """Its numbers begin anew; a gap of minus 899 is none."""
    frames: list[Grab | Exception] = [
        Grab(number, float(place + 1), lambda: flat(0))
        for place, number in enumerate([900, 1, *range(2, 10)])
    ]
    done = acquire(tmp_path, camera=Stub(frames))
    assert done.frames == Tally()


@dataclass
class TimedByArrival:
    """A camera that says of its frames when they came, 100 ms after they began."""

    camera: CameraDevice
    name: str = "late"
    width: int = WIDTH
    height: int = HEIGHT
    sensor: Sensor = field(default_factory=lambda: Sensor(255.0))

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        grab = self.camera.grab(exposure_ms=exposure_ms, timeout_s=timeout_s)
        return replace(grab, start_s=grab.start_s + 0.1)

    def close(self) -> None: ...


def test_frames_to_drop_make_up_for_times_that_lie(tmp_path: Path) -> None:
    """Three frames begin in the 100 ms by which the settling time is cut short."""
    bench = make_bench()
    acquire(tmp_path / "none", bench, camera=TimedByArrival(bench[0].camera))
    with pytest.raises(AssertionError):
        assert_every_image_shows_its_pattern(tmp_path / "none")
    bench = make_bench()
    timing = Timing(drop_frames=3)
    done = acquire(tmp_path / "some", bench, camera=TimedByArrival(bench[0].camera), timing=timing)
    assert_every_image_shows_its_pattern(tmp_path / "some")
    assert done.frames.stale >= 3 * PATTERNS
    assert read_capture(tmp_path / "some").provenance["drop_frames"] == 3


def test_the_machines_clock_does_too(tmp_path: Path) -> None:
    """Real time: about 40 ms an image."""
    stage = MirrorStage(effects=Effects(frame_interval_ms=12.0))
    rng = np.random.default_rng(0)
    bench = SimulatedBench(stage, rng=rng, clock=MonotonicClock(), latency_ms=5.0)
    acquire_sequence(
        SEQUENCE,
        bench.projector,
        bench.camera,
        folder=tmp_path,
        exposure_ms=EXPOSURE_MS,
        timing=Timing(settle_ms=15.0),
    )
    assert_every_image_shows_its_pattern(tmp_path)
