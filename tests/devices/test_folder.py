"""A folder that a thread writes images into, as cameras' own programs do."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Thread
from typing import cast

import cv2
import numpy as np
import pytest

from fringeworks.acquire import Timing, acquire_sequence
from fringeworks.devices import folder
from fringeworks.devices.folder import STABLE_S, FolderCamera
from fringeworks.errors import DeviceError
from fringeworks.files import read_capture, read_image, write_image
from fringeworks.files.station_devices import FolderSettings
from fringeworks.model import Frames, Fringe, PatternSet, Sensor, Sequence
from fringeworks.patterns import frame_names

EXPOSURE_MS = 10.0


def noise(seed: int, bits: int = 8) -> Frames:
    kind = np.uint8 if bits == 8 else np.uint16
    levels = np.random.default_rng(seed).integers(0, 2**bits, (24, 32))
    return cast(Frames, levels.astype(kind))


def encoded(image: Frames, suffix: str = ".png") -> bytes:
    return bytes(cv2.imencode(suffix, image)[1])


@pytest.fixture
def started() -> Iterator[Callable[[Callable[[], None]], None]]:
    threads: list[Thread] = []

    def start(work: Callable[[], None]) -> None:
        threads.append(Thread(target=work))
        threads[-1].start()

    yield start
    for thread in threads:
        thread.join()


def folder_camera(path: Path, **settings: object) -> FolderCamera:
    return FolderCamera(FolderSettings(str(path), **settings), Sensor)  # type: ignore[arg-type]


def grabbed(camera: FolderCamera) -> Frames:
    return camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=5).image()


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tiff", ".jpg"])
def test_a_file_that_grows_slowly_is_waited_for(
    tmp_path: Path, started: Callable[[Callable[[], None]], None], suffix: str
) -> None:
    camera = folder_camera(tmp_path, pattern=f"*{suffix}", width=32, height=24)
    data = encoded(noise(1), suffix)

    def write() -> None:
        with (tmp_path / f"a{suffix}").open("wb") as file:
            for part in np.array_split(np.frombuffer(data, np.uint8), 8):
                file.write(part.tobytes())
                file.flush()
                time.sleep(STABLE_S / 3)

    started(write)
    seen = grabbed(camera)
    (tmp_path / f"whole{suffix}").write_bytes(data)
    assert np.array_equal(seen, read_image(tmp_path / f"whole{suffix}"))


def test_a_file_that_is_written_over_is_waited_for(
    tmp_path: Path,
    started: Callable[[Callable[[], None]], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As by programs that make room first: what can be decoded need not be all."""
    monkeypatch.setattr(folder, "STABLE_S", 0.5)
    camera = folder_camera(tmp_path, width=32, height=24)

    def write() -> None:
        for seed in (1, 2, 3):
            (tmp_path / "a.png").write_bytes(encoded(noise(seed)))
            time.sleep(0.1)

    started(write)
    assert np.array_equal(grabbed(camera), noise(3))


def test_a_half_of_an_image_is_none(tmp_path: Path) -> None:
    camera = folder_camera(tmp_path, width=32, height=24)
    data = encoded(noise(2))
    (tmp_path / "a.png").write_bytes(data[: len(data) // 2])
    with pytest.raises(TimeoutError, match=r"no complete new image within 0\.3 s"):
        camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=0.3)
    (tmp_path / "a.png").write_bytes(data)
    assert np.array_equal(grabbed(camera), noise(2))


def test_renamed_files_and_their_order(
    tmp_path: Path, started: Callable[[Callable[[], None]], None]
) -> None:
    write_image(tmp_path / "old.png", noise(0))
    camera = folder_camera(tmp_path)

    def write() -> None:
        for seed in (3, 2, 1):
            (tmp_path / "a.part").write_bytes(encoded(noise(seed)))
            (tmp_path / "a.part").rename(tmp_path / f"{seed}.png")
            time.sleep(0.03)

    started(write)
    for number, seed in enumerate((3, 2, 1), start=1):
        grab = camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=5)
        assert grab.number == number
        assert np.array_equal(grab.image(), noise(seed))


def test_it_begins_its_exposure_before_the_file_was_written(tmp_path: Path) -> None:
    camera = folder_camera(tmp_path, width=32, height=24, exposure_ms=200.0)
    before_s = time.monotonic()
    write_image(tmp_path / "a.png", noise(1))
    written_s = time.monotonic()
    grab = camera.grab(exposure_ms=200.0, timeout_s=5)
    assert before_s - 0.22 < grab.start_s < written_s - 0.19


def test_a_file_from_the_future_is_refused(tmp_path: Path) -> None:
    """It may be older than the pattern: its writer's clock does not tell."""
    camera = folder_camera(tmp_path, width=32, height=24)
    write_image(tmp_path / "a.png", noise(1))
    os.utime(tmp_path / "a.png", (time.time() + 60, time.time() + 60))
    with pytest.raises(DeviceError, match=r"a\.png: was written .* s from now"):
        camera.grab(exposure_ms=EXPOSURE_MS, timeout_s=5)


def test_size_and_depth(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="give width and height"):
        folder_camera(tmp_path)
    given = folder_camera(tmp_path, width=8, height=6)
    assert (given.width, given.height, given.sensor.full_scale) == (8, 6, 255)
    write_image(tmp_path / "a.png", noise(1, bits=16))
    newest = folder_camera(tmp_path)
    assert (newest.width, newest.height, newest.sensor.full_scale) == (32, 24, 65535)
    assert newest.name == f"images in {tmp_path.name}"
    write_image(tmp_path / "b.png", noise(1))
    with pytest.raises(DeviceError, match=r"b\.png: must have 16 bit, got 8"):
        grabbed(newest)


def test_what_it_cannot_do(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="is no folder"):
        folder_camera(tmp_path / "nowhere")
    with pytest.raises(DeviceError, match=r"pattern must be names in the folder.*got '/a/\*'"):
        folder_camera(tmp_path, pattern="/a/*", width=8, height=6)
    camera = folder_camera(tmp_path, width=8, height=6)
    with pytest.raises(DeviceError, match="exposure_ms must be 10 as in the station, got 20"):
        camera.grab(exposure_ms=20.0, timeout_s=1)
    camera.close()


class Shutter:
    """A projector, and a program that takes an image some time after each one shown."""

    name, width, height, bits = "shutter", 32, 24, 8

    def __init__(self, path: Path, start: Callable[[Callable[[], None]], None]) -> None:
        self._folder, self._start, self._count = path, start, 0

    def show(self, image: Frames) -> None:
        self._count += 1
        target = self._folder / f"{self._count:04}.png"

        def take() -> None:
            time.sleep(0.08)
            target.write_bytes(encoded(image))

        self._start(take)

    def close(self) -> None: ...


def test_a_capture(tmp_path: Path, started: Callable[[Callable[[], None]], None]) -> None:
    (tmp_path / "in").mkdir()
    camera = folder_camera(tmp_path / "in", width=32, height=24)
    sequence = Sequence(32, 24, (PatternSet(Fringe("x", 8, (0.0, 2.0, 4.0))),))
    acquire_sequence(
        sequence,
        Shutter(tmp_path / "in", started),
        camera,
        folder=tmp_path / "out",
        exposure_ms=EXPOSURE_MS,
        timing=Timing(settle_ms=20, timeout_s=2.0),
    )
    for number, name in enumerate(frame_names(sequence)[0], start=1):
        image = read_image(tmp_path / "out" / name)
        assert np.array_equal(image, read_image(tmp_path / "in" / f"{number:04}.png"))
    assert str(read_capture(tmp_path / "out").provenance["camera"]).startswith("images in in: 32x")
