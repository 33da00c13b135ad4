"""Delays that are known are found again, and what disturbs the flashes is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fringeworks.acquire.flashes import Record, record_flashes
from fringeworks.acquire.latency import Latency, find_latency
from fringeworks.devices import Faults, Grab, SimulatedBench, VirtualClock
from fringeworks.errors import DeviceError
from fringeworks.files.station import Timing
from fringeworks.model import Frames, Sensor
from fringeworks.twin.effects import Effects
from tests.devices.stages import MirrorStage

INTERVAL_MS = 33.3
EXPOSURE_MS = 10.0


def record(
    *,
    latency_ms: float = 30.0,
    exposure_ms: float = EXPOSURE_MS,
    interval_ms: float = INTERVAL_MS,
    late_ms: tuple[float, ...] = (0.0,),
    camera: Callable[[Any], Any] = lambda camera: camera,
    flashes: int = 20,
) -> Record:
    """Flashes of a simulated bench; `late_ms` are added to its latency, show by show."""
    clock = VirtualClock()
    stage = MirrorStage(effects=Effects(frame_interval_ms=interval_ms))
    bench = SimulatedBench(
        stage,
        rng=np.random.default_rng(0),
        clock=clock,
        latency_ms=latency_ms,
        faults=Faults(dropped=range(3, 10_000, 17), repeated=range(5, 10_000, 11)),
    )
    show, shown = bench.projector.show, [0]

    def show_late(image: Frames) -> None:
        late = late_ms[shown[0] % len(late_ms)]
        bench.projector._latency_s = (latency_ms + late) / 1000
        shown[0] += 1
        show(image)

    bench.projector.show = show_late  # type: ignore[method-assign]
    return record_flashes(
        bench.projector,
        camera(bench.camera),
        clock=clock,
        exposure_ms=exposure_ms,
        rng=np.random.default_rng(1),
        flashes=flashes,
    )


def names(found: Latency) -> list[str]:
    return [finding.name for finding in found.findings]


@pytest.mark.parametrize("latency_ms", [0.0, 5.0, 20.0, 47.3, 150.0])
@pytest.mark.parametrize(
    ("interval_ms", "exposure_ms"), [(33.3, 10.0), (33.3, 19.0), (16.7, 5.0), (50.0, 15.0)]
)
def test_a_known_delay_is_found(latency_ms: float, interval_ms: float, exposure_ms: float) -> None:
    """Within 0.1 ms, 1/160 of a frame at most: grey levels of 5 ms or more of light are whole."""
    found = find_latency(
        record(latency_ms=latency_ms, interval_ms=interval_ms, exposure_ms=exposure_ms)
    )
    assert found.delays_ms == pytest.approx(latency_ms, abs=0.1)
    assert len(found.delays_ms) == 20
    assert found.change_ms == exposure_ms
    assert found.interval_ms == pytest.approx(interval_ms, abs=1e-6)
    assert latency_ms + 1.9 <= found.timing.settle_ms <= latency_ms + 3.2
    assert found.timing.drop_frames == 0
    assert set(names(found)) <= {"settles too early"}
    assert ("settles too early" in names(found)) == (latency_ms > 57)


def test_short_exposures_only_bound_it() -> None:
    """2 ms of 100: no frame is partly lit, but all together leave 10 ms."""
    found = find_latency(record(latency_ms=20.0, interval_ms=100.0, exposure_ms=2.0))
    assert found.delays_ms == pytest.approx(20.0, abs=10.0)
    assert found.timing.settle_ms >= 20.0


def test_a_delay_that_varies_has_its_spread() -> None:
    """A display of 60 Hz that is told at any moment: 0 to 16.7 ms more.

    Lost frames leave a few flashes with bounds alone.
    """
    rng = np.random.default_rng(5)
    late = rng.uniform(0, 16.7, 43)
    found = find_latency(record(exposure_ms=19.0, late_ms=tuple(late), flashes=40))
    true = 30 + late[3:]
    told = np.ptp(found.bounds_ms, axis=1) < 0.5
    assert told.sum() > 10
    assert np.abs(found.delays_ms - true)[told].max() < 0.1
    assert (found.bounds_ms[:, 0] - 0.1 < true).all()
    assert (found.bounds_ms[:, 1] + 0.1 > true).all()
    assert true.max() < found.timing.settle_ms < 60


class RollingShutter:
    """Rows begin one after the other, the last one `readout_ms` after the first."""

    def __init__(self, camera: Any, *, readout_ms: float = 15.0) -> None:
        self._camera, self._readout_ms = camera, readout_ms
        self.name, self.width, self.height = "rolling", camera.width, camera.height
        self.sensor: Sensor = camera.sensor

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        grab = self._camera.grab(exposure_ms=exposure_ms, timeout_s=timeout_s)
        projector, height = self._camera._projector, self.height
        starts = grab.start_s + np.linspace(0, self._readout_ms / 1000, height)
        shown = list(projector._shown)
        projector._shown = [(-np.inf, projector._dark), *shown]
        rows = [
            sum(
                share * float(image[0, 0]) / 2
                for share, image in projector.lit(start, start + exposure_ms / 1000)
            )
            for start in starts
        ]
        projector._shown = shown
        image = np.repeat(np.rint(rows).astype(np.uint8)[:, np.newaxis], self.width, axis=1)
        return Grab(grab.number, grab.start_s, lambda: image)

    def close(self) -> None: ...


def test_a_rolling_shutter_takes_longer() -> None:
    """Exposure 10 ms and 15 ms from the first row to the last: 25 ms, steepest in the middle."""
    found = find_latency(record(camera=RollingShutter, flashes=60))
    assert 15 < found.change_ms < 25
    assert found.delays_ms == pytest.approx(30.0, abs=5.0)
    assert 30 <= found.timing.settle_ms <= 40


class Changed:
    """A camera whose frames are changed on their way."""

    def __init__(self, camera: Any, change: Callable[[Grab, Frames], Any]) -> None:
        self._camera, self._change = camera, change
        self.name, self.width, self.height = "changed", camera.width, camera.height
        self.sensor: Sensor = camera.sensor

    def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
        grab = self._camera.grab(exposure_ms=exposure_ms, timeout_s=timeout_s)
        image = np.clip(self._change(grab, grab.image()), 0, 255).astype(np.uint8)
        return Grab(grab.number, grab.start_s, lambda: image)

    def close(self) -> None: ...


def test_a_lens_cap_is_told() -> None:
    with pytest.raises(DeviceError, match=r"not seen: black 3\.0, white 3\.0 of 255 .*lens cap"):
        record(camera=lambda camera: Changed(camera, lambda _, image: 0 * image + 3))


def test_a_weak_flash_is_told() -> None:
    """10 grey levels over other light, 1.5 of noise."""
    rng = np.random.default_rng(2)

    def drown(_: Grab, image: Frames) -> Any:
        return 90 + 10 / 128 * image + rng.normal(0, 1.5, image.shape)

    found = find_latency(record(camera=lambda camera: Changed(camera, drown)))
    assert names(found) == ["weak flash"]
    assert found.delays_ms == pytest.approx(30.0, abs=2.0)


def test_a_saturated_flash_is_told() -> None:
    found = find_latency(
        record(camera=lambda camera: Changed(camera, lambda _, image: 4.0 * image))
    )
    assert "saturation" in names(found)


def test_a_camera_that_adjusts_itself_is_told() -> None:
    """Its gain follows the light within a quarter of a second."""
    gain = [1.0]

    def adjust(_: Grab, image: Frames) -> Any:
        gain[0] += 0.12 * (90 / max(float(image.mean()), 45) - gain[0])
        return gain[0] * image

    found = find_latency(record(camera=lambda camera: Changed(camera, adjust)))
    assert "adjusts itself" in names(found)


def test_frames_timed_by_their_arrival_cost_one_more() -> None:
    rng = np.random.default_rng(3)

    class Arriving(Changed):
        def grab(self, *, exposure_ms: float, timeout_s: float) -> Grab:
            grab = super().grab(exposure_ms=exposure_ms, timeout_s=timeout_s)
            return replace(grab, start_s=grab.start_s + rng.uniform(0, 0.012))

    found = find_latency(record(camera=lambda camera: Arriving(camera, lambda _, image: image)))
    assert "unsteady times" in names(found)
    assert found.timing.drop_frames == 1


def test_the_stations_other_times_stay() -> None:
    found = find_latency(record(), Timing(settle_ms=20.0, timeout_s=7.0, retries=1))
    assert (found.timing.timeout_s, found.timing.retries) == (7.0, 1)
    assert names(found) == ["settles too early"]
