"""Webcams: a stand-in with the manners of OpenCV's V4L2 backend, and the real one without any."""

from __future__ import annotations

import errno
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from fringeworks.devices import auto_gain
from fringeworks.devices.auto_gain import switch_off_auto_gain
from fringeworks.devices.opencv import BACKENDS, OpenCvCamera, choose_backend
from fringeworks.errors import DeviceError
from fringeworks.files.station_devices import OpenCvSettings
from fringeworks.model import Frames, Sensor

INTERVAL_S = 0.004
AUTOMATIC, MANUAL = 3.0, 1.0
LATE_FRAMES = 3
"""How many frames of the old exposure come after a change."""


@dataclass
class Webcam:
    """Meets what is used of `cv2.VideoCapture`; the green level of a frame is its exposure in ms.

    `stubborn` are properties that it does not let be changed, `absent` those that it lacks.
    """

    there: bool = True
    stubborn: tuple[int, ...] = ()
    absent: tuple[int, ...] = (cv2.CAP_PROP_AUTOFOCUS,)
    coarse: int = 1
    frames: int = 10**9
    grey: bool = False
    values: dict[int, float] = field(
        default_factory=lambda: {
            cv2.CAP_PROP_FRAME_WIDTH: 8.0,
            cv2.CAP_PROP_FRAME_HEIGHT: 6.0,
            cv2.CAP_PROP_AUTO_EXPOSURE: AUTOMATIC,
            cv2.CAP_PROP_AUTO_WB: 1.0,
            cv2.CAP_PROP_EXPOSURE: 156.0,
            cv2.CAP_PROP_BUFFERSIZE: 4.0,
        }
    )
    released: bool = False
    grabbed: int = 0
    waiting: list[float] = field(default_factory=list)

    def isOpened(self) -> bool:  # noqa: N802
        return self.there

    def get(self, prop: int) -> float:
        return -1.0 if prop in self.absent else self.values.get(prop, 0.0)

    def set(self, prop: int, value: float) -> bool:
        if prop in self.absent or prop in self.stubborn:
            return False
        if prop == cv2.CAP_PROP_EXPOSURE:
            assert self.values[cv2.CAP_PROP_AUTO_EXPOSURE] == MANUAL, "V4L2 says so"
            self.waiting = [self.values[prop]] * LATE_FRAMES
            value = self.coarse * round(value / self.coarse)
        self.values[prop] = value
        return True

    def grab(self) -> bool:
        assert not self.released
        time.sleep(INTERVAL_S)
        self.grabbed += 1
        return self.grabbed <= self.frames

    def retrieve(self) -> tuple[bool, Any]:
        units = self.waiting.pop(0) if self.waiting else self.values[cv2.CAP_PROP_EXPOSURE]
        level = np.full((6, 8), round(units / 10), np.uint8)
        if self.grey:
            return True, level
        return True, np.stack([level * 0, level, level * 0 + 200], axis=2)

    def release(self) -> None:
        self.released = True


Opener = Callable[..., tuple[OpenCvCamera, Webcam]]


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Iterator[Opener]:
    cameras: list[OpenCvCamera] = []
    monkeypatch.setattr("sys.platform", "linux")

    def make(webcam: Webcam | None = None, **settings: Any) -> tuple[OpenCvCamera, Webcam]:
        device = webcam or Webcam()

        def capture(index: int, backend: int) -> Webcam:
            assert (index, backend) == (settings.get("index", 0), cv2.CAP_V4L2)
            return device

        monkeypatch.setattr(cv2, "VideoCapture", capture)
        camera = OpenCvCamera(OpenCvSettings(**settings), Sensor, switch_off_gain=lambda _: None)
        cameras.append(camera)
        return camera, device

    yield make
    for camera in cameras:
        camera.close()


def frame(camera: OpenCvCamera, exposure_ms: float = 10.0) -> Frames:
    return camera.grab(exposure_ms=exposure_ms, timeout_s=2).image()


def test_all_that_it_does_by_itself_is_off(opened: Opener) -> None:
    camera, device = opened(index=2)
    assert device.values[cv2.CAP_PROP_AUTO_EXPOSURE] == MANUAL
    assert device.values[cv2.CAP_PROP_AUTO_WB] == 0
    assert device.values[cv2.CAP_PROP_EXPOSURE] == 100
    assert device.values[cv2.CAP_PROP_BUFFERSIZE] == 1
    assert (camera.width, camera.height, camera.name) == (8, 6, "webcam 2")
    assert camera.sensor.full_scale == 255


def test_colours_and_grey_levels(opened: Opener) -> None:
    camera, _ = opened()
    assert frame(camera)[0, 0].tolist() == [200, 10, 0]
    grey, _ = opened(Webcam(grey=True))
    assert frame(grey).shape == (6, 8)


def test_frames_of_another_exposure_are_not_delivered(opened: Opener) -> None:
    camera, _ = opened()
    seen = [int(frame(camera, ms)[0, 0, 1]) for ms in (10.0, 10.0, 20.0, 20.0, 10.0, 20.0, 10.0)]
    assert seen == [10, 10, 20, 20, 10, 20, 10]
    time.sleep(10 * INTERVAL_S)  # frames wait
    assert int(frame(camera, 20.0)[0, 0, 1]) == 20


def test_numbers_count_and_times_are_those_of_the_arrivals(opened: Opener) -> None:
    camera, device = opened(exposure_ms=2.0)
    grabs = [camera.grab(exposure_ms=2.0, timeout_s=2) for _ in range(5)]
    while device.grabbed < grabs[-1].number + 20:
        time.sleep(INTERVAL_S)
    asked_s = time.monotonic()
    late = camera.grab(exposure_ms=2.0, timeout_s=2)
    numbers, starts = zip(*((grab.number, grab.start_s) for grab in (*grabs, late)), strict=True)
    assert list(numbers) == sorted(set(numbers))
    assert list(starts) == sorted(starts)
    assert late.number > grabs[-1].number + 10
    assert late.start_s < asked_s - 0.002


def test_a_frame_begins_its_duration_before_it_arrives(opened: Opener) -> None:
    before_s = time.monotonic()
    camera, _ = opened(exposure_ms=50.0)
    starts = [camera.grab(exposure_ms=50.0, timeout_s=2).start_s for _ in range(3)]
    assert before_s - 0.05 < starts[0] < starts[2] < time.monotonic() - 0.05


@pytest.mark.parametrize(
    ("webcam", "settings", "message"),
    [
        (Webcam(there=False), {"index": 3}, "webcam 3: there is none, or another program has it"),
        (Webcam(stubborn=(cv2.CAP_PROP_AUTO_WB,)), {}, "its automatic white balance cannot be"),
        (
            Webcam(stubborn=(cv2.CAP_PROP_FRAME_WIDTH,)),
            {"width": 16, "height": 12},
            "size must be 16x12 px, got 8x12",
        ),
        (Webcam(coarse=30), {}, r"within 5%: told 10, it has 9"),
        (Webcam(stubborn=(cv2.CAP_PROP_AUTO_EXPOSURE,)), {}, "automatic exposure cannot be"),
        (Webcam(absent=(cv2.CAP_PROP_EXPOSURE,)), {}, "told 10, it has 0"),
    ],
)
def test_a_webcam_that_does_not_obey_is_refused(
    opened: Opener, webcam: Webcam, settings: dict[str, int], message: str
) -> None:
    with pytest.raises(DeviceError, match=message):
        opened(webcam, **settings)
    assert webcam.released


def test_an_automatic_focus_that_stays_on(opened: Opener) -> None:
    webcam = Webcam(stubborn=(cv2.CAP_PROP_AUTOFOCUS,), absent=())
    webcam.values[cv2.CAP_PROP_AUTOFOCUS] = 1.0
    with pytest.raises(DeviceError, match="automatic focus cannot be turned off"):
        opened(webcam)


def test_an_exposure_that_it_refuses_later(opened: Opener) -> None:
    camera, _ = opened(Webcam(coarse=100))
    frame(camera)
    with pytest.raises(DeviceError, match="told 14, it has 10"):
        frame(camera, 14.0)


def test_a_webcam_that_is_unplugged(opened: Opener) -> None:
    camera, device = opened(Webcam(frames=12))
    while not device.released:
        time.sleep(INTERVAL_S)
    with pytest.raises(DeviceError, match="delivers no frames any more"):
        frame(camera)
    camera.close()
    with pytest.raises(DeviceError, match="delivers no frames any more"):
        frame(camera)


def test_a_wait_in_vain_and_the_end(opened: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    camera, device = opened()
    with pytest.raises(TimeoutError, match=r"no frame within 0\.001 s"):
        camera.grab(exposure_ms=30.0, timeout_s=0.001)
    camera.close()
    camera.close()
    assert device.released


def test_no_webcam_at_all() -> None:
    """The real OpenCV."""
    with pytest.raises(DeviceError, match="webcam 97: there is none"):
        OpenCvCamera(OpenCvSettings(index=97), Sensor)


def test_each_system_has_its_units() -> None:
    linux, windows = BACKENDS["linux"], BACKENDS["win32"]
    assert (linux.value_of_ms(12.34), linux.ms_of_value(123.0)) == (123, 12.3)
    assert (windows.value_of_ms(8.0), windows.ms_of_value(-7.0)) == (-7, 7.8125)
    with pytest.raises(DeviceError, match="Linux and Windows"):
        choose_backend("darwin")


@dataclass
class Control:
    """The automatic gain of a driver; `fails` with this error."""

    value: int = 1
    obeys: bool = True
    fails: int | None = None

    def __call__(self, _: object, request: int, argument: bytes) -> bytes:
        if self.fails is not None:
            raise OSError(self.fails, "refused")
        name, value = struct.unpack("=Ii", argument)
        assert name == 0x00980912
        if request == auto_gain.SET_CONTROL and self.obeys:
            self.value = value
        return struct.pack("=Ii", name, self.value)


@pytest.mark.parametrize(
    ("control", "refused"),
    [
        (Control(), False),
        (Control(fails=errno.EINVAL), False),
        (Control(fails=errno.ENOTTY), False),
        (Control(obeys=False), True),
        (Control(fails=errno.EACCES), True),
    ],
)
def test_the_automatic_gain(
    control: Control, refused: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "video4").touch()
    monkeypatch.setattr(auto_gain, "DEVICES", tmp_path)
    monkeypatch.setattr("sys.platform", "linux")
    switch = partial(switch_off_auto_gain, 4, ioctl=control)
    if refused:
        with pytest.raises(DeviceError, match="webcam 4: its automatic gain cannot be"):
            switch()
    else:
        switch()


def test_no_gain_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "win32")
    switch_off_auto_gain(0, ioctl=Control(obeys=False))
