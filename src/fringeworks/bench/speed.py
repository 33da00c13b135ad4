"""Three steps to wrapped phase on one thread: ours beside the peers and beside the memory.

Every ratio is taken in one run with both sides in turn. A peer is timed only after its phase has
been compared with ours: a ratio to something else says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fringeworks.bench.loops import read_and_write
from fringeworks.bench.metric import Direction, Metric
from fringeworks.bench.peers import PEERS, Peer, Phase
from fringeworks.bench.timing import Race, Times, Work, one_thread, race, settle_allocator
from fringeworks.errors import DecodeError, MissingExtraError
from fringeworks.model import FloatMap, Frames, Fringe, Sensor, WrappedPhase
from fringeworks.patterns.presets import equal_shifts
from fringeworks.phase.demodulate import demodulate, wrap_three_steps

SIZES = ((752, 480), (1280, 1024), (2448, 2048))
SECONDS, QUICK_SECONDS = 2.0, 0.1
PERIOD_PX, SEED = 32.0, 1


@dataclass(frozen=True, slots=True)
class Course:
    """The frames of one size, and our own ways through them, which peers are set beside."""

    name: str
    frames: Frames
    seconds: float
    map: FloatMap

    def wrap(self) -> FloatMap:
        """Phase alone, into a map that is used again, as a stream does."""
        return wrap_three_steps(self.frames, out=self.map)

    def wrap_anew(self) -> FloatMap:
        """Phase alone, into fresh memory."""
        return wrap_three_steps(self.frames)

    def demodulate(self) -> WrappedPhase:
        """Everything: offset, modulation, masks, noise from the images, sigma; fresh memory."""
        return demodulate(self.frames, Fringe("x", PERIOD_PX, equal_shifts(3)), Sensor(255.0))

    def read(self) -> None:
        """The memory's pace."""
        read_and_write(self.frames, self.map)


def measure_speed(*, quick: bool = False) -> list[Metric]:
    """Metrics of all sizes; of the smallest, in short turns, where `quick`."""
    seconds = QUICK_SECONDS if quick else SECONDS
    settle_allocator()
    with one_thread():
        return [
            metric
            for size in (SIZES[:1] if quick else SIZES)
            for metric in measure_size(size, seconds=seconds)
        ]


def measure_size(size: tuple[int, int], *, seconds: float) -> list[Metric]:
    """Our times, and ratios to the memory's pace and to each peer, for images of (W, H)."""
    frames = three_steps(size)
    name = f"speed.{size[0]}x{size[1]}"
    course = Course(name, frames, seconds, np.empty(frames.shape[1:], np.float32))
    peers = (metric for peer in PEERS for metric in _beside(course, peer))
    return [*_ours(course), *peers]


def three_steps(size: tuple[int, int]) -> Frames:
    """Frames ``(3, H, W)`` of slanted fringes with a grey level of noise, always the same."""
    width, height = size
    row, column = np.ogrid[:height, :width]
    phase = 2 * np.pi / PERIOD_PX * (column + 0.1 * row)
    rng = np.random.default_rng(SEED)
    grey = np.stack([120 + 80 * np.cos(phase - shift) for shift in equal_shifts(3)])
    return np.rint(grey + rng.normal(0, 1, grey.shape)).astype(np.uint8)


def _ours(course: Course) -> list[Metric]:
    limit = race(course.read, course.wrap, seconds=course.seconds)
    anew = race(course.read, course.wrap_anew, seconds=course.seconds)
    whole = race(course.read, course.demodulate, seconds=course.seconds)
    pace = f"{course.map.size / 1e6 / np.median(limit.theirs):.0f} Mpx/s"
    return [
        time_metric(f"{course.name}.wrap_ms", limit.theirs, pace),
        time_metric(f"{course.name}.wrap_anew_ms", anew.theirs, "the same into fresh memory"),
        time_metric(f"{course.name}.demodulate_ms", whole.theirs, "with masks, noise and sigma"),
        ratio_metric(
            f"{course.name}.wrap_vs_memory",
            limit,
            "lower",
            "times as long as reading the frames and writing a map",
        ),
    ]


def _beside(course: Course, peer: Peer) -> list[Metric]:
    """How many times as long the peer takes as our phase alone, and as our everything."""
    ours: dict[str, Work] = {"wrap": course.wrap, "demodulate": course.demodulate}
    keys = {name: f"{course.name}.{name}_vs_{peer.name}" for name in ours}
    try:
        work = peer.prepare(course.frames)
        apart = phase_difference(work(), course.wrap())
    except MissingExtraError as error:
        return [Metric(key, None, "x", "higher", f"skipped: {error}") for key in keys.values()]
    if apart > peer.tolerance_rad:
        raise DecodeError(f"{peer.name} gives another phase than ours: {apart:.3g} rad rms apart")
    same = f"phases {apart:.1g} rad rms apart"
    bars = {"wrap": f"bar >= {peer.bar:g}" if peer.bar else ""}
    return [
        ratio_metric(
            keys[name],
            race(run, work, seconds=course.seconds),
            "higher",
            *(bars.get(name, ""), same, peer.remark),
        )
        for name, run in ours.items()
    ]


def phase_difference(first: Phase, second: Phase) -> float:
    """Root mean square of the difference of two wrapped phases, modulo one turn, rad."""
    difference = np.angle(np.exp(1j * (first.astype(np.float64) - second)))
    return float(np.sqrt(np.mean(np.square(difference))))


def ratio_metric(key: str, result: Race, direction: Direction, *notes: str) -> Metric:
    """Theirs / ours, with both times in the note."""
    theirs = f"{1e3 * float(np.median(result.theirs)):.3g} ms"
    ours = f"{1e3 * float(np.median(result.ours)):.3g} ms"
    spread = f"{theirs} against {ours}, best times {result.best_ratio:.3g}"
    return Metric(key, result.ratio, "x", direction, "; ".join(n for n in (*notes, spread) if n))


def time_metric(key: str, seconds: Times, note: str) -> Metric:
    """The median in milliseconds, with the best in the note."""
    best = f"best {1e3 * float(seconds.min()):.3g}"
    return Metric(key, 1e3 * float(np.median(seconds)), "ms", "lower", f"{best}; {note}")
