"""Aravis's own GigE camera on loopback; frame k shows a ramp that has moved on by k levels.

All tests of it are in this file: it listens at a port that it cannot be told.
"""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np
import pytest

from fringeworks.acquire import acquire_sequence
from fringeworks.devices import MonotonicClock
from fringeworks.devices.genicam import FrameNumbers, GenicamCamera
from fringeworks.devices.protocols import CameraDevice, Grab
from fringeworks.errors import DeviceError
from fringeworks.files import read_capture
from fringeworks.files.images import read_image
from fringeworks.files.station import Timing
from fringeworks.files.station_devices import GenicamSettings
from fringeworks.model import Frames, Fringe, PatternSet, Sensor, Sequence
from fringeworks.patterns import frame_names
from tests.cli.scenes import run

pytest.importorskip("gi", reason="needs PyGObject")

PROGRAM = shutil.which("arv-fake-gv-camera-0.8")
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="needs the Debian package aravis-tools")

HOST, PORT = "127.0.0.1", 3956
EXPOSURE_MS, TIMING = 10.0, Timing(settle_ms=1.0, timeout_s=1.0, retries=1)
SEQUENCE = Sequence(
    32,
    24,
    tuple(PatternSet(Fringe("x", period, tuple(range(0, 360, 45)))) for period in (8, 16, 32)),
)


class FakeCamera:
    """The process; it can be started again."""

    def start(self) -> None:
        assert PROGRAM is not None
        self._process = subprocess.Popen(
            [PROGRAM, "-i", HOST], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        end_s = time.monotonic() + 10
        while not listening() and time.monotonic() < end_s:
            time.sleep(0.02)

    def stop(self) -> None:
        self._process.kill()
        self._process.wait()


def listening() -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((HOST, PORT))
        except OSError:
            return True
    return False


@pytest.fixture
def fake() -> Iterator[FakeCamera]:
    camera = FakeCamera()
    camera.start()
    yield camera
    camera.stop()


@pytest.fixture
def opened(fake: FakeCamera) -> Iterator[Callable[..., GenicamCamera]]:
    cameras: list[GenicamCamera] = []

    def open_camera(**settings: str) -> GenicamCamera:
        given = GenicamSettings(device=HOST, **settings)  # type: ignore[arg-type]
        cameras.append(GenicamCamera(given, Sensor))
        return cameras[-1]

    yield open_camera
    for camera in cameras:
        camera.close()


@dataclass
class Watched:
    """A camera whose grabs are kept by number."""

    camera: CameraDevice
    seen: dict[int, Frames] = field(default_factory=dict)
    after: Callable[[int], None] = lambda _: None

    @property
    def name(self) -> str:
        return self.camera.name

    @property
    def width(self) -> int:
        return self.camera.width

    @property
    def height(self) -> int:
        return self.camera.height

    @property
    def sensor(self) -> Sensor:
        return self.camera.sensor

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        self.after(len(self.seen))
        grab = self.camera.grab(exposure_ms=exposure_ms, timeout_s=timeout_s)
        self.seen[grab.number] = grab.image()
        return grab

    def close(self) -> None:
        self.camera.close()


class Lamp:
    """A projector that nobody sees."""

    name, width, height, bits = "lamp", 32, 24, 8

    def show(self, image: Frames) -> None:
        """Nothing to do."""

    def close(self) -> None:
        """Nothing to do."""


def take(camera: Watched, folder: Path) -> int:
    done = acquire_sequence(
        SEQUENCE, Lamp(), camera, folder=folder, exposure_ms=EXPOSURE_MS, timing=TIMING
    )
    return done.taken


def steps(first: Frames, image: Frames) -> int:
    """How many levels the ramp has moved on, of the 255 after which it is back."""
    return int(
        np.argmin(
            [
                np.count_nonzero(np.roll(first, -k, axis=1)[0, :255] != image[0, :255])
                for k in range(255)
            ]
        )
    )


@pytest.mark.parametrize("trigger", ["free", "software"])
def test_a_capture_of_24_frames_holds_the_frames_of_its_numbers(
    opened: Callable[..., GenicamCamera], tmp_path: Path, trigger: str
) -> None:
    camera = Watched(opened(trigger=trigger, pixel_format="Mono8"))
    assert take(camera, tmp_path / "a") == 24
    numbers = list(camera.seen)
    assert numbers == sorted(set(numbers))
    files = [read_image(tmp_path / "a" / name) for row in frame_names(SEQUENCE) for name in row]
    used = [next(n for n in numbers if np.array_equal(camera.seen[n], image)) for image in files]
    assert used == sorted(set(used))
    moved = [steps(files[0], image) for image in files]
    assert moved == [(number - used[0]) % 255 for number in used]
    assert read_capture(tmp_path / "a").shape == (camera.height, camera.width)


def test_a_camera_that_goes_half_way_is_taken_up_again(
    fake: FakeCamera, opened: Callable[..., GenicamCamera], tmp_path: Path
) -> None:
    camera = Watched(opened(pixel_format="Mono8"))
    camera.after = lambda count: fake.stop() if count == 14 else None
    with pytest.raises(DeviceError, match=r"\.png: Aravis Fake: .*timeout.*give the same command"):
        take(camera, tmp_path / "a")
    camera.close()
    before = {path.name: read_image(path) for path in (tmp_path / "a").glob("*.png")}
    assert 0 < len(before) < 24

    fake.start()
    again = Watched(opened(pixel_format="Mono8"))
    assert take(again, tmp_path / "a") == 24 - len(before)
    for name, image in before.items():
        assert np.array_equal(read_image(tmp_path / "a" / name), image)
    fresh = [name for row in frame_names(SEQUENCE) for name in row if name not in before]
    files = [read_image(tmp_path / "a" / name) for name in fresh]
    used = [next(n for n in again.seen if np.array_equal(again.seen[n], image)) for image in files]
    assert used == sorted(set(used))
    assert read_capture(tmp_path / "a").provenance["resumed_at"] == [fresh[0]]


def test_frames_of_another_exposure_are_not_delivered(
    opened: Callable[..., GenicamCamera],
) -> None:
    """The fake camera's levels follow its exposure."""
    camera = opened(pixel_format="Mono8")
    brightest = [
        int(camera.grab(exposure_ms=exposure, timeout_s=2).image().max())
        for exposure in (10.0, 2.0, 10.0, 2.0, 2.0)
    ]
    assert brightest[0] == brightest[2] > 2 * brightest[1]
    assert brightest[1] == brightest[3] == brightest[4]


LONG_MS = 200.0


class Busy:
    """A camera that goes on with its frame for a while after it was told to stop."""

    def __init__(self, camera: Any) -> None:
        self._camera, self._idle_s = camera, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._camera, name)

    def stop_acquisition(self) -> None:
        self._idle_s = time.monotonic() + LONG_MS / 1000
        self._camera.stop_acquisition()

    def set_exposure_time(self, exposure_us: float) -> None:
        left_s = self._idle_s - time.monotonic()
        if left_s > 0:
            Timer(left_s, self._camera.set_exposure_time, (exposure_us,)).start()
        else:
            self._camera.set_exposure_time(exposure_us)


def test_the_end_of_the_frame_under_way_is_waited_for(
    opened: Callable[..., GenicamCamera],
) -> None:
    camera = opened(pixel_format="Mono8")
    dim = camera.grab(exposure_ms=2.0, timeout_s=2).image().max()
    assert camera.grab(exposure_ms=LONG_MS, timeout_s=2).image().max() > 2 * dim
    camera._camera = Busy(camera._camera)
    assert camera.grab(exposure_ms=2.0, timeout_s=2).image().max() == dim


def test_a_clock_that_is_set_makes_no_frame_younger(
    opened: Callable[..., GenicamCamera], monkeypatch: pytest.MonkeyPatch
) -> None:
    camera, real = opened(), time.time
    camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=2)
    for offset_s in (-5.0, 5.0):
        monkeypatch.setattr(time, "time", lambda offset_s=offset_s: real() + offset_s)
        grab = camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=2)
        assert grab.start_s < time.monotonic() - EXPOSURE_MS / 1000


def test_a_frame_begins_after_it_was_asked_for(opened: Callable[..., GenicamCamera]) -> None:
    camera, clock = opened(trigger="software"), MonotonicClock()
    camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=2)
    for _ in range(3):
        asked_s = clock.now()
        grab = camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=2)
        assert asked_s <= grab.start_s <= clock.now()


def test_free_frames_begin_their_exposure_before_they_arrive(
    opened: Callable[..., GenicamCamera],
) -> None:
    camera, clock = opened(), MonotonicClock()
    for _ in range(3):
        grab = camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=2)
    assert 0 < clock.now() - EXPOSURE_MS / 1000 - grab.start_s < 1


def test_colour_formats(opened: Callable[..., GenicamCamera]) -> None:
    camera = opened(pixel_format="BayerRG8")
    image = camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=2).image()
    assert image.shape == (camera.height, camera.width, 3)
    assert camera.sensor.full_scale == 255


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"pixel_format": "Mono9"}, "pixel_format must be one of Bayer.* got Mono9"),
        ({"trigger": "Line7"}, "trigger must be one of free, software, Line0, got Line7"),
    ],
)
def test_settings_that_it_does_not_have(
    opened: Callable[..., GenicamCamera], settings: dict[str, str], message: str
) -> None:
    with pytest.raises(DeviceError, match=message) as told:
        opened(**settings)
    camera = opened()  # while the error is kept
    assert camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=2).number > 0
    assert told.value.__traceback__ is not None


def test_an_exposure_that_it_does_not_have(opened: Callable[..., GenicamCamera]) -> None:
    with pytest.raises(DeviceError, match=r"exposure_ms must be 0\.01 to 10000, got 20000"):
        opened().grab(exposure_ms=20000, timeout_s=1)


def test_it_is_listed(fake: FakeCamera) -> None:
    """Of whatever else this machine has, the fake camera is told with the name it opens by."""
    listed = json.loads(run("devices", "--json").stdout)["devices"]
    found = [item for item in listed if item["name"].startswith("Aravis Fake")]
    assert [(item["role"], item["kind"]) for item in found] == [("camera", "genicam")]
    GenicamCamera(GenicamSettings(**found[0]["settings"]), Sensor).close()


def test_no_such_camera() -> None:
    with pytest.raises(DeviceError, match="no-such-camera"):
        GenicamCamera(GenicamSettings(device="no-such-camera"), Sensor)


def test_a_trigger_that_nobody_gives(opened: Callable[..., GenicamCamera]) -> None:
    camera = opened(trigger="Line0")
    with pytest.raises(TimeoutError, match=r"no frame within 0\.3 s"):
        camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=0.3)


def test_numbers_wrap_and_restarts_do_not() -> None:
    numbers = FrameNumbers()
    assert [numbers.take(n) for n in (65534, 65535, 1, 2, 700)] == [
        65534,
        65535,
        65536,
        65537,
        66235,
    ]
    restarted = FrameNumbers()
    assert [restarted.take(n) for n in (500, 1, 2)] == [500, 1, 2]
