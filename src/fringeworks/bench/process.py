"""Whole commands, start to end, as the user waits for them."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence as Items
from pathlib import Path

import numpy as np

from fringeworks.bench.metric import Metric
from fringeworks.files import find_data, write_capture
from fringeworks.model import Capture, Sensor
from fringeworks.patterns.presets import make_sequence
from fringeworks.patterns.render import render_sequence

SIZE = (1280, 1024)
REAL = ("procam-graycode", "capture_0")
RUNS, QUICK_RUNS = 5, 2
LAUNCH = "from fringeworks.cli import main; main()"


def measure_process(*, quick: bool = False) -> list[Metric]:
    """Wall times of ``fringeworks --help`` and of a decoding whose kernels are compiled already."""
    runs = QUICK_RUNS if quick else RUNS
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "phase.npz"
        real = real_capture()
        capture = real or _render(Path(folder) / "rendered")
        what = "procam-graycode/capture_0, 22 frames" if real else "rendered, preset measure"
        return [
            _measure("process.help", ["--help"], runs, "bar < 0.4"),
            _measure(
                "process.decode_1280x1024",
                ["decode", str(capture), "--out", str(out)],
                runs,
                f"bar < 3; {what}; compiled before",
            ),
        ]


def real_capture() -> Path | None:
    """The real capture, if its set is there."""
    found = find_data(REAL[0])
    return None if found is None else found / REAL[1]


def _render(folder: Path) -> Path:
    """A capture in which the camera's pixels are the projector's."""
    width, height = SIZE
    sequence = make_sequence("measure", width=width, height=height)
    frames = tuple((25 + 0.7 * stack).astype(np.uint8) for _, stack in render_sequence(sequence))
    write_capture(Capture(sequence, frames, Sensor(255.0)), folder)
    return folder


def _measure(key: str, arguments: Items[str], runs: int, note: str) -> Metric:
    """Median over `runs`, after a run that is not timed."""
    command = [sys.executable, "-c", LAUNCH, *arguments]
    times: list[float] = []
    used = _cpu_seconds()
    for _ in range(runs + 1):
        start = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        times.append(time.perf_counter() - start)
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            return Metric(f"{key}_s", None, "s", "lower", f"skipped: it failed with: {last}")
    spread = f"best {min(times[1:]):.3g}, {(_cpu_seconds() - used) / len(times):.3g} of a processor"
    return Metric(f"{key}_s", float(np.median(times[1:])), "s", "lower", f"{note}; {spread}")


def _cpu_seconds() -> float:
    """Processor time of the commands so far; stays zero where the system does not tell."""
    spent = os.times()
    return spent.children_user + spent.children_system
