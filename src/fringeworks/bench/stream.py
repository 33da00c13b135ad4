"""A stream of small scans: how many a second, and how long each takes.

The twin sees a cylinder by three steps; orders come from one code frame, as in the paper, or from a
Gray code. Each scan is the whole verb, from the frames in memory to a cloud, its edges masked or
not.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fringeworks.bench.metric import Metric
from fringeworks.bench.timing import Work, one_thread
from fringeworks.model import Capture, PatternSet, Rig, Uniform
from fringeworks.patterns.presets import make_sequence
from fringeworks.pipeline import scan
from fringeworks.reconstruct.full import CloudRules
from fringeworks.twin.scenes import cylinder_scene, paper_rig
from fringeworks.twin.simulate import simulate

SECONDS, QUICK_SCANS, SEED = 5.0, 3, 1
GRAY = {"steps": 3, "periods_px": (18.0,), "code": "complementary"}
GOAL = "goal 70 Mpx/s on one core"
KINDS: dict[str, tuple[Any, dict[str, Any], CloudRules]] = {
    "code_frame": ("paper", {"code": "none"}, CloudRules()),
    "gray": ("measure", GRAY, CloudRules()),
    "gray_unmasked": ("measure", GRAY, CloudRules(edges=None)),
}


def measure_stream(*, quick: bool = False) -> list[Metric]:
    """Scans per second and latencies of each kind; of three scans where `quick`."""
    rig, metrics = paper_rig(), []
    with one_thread():
        for kind in KINDS:
            capture = stream_capture(rig, kind)
            work = partial(scan, capture, rig, cloud_rules=KINDS[kind][2])
            seconds = time_scans(work, seconds=0.0 if quick else SECONDS)
            metrics += _metrics_of(kind, capture, seconds)
    return metrics


def stream_capture(rig: Rig, kind: str) -> Capture:
    """One capture of the stream; every scan has it."""
    preset, options, _ = KINDS[kind]
    width, height = rig.projector.width, rig.projector.height
    sequence = make_sequence(preset, width=width, height=height, axes=("x",), **options)
    sequence = replace(sequence, sets=tuple(s for s in sequence.sets if not is_uniform(s)))
    rng = np.random.default_rng(SEED)
    return simulate(cylinder_scene(), rig, sequence, rng=rng).capture


def is_uniform(item: PatternSet) -> bool:
    """White and black are left out: fringes and code are all that a stream has time for."""
    return isinstance(item.pattern, Uniform)


def time_scans(work: Work, *, seconds: float) -> list[float]:
    """Times, s, of scans one after the other for so long, and three at least; one warms up."""
    work()
    times: list[float] = []
    while len(times) < QUICK_SCANS or sum(times) < seconds:
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return times


def _metrics_of(kind: str, capture: Capture, seconds: list[float]) -> list[Metric]:
    frames, (height, width) = sum(map(len, capture.frames)), capture.shape
    name, rate = f"speed.stream.{width}x{height}.{kind}", len(seconds) / sum(seconds)
    pace = f"{rate * width * height / 1e6:.3g} Mpx/s of points, {GOAL}; {frames} frames a scan"
    latency = {f"p{p}": 1e3 * float(np.percentile(seconds, p)) for p in (50, 99)}
    return [
        Metric(f"{name}_per_s", rate, "1/s", "higher", pace),
        *(Metric(f"{name}_{p}_ms", value, "ms", "lower") for p, value in latency.items()),
    ]
