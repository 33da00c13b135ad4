"""Frames to cloud in one pass: beside the memory's pace, over image sizes, with two threads.

The scene is a wall that fills the image; every pixel has a point, which is the most work there is.
"""

from __future__ import annotations

import tracemalloc
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fringeworks.bench.loops import read_and_write_maps
from fringeworks.bench.metric import Metric
from fringeworks.bench.speed import QUICK_SECONDS, SECONDS, ratio_metric, time_metric
from fringeworks.bench.timing import one_thread, race, settle_allocator
from fringeworks.errors import DecodeError
from fringeworks.geometry.lens import project, unproject
from fringeworks.model import Camera, Capture, Lens, Projector, Rig, Sensor, Sequence
from fringeworks.patterns.presets import make_sequence
from fringeworks.patterns.render import render_sequence
from fringeworks.pipeline import scan
from fringeworks.reconstruct.fused import empty_points, run_scan
from fringeworks.reconstruct.fused_plan import FusedScan, prepare_scan
from fringeworks.twin.scenes import paper_rig

Size = tuple[int, int]

LARGE: Size = (2448, 2048)
SIZES: tuple[Size, ...] = ((752, 480), LARGE, (4000, 3000))
"""0.36, 5 and 12 Mpx."""

PROJECTOR: Size = (1920, 1080)
WALL_MM, DARK, BRIGHT, SEED = 660.0, 30.0, 0.6, 1
KNOWN = Sensor(255.0, gain=0.005, read_noise=1.0)
"""A camera whose noise was measured; it is that of the frames."""

KINDS: dict[str, dict[str, Any]] = {
    "three_steps_gray": {"steps": 3, "periods_px": (16.0,), "code": "complementary"},
    "multi_frequency": {"steps": 4, "periods_px": (2016.0, 240.0, 30.0), "code": "none"},
}
BARS = {
    "three_steps_gray": "3 steps and 8 Gray bits, bar <= 3, aim 2",
    "multi_frequency": "3 x 4 frames, bar <= 4, aim 3",
}
BYTES_BAR = "bar <= 16; numpy's arrays, edge masks included"


@dataclass(frozen=True, slots=True)
class Course:
    """A capture of the wall and all that its one pass needs."""

    capture: Capture
    rig: Rig
    plan: FusedScan
    points: Any

    @classmethod
    def of(cls, size: Size, kind: str) -> Course:
        """Raises `DecodeError` where the capture cannot go in one pass: that would be no race."""
        rig = scaled_rig(size)
        capture = wall_capture(rig, sequence_of(kind))
        plan = prepare_scan(capture, rig)
        if plan is None:
            raise DecodeError(f"the frames of {kind} do not go in one pass")
        return cls(capture, rig, plan, empty_points(capture.shape))

    def run(self, threads: int = 1) -> None:
        """All maps of a cloud, into memory that is used again."""
        run_scan(self.plan, self.points, threads=threads)

    def read(self) -> None:
        """The memory's pace."""
        seen = np.empty(self.capture.shape[1], np.uint8)
        read_and_write_maps(self.capture.frames, seen, self.points)

    def run_anew(self) -> None:
        """The whole verb: plan and table, fresh memory, edge masks."""
        scan(self.capture, self.rig)


def measure_scan(*, quick: bool = False) -> list[Metric]:
    """Metrics of all sizes; of the smallest, in short turns, where `quick`."""
    seconds, sizes = (QUICK_SECONDS, SIZES[:1]) if quick else (SECONDS, SIZES)
    large = sizes[0] if quick else LARGE
    settle_allocator()
    with one_thread():
        metrics = [item for kind in KINDS for item in _beside_memory(large, kind, seconds)]
        return [*metrics, *_over_sizes(sizes, seconds)]


def scaled_rig(size: Size) -> Rig:
    """The paper's rig with a camera of this width and height, and a projector of full HD."""
    rig = paper_rig()
    camera, projector = rig.camera, rig.projector
    by_camera, by_projector = size[0] / camera.width, PROJECTOR[0] / projector.width
    return replace(
        rig,
        camera=Camera(*size, _scaled(camera.lens, by_camera, size)),
        projector=Projector(*PROJECTOR, _scaled(projector.lens, by_projector, PROJECTOR)),
    )


def _scaled(lens: Lens, factor: float, size: Size) -> Lens:
    middle = {"cx": (size[0] - 1) / 2, "cy": (size[1] - 1) / 2}
    return replace(lens, fx=factor * lens.fx, fy=factor * lens.fy, **middle)


def sequence_of(kind: str) -> Sequence:
    """Fringes along x and what tells their orders; neither white nor black."""
    width, height = PROJECTOR
    made = make_sequence("measure", width=width, height=height, axes=("x",), **KINDS[kind])
    kept = tuple(item for item in made.sets if hasattr(item.pattern, "axis"))
    return replace(made, sets=kept)


def wall_capture(rig: Rig, sequence: Sequence) -> Capture:
    """The patterns as the camera sees them on a wall, with a grey level of noise."""
    v, u = np.mgrid[: rig.camera.height, : rig.camera.width].astype(np.float64)
    rays = unproject(np.stack([u, v], axis=-1), rig.camera.lens.vector)
    points = np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1) * WALL_MM
    seen = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)[..., 0]
    rng, column = np.random.default_rng(SEED), np.arange(sequence.width)

    def see(image: Any) -> Any:
        grey = DARK + BRIGHT * np.interp(seen, column, image[0])
        return np.rint(grey + rng.standard_normal(seen.shape, np.float32)).astype(np.uint8)

    shown = render_sequence(sequence)
    return Capture(sequence, tuple(np.stack([*map(see, stack)]) for _, stack in shown), KNOWN)


def _beside_memory(size: Size, kind: str, seconds: float) -> list[Metric]:
    course, name = Course.of(size, kind), f"speed.scan.{size[0]}x{size[1]}.{kind}"
    result = race(course.read, course.run, seconds=seconds)
    whole = race(course.read, course.run_anew, seconds=seconds)
    pace = f"{course.points.reason.size / 1e6 / np.median(result.theirs):.0f} Mpx/s, one thread"
    note = "times as long as reading the frames and writing the maps"
    return [
        time_metric(f"{name}_ms", result.theirs, pace),
        ratio_metric(f"{name}_vs_memory", result, "lower", note, BARS[kind]),
        time_metric(
            f"{name}_whole_ms",
            whole.theirs,
            "the verb: table, fresh memory, edge masks, its own threads",
        ),
        _memory_metric(f"{name}_bytes_per_px", course),
    ]


def _memory_metric(key: str, course: Course) -> Metric:
    """Peak of what a scan allocates beyond its frames and its cloud."""
    tracemalloc.start()
    cloud = scan(course.capture, course.rig)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    maps = (cloud.xyz, cloud.sigma_mm, cloud.intensity, cloud.epipolar_px, cloud.reason)
    kept = sum(item.nbytes for item in maps if item is not None)
    return Metric(key, (peak - kept) / cloud.sigma_mm.size, "B", "lower", BYTES_BAR)


def _over_sizes(sizes: tuple[Size, ...], seconds: float) -> list[Metric]:
    """Time per pixel of the largest images over that of the smallest; two threads over one."""
    courses = {size: Course.of(size, "three_steps_gray") for size in sizes}
    small, large = courses[sizes[0]], courses[sizes[-1]]
    growth = race(small.run, large.run, seconds=seconds)
    pixels = large.points.reason.size / small.points.reason.size
    metrics = [
        Metric(
            "speed.scan.linearity",
            growth.ratio / pixels,
            "x",
            "one",
            f"time per pixel at {_words(sizes[-1])} over {_words(sizes[0])}; "
            f"best times {growth.best_ratio / pixels:.3g}",
        )
    ]
    for size, course in courses.items():
        shared = race(partial(course.run, 2), course.run, seconds=seconds)
        key = f"speed.scan.{_words(size)}.two_threads_vs_one"
        metrics.append(ratio_metric(key, shared, "higher", "bar >= 1.5 from 2 Mpx"))
    return metrics


def _words(size: Size) -> str:
    return f"{size[0]}x{size[1]}"
