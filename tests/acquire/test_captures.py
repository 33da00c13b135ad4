"""Captures one after the other, in memory."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from fringeworks.acquire.captures import CaptureTaker
from fringeworks.acquire.frames import GO_ON
from fringeworks.devices import Faults
from fringeworks.errors import DeviceError, UsageError
from fringeworks.files.station import Timing
from tests.acquire.benches import EXPOSURE_MS, NAMES, SEQUENCE, expected, make_bench


def make_taker(faults: Faults | None = None, **options: Any) -> tuple[CaptureTaker, Any]:
    bench, clock = make_bench(faults=faults)
    settings = {"exposure_ms": EXPOSURE_MS, "clock": clock, **options}
    return CaptureTaker(SEQUENCE, bench.projector, bench.camera, **settings), clock


def test_each_capture_shows_the_sequence() -> None:
    """Also after a pause in which the camera's buffer has filled with frames of the last image."""
    taker, clock = make_taker()
    for _ in range(3):
        capture = taker.take()
        seen = [frame for stack in capture.frames for frame in stack]
        wanted = expected()
        assert all(
            np.array_equal(frame, wanted[name]) for frame, name in zip(seen, NAMES, strict=True)
        )
        assert capture.sequence is SEQUENCE
        clock.sleep(1.0)


def test_a_frame_that_does_not_come_is_named_and_the_next_capture_may_come() -> None:
    taker, clock = make_taker(Faults(dropped=range(8, 400)), timing=Timing(retries=0))
    with pytest.raises(DeviceError, match="no frame whose exposure began") as told:
        taker.take()
    assert str(told.value).split(":")[0] in NAMES
    assert GO_ON not in str(told.value)
    with pytest.raises(DeviceError):
        taker.take()
    clock.sleep(400 * 0.0333)
    assert len(taker.take().frames) == len(SEQUENCE.sets)


def test_another_projector_is_refused() -> None:
    bench, clock = make_bench(faults=Faults(dropped=range(sys.maxsize)))
    bench.projector.width = 10
    with pytest.raises(UsageError, match="projector's size, 10x16 px"):
        CaptureTaker(SEQUENCE, bench.projector, bench.camera, exposure_ms=1.0, clock=clock)
