"""GenTL cameras through a stand-in for harvesters: there is no free producer to try them with."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fringeworks.devices import gentl
from fringeworks.devices.gentl import GenTLCamera
from fringeworks.errors import DeviceError, MissingExtraError
from fringeworks.files.station_devices import GenTLSettings
from fringeworks.model import Sensor

EXPOSURE_MS = 2.0


class FailedError(Exception):
    """What all errors of a module are."""


class LateError(FailedError):
    """No buffer came."""


@dataclass
class Node:
    """A feature of the camera; writing it is noted."""

    value: Any = None
    symbolics: tuple[str, ...] = ()
    min: float = 10.0
    max: float = 1e6


class Nodes:
    """A node map."""

    def __init__(self) -> None:
        self.ExposureAuto = Node("Continuous")
        self.GainAuto = Node("Continuous")
        self.Gain = Node(6.0)
        self.PixelFormat = Node("Mono8", ("Mono8", "Mono12Packed"))
        self.ExposureTime = Node(5000.0)
        self.Width, self.Height = Node(6), Node(4)
        self.TriggerMode = Node("On")
        self.TriggerSelector, self.TriggerSource = Node(), Node("Line0", ("Software", "Line0"))
        self.asked = 0
        self.TriggerSoftware = SimpleNamespace(execute=self._ask)

    def _ask(self) -> None:
        self.asked += 1

    def has_node(self, name: str) -> bool:
        return hasattr(self, name)

    def get_node(self, name: str) -> Node:
        return getattr(self, name)  # type: ignore[no-any-return]


@dataclass
class Acquirer:
    """Delivers frames whose levels are their numbers; every third is lost in part."""

    nodes: Nodes = field(default_factory=Nodes)
    number: int = 0
    queued: int = 0
    starts: int = 0
    running: bool = False
    silent: bool = False
    gone: bool = False

    @property
    def remote_device(self) -> SimpleNamespace:
        return SimpleNamespace(node_map=self.nodes)

    def start(self) -> None:
        assert not self.running
        self.running, self.starts = True, self.starts + 1

    def stop(self) -> None:
        self.running = False

    def destroy(self) -> None:
        self.running = False

    def queue_buffer(self, _: object) -> None:
        self.queued += 1

    def try_fetch(self, *, timeout: float, is_raw: bool) -> Any:
        assert self.running
        assert is_raw
        if self.gone:
            raise FailedError("the device is not connected")
        time.sleep(0.002)
        if self.silent:
            raise LateError
        self.number += 1
        if self.number % 3 == 0:
            return None
        raw = np.full(24, self.number, np.uint8)
        if self.nodes.PixelFormat.value == "Mono12Packed":
            raw = np.tile(np.array([self.number, 0x21, self.number], np.uint8), 12)
        return SimpleNamespace(
            parent=self, raw_buffer=raw, width=6, height=4, frame_id=self.number, image_offset=0
        )


@pytest.fixture
def acquirer() -> Acquirer:
    return Acquirer()


@pytest.fixture
def opened(
    acquirer: Acquirer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., GenTLCamera]]:
    item = SimpleNamespace(
        id_="cam-1", serial_number="77", user_defined_name="", vendor="Maker", model="M5"
    )
    harvester = SimpleNamespace(
        add_file=lambda _: None,
        update=lambda: None,
        reset=lambda: None,
        device_info_list=[item],
        create=lambda place: acquirer if place == 0 else None,
    )
    modules = (
        SimpleNamespace(Harvester=lambda: harvester),
        SimpleNamespace(GenericException=FailedError, TimeoutException=LateError),
        SimpleNamespace(GenericException=FailedError),
    )
    monkeypatch.setattr(gentl, "import_harvesters", lambda: modules)
    (tmp_path / "maker.cti").touch()
    cameras: list[GenTLCamera] = []

    def make(**settings: Any) -> GenTLCamera:
        given = {"producer": str(tmp_path / "maker.cti"), **settings}
        cameras.append(GenTLCamera(GenTLSettings(**given), Sensor))
        return cameras[-1]

    yield make
    for camera in cameras:
        camera.close()


def test_frames_of_its_numbers(opened: Callable[..., GenTLCamera], acquirer: Acquirer) -> None:
    camera = opened(device="77", pixel_format="Mono8")
    grabs = [camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=1) for _ in range(4)]
    assert [grab.number for grab in grabs] == [1, 2, 4, 5]
    assert [int(grab.image()[3, 5]) for grab in grabs] == [1, 2, 4, 5]
    assert acquirer.queued >= 4
    assert grabs[0].start_s < time.monotonic() - EXPOSURE_MS / 1000
    assert (camera.name, camera.width, camera.height) == ("Maker M5", 6, 4)


def test_it_is_set_up(opened: Callable[..., GenTLCamera], acquirer: Acquirer) -> None:
    camera, nodes = opened(gain_db=3.0), acquirer.nodes
    assert nodes.ExposureAuto.value == nodes.GainAuto.value == nodes.TriggerMode.value == "Off"
    assert (nodes.PixelFormat.value, nodes.Gain.value) == ("Mono12Packed", 3.0)
    assert camera.sensor.full_scale == 4095
    image = camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=1).image()
    assert image[0, :2].tolist() == [16 + 1, 16 + 2]
    assert nodes.ExposureTime.value == 1000 * EXPOSURE_MS


def test_a_frame_that_was_asked_for(opened: Callable[..., GenTLCamera], acquirer: Acquirer) -> None:
    camera = opened(trigger="software")
    asked_s = time.monotonic()
    grab = camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=1)
    assert asked_s <= grab.start_s < time.monotonic()
    assert acquirer.nodes.asked == 1
    assert acquirer.nodes.TriggerMode.value == "On"


@pytest.mark.parametrize("trigger", ["software", "Line0"])
def test_a_wait_in_vain(
    opened: Callable[..., GenTLCamera], acquirer: Acquirer, trigger: str
) -> None:
    acquirer.silent = True
    with pytest.raises(TimeoutError, match=r"no frame within 0\.05 s"):
        opened(trigger=trigger).grab(exposure_ms=EXPOSURE_MS, timeout_s=0.05)
    assert acquirer.running
    assert acquirer.starts == (2 if trigger == "software" else 1)


def test_a_frame_that_waited_keeps_the_time_of_its_arrival(
    opened: Callable[..., GenTLCamera],
) -> None:
    camera = opened()
    camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=1)
    time.sleep(0.1)
    before_s = time.monotonic()
    assert camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=1).start_s < before_s


def test_a_camera_that_goes(opened: Callable[..., GenTLCamera], acquirer: Acquirer) -> None:
    camera = opened()
    acquirer.gone = True
    with pytest.raises(DeviceError, match="Maker M5: the device is not connected"):
        camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=1)
    camera.close()
    other = opened()
    other.close()
    with pytest.raises(DeviceError, match="Maker M5: was let go of"):
        other.grab(exposure_ms=EXPOSURE_MS, timeout_s=1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"producer": "none.cti"}, "none.cti: there is no such producer"),
        ({"device": "78"}, "78 is not there; maker.cti finds: cam-1"),
        ({"pixel_format": "Mono9"}, "must be one of Mono8, Mono12Packed, got Mono9"),
        ({"trigger": "Line3"}, "trigger must be free or one of Software, Line0, got Line3"),
    ],
)
def test_settings_that_it_refuses(
    opened: Callable[..., GenTLCamera], settings: dict[str, str], message: str
) -> None:
    with pytest.raises(DeviceError, match=message):
        opened(**settings)


def test_an_exposure_that_it_does_not_have(opened: Callable[..., GenTLCamera]) -> None:
    with pytest.raises(DeviceError, match=r"exposure_ms must be 0\.01 to 1000, got 2000"):
        opened().grab(exposure_ms=2000, timeout_s=1)


def test_the_real_harvesters_find_nothing_in_a_file_that_is_no_producer(tmp_path: Path) -> None:
    pytest.importorskip("harvesters", reason="needs harvesters")
    (tmp_path / "no.cti").write_bytes(b"")
    with pytest.raises(DeviceError, match=r"no\.cti finds: none"):
        GenTLCamera(GenTLSettings(str(tmp_path / "no.cti")), Sensor)


def test_without_harvesters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "genicam", None)
    with pytest.raises(MissingExtraError, match=r"fringeworks\[hardware\]"):
        GenTLCamera(GenTLSettings("maker.cti"), Sensor)
