"""Many scans of a simulated station: pace, memory; and what is left where it was killed."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fringeworks.experiments.study import Study
from fringeworks.files import read_cloud
from fringeworks.files.atomic import write_text
from fringeworks.files.station import read_station
from fringeworks.files.watch_log import read_watch_log
from fringeworks.measure.zones import Zone
from fringeworks.model import Progress, Sequence
from fringeworks.patterns import make_sequence
from fringeworks.watch import CLOUDS, LOG, Totals, Watching, watch

SCANS, QUICK_SCANS = 200, 3
KILLS, QUICK_KILLS = 20, 1
WARM_SCANS = 10
LONGEST_S, QUICK_LONGEST_S = 3.0, 0.5
"""Until a kill, from the first scan on."""

STEPS, SEED = 4, 9
ZONE = Zone("cone", ((20.0, 110.0), (-70.0, 60.0), (600.0, 680.0)))
MOST_BYTES = 100 * 10**6
STATM = Path("/proc/self/statm")
PAGE_BYTES = 4096
STATION = """format = "fringeworks-station/1"
[projector]
kind = "simulated"
[camera]
kind = "simulated"
[simulated]
scene = "two"
rig = "paper"
"""


def study_watching(folder: Path, *, seeds: int | None, quick: bool, progress: Progress) -> Study:
    """`seeds` scans in this process, then as many kills of others as they stand for.

    Both start anew in `folder`.
    """
    station = folder / "station.toml"
    write_text(station, STATION)
    scans = QUICK_SCANS if quick else seeds or SCANS
    totals, memory_mb = _watch(station, folder / "flat", scans, progress)
    told = totals.summary()
    kills, longest_s = (QUICK_KILLS, QUICK_LONGEST_S) if quick else (KILLS, LONGEST_S)
    waits_s = np.random.default_rng(SEED).uniform(0, longest_s, kills)
    survived = _kill(station, folder / "killed", waits_s.tolist(), progress)
    pace = f"{told['scans_per_s']:.3g} scans a second, {STEPS} steps and a Gray code, one zone"
    return Study(
        f"{scans} scans of a simulated station",
        ("stage", "share of the time"),
        tuple((name, f"{share:.1%}") for name, share in told["shares"].items()),
        (pace, _say_memory(memory_mb), survived),
        {**told, "memory_mb": memory_mb, "kills": kills},
        lambda: _draw(memory_mb),
    )


def _patterns(width: int, height: int) -> Sequence:
    return make_sequence("measure", width=width, height=height, axes=("x",), steps=STEPS)


def _watch(
    station: Path, folder: Path, scans: int, progress: Progress
) -> tuple[Totals, list[float]]:
    """Totals, and the memory of this process after each scan, 10^6 bytes; NaN if not told."""
    shutil.rmtree(folder, ignore_errors=True)
    watching = Watching(zones=(ZONE,), count=scans, most_bytes=MOST_BYTES)
    made = watch(read_station(station), _patterns, folder, watching)
    totals, memory_mb = Totals(), []
    for _ in progress(range(scans), "watching"):
        totals.add(next(made))
        memory_mb.append(_resident_mb())
    made.close()
    return totals, memory_mb


def _resident_mb() -> float:
    """Where Linux tells it."""
    if not STATM.exists():
        return float("nan")
    return int(STATM.read_text().split()[1]) * PAGE_BYTES / 1e6


def _say_memory(memory_mb: list[float]) -> str:
    warm = memory_mb[min(WARM_SCANS, len(memory_mb)) - 1]
    return (
        f"memory {warm:.1f} MB after {min(WARM_SCANS, len(memory_mb))} scans, "
        f"{max(memory_mb):.1f} MB at most, {memory_mb[-1]:.1f} MB in the end"
    )


def _kill(station: Path, folder: Path, waits_s: list[float], progress: Progress) -> str:
    """Kill `fringeworks watch` after these waits, look at what it left; it goes on each time."""
    shutil.rmtree(folder, ignore_errors=True)
    kills, intact, whole = len(waits_s), 0, 0
    for wait_s in progress(waits_s, "killing"):
        last_told = _watch_and_kill(station, folder, wait_s)
        scans, zones = read_watch_log(folder / LOG)
        numbers = [row.scan for row in scans]
        intact += numbers == [row.scan for row in zones] == list(range(1, len(scans) + 1))
        intact -= last_told > len(scans)
        clouds = list((folder / CLOUDS).glob("scan_*.npz"))
        whole += all(read_cloud(path).valid.any() for path in clouds)
    return (
        f"killed {kills} times, {len(scans)} scans: the log intact with all that was told "
        f"{intact} times, every cloud whole {whole} times"
    )


def _watch_and_kill(station: Path, folder: Path, after_s: float) -> int:
    """Number of the last scan that the process told of."""
    zone = f"{ZONE.name}=" + ",".join(f"{low:g}:{high:g}" for low, high in ZONE.box_mm)
    command = [sys.executable, "-m", "fringeworks", "watch", "--station", str(station), "--zone"]
    command += [zone, "--steps", f"{STEPS}", "--out", str(folder), "--max-gb", "0.1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as watching:
        assert watching.stdout is not None  # it was asked for
        told = watching.stdout.readline()
        time.sleep(after_s)
        watching.kill()
        told += watching.stdout.read()
    numbers = [line.split()[0] for line in told.splitlines() if not line.startswith("      ")]
    return max((int(number) for number in numbers if number.isdigit()), default=0)


def _draw(memory_mb: list[float]) -> Figure:
    from fringeworks.report.canvas import new_figure

    figure = new_figure(3.0)
    axes = figure.subplots()
    axes.plot(np.arange(1, len(memory_mb) + 1), memory_mb)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("scan")
    axes.set_ylabel("memory of the process, MB")
    axes.set_title("Memory over a run", loc="left")
    return figure
