"""Frames that are not what capture.toml says: one assumption is changed, and all is decoded again.

The score of a capture is the mean margin of its orders over the lit pixels, zero where a pixel is
void: frames in their order have 0.75 with a complementary Gray code, 0.5 with a plain one, and
nearly 1 with several periods, times the share of the fringes' borders at which the coordinate runs
on without a jump; an axis without orders has the share of its lit pixels that fit a
sinusoid. The change that mends the score is the fault that is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import cast

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.look import LIT_SHARE, name_of
from fringeworks.errors import FringeworksError
from fringeworks.model import (
    Axis,
    Capture,
    CodedAxis,
    Codeword,
    Frames,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Uniform,
)
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.demodulate import solve_shifts

PIXELS = 6000
"""Of the image, evenly spread, that take part."""

LEAST_CHANGES = 30
MOST_STEPS = 16
"""Sets of more frames are tried reversed and rotated alone."""


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """One changed assumption: the fault's name, what it would be in words, the mended capture."""

    name: str
    place: int
    words: str
    capture: Capture


def thin(capture: Capture, axis: Axis) -> Capture:
    """About `PIXELS` pixels: whole rows for axis x, whole columns for y, evenly spread.

    Along them the coordinate runs, and neighbours stay neighbours.
    """
    height, width = capture.shape
    step = max(height * width // PIXELS, 1)
    rows, columns = (step, 1) if axis == "x" else (1, step)
    frames = tuple(stack[:, ::rows, ::columns] for stack in capture.frames)
    return replace(capture, frames=frames, colour=None, dark_colour=None)


def part_of(capture: Capture, axis: Axis) -> Capture:
    """What an axis is decoded from without a rig: its sets but code frames, white and black."""

    def belongs(pattern: Pattern) -> bool:
        return isinstance(pattern, Uniform) or getattr(pattern, "axis", None) == axis

    return _only(without_code_frames(capture), belongs)


def without_code_frames(capture: Capture) -> Capture:
    """The capture itself where it has none: they are read inside a rig's volume alone."""
    if not capture.find(Codeword):
        return capture
    return _only(capture, lambda pattern: not isinstance(pattern, Codeword))


def _only(capture: Capture, wanted: Callable[[Pattern], bool]) -> Capture:
    kept = [n for n, item in enumerate(capture.sequence.sets) if wanted(item.pattern)]
    sequence = replace(capture.sequence, sets=tuple(capture.sequence.sets[n] for n in kept))
    return replace(capture, sequence=sequence, frames=tuple(capture.frames[n] for n in kept))


def score_axis(capture: Capture, axis: Axis) -> float | None:
    """Mean margin over lit pixels, 0 to 1; None for an axis without fringes."""
    part = part_of(capture, axis)
    stacks = [stack for _, stack, _ in part.find(Fringe)]
    if not stacks:
        return None
    swing = stacks[0].max(axis=0).astype(np.float32) - stacks[0].min(axis=0)
    lit = swing > 2 * LIT_SHARE * capture.sensor.full_scale
    lit &= stacks[0].max(axis=0) < capture.sensor.saturation
    if np.count_nonzero(lit) < 50:
        return None
    try:
        decoding = decode_phases(part)
    except FringeworksError:
        return 0.0
    if decoding.coded and decoding.coded[0].phase is not None:
        margin = float(np.nan_to_num(decoding.coded[0].phase.margin)[lit].mean())
        return margin * _smooth(decoding.coded[0])
    if decoding.relative:
        return float(np.isfinite(decoding.relative[0][0].phase)[lit].mean())
    return None


def _smooth(axis: CodedAxis) -> float:
    """Of the places where the order changes along the axis the share without a jump."""
    assert axis.phase is not None
    along = 1 if axis.axis == "x" else 0
    steps = np.diff(axis.coordinate, axis=along)
    changes = (np.diff(axis.phase.order, axis=along) != 0) & np.isfinite(steps)
    count = int(np.count_nonzero(changes))
    period = axis.phase.wrapped.fringe.period_px
    return float(np.mean(np.abs(steps[changes]) < period / 2)) if count >= LEAST_CHANGES else 1.0


def changes_of_axis(capture: Capture, axis: Axis) -> Iterator[Change]:
    """Other orders of an axis's fringes, other shifts, and inverted Gray bits."""
    for place, item in enumerate(capture.sequence.sets):
        if isinstance(item.pattern, Fringe) and item.pattern.axis == axis:
            yield from _orders(capture, place, item)
            yield from _steps(capture, place, item.pattern)
        elif isinstance(item.pattern, GrayCode) and item.pattern.axis == axis:
            yield from _inverted(capture, place, item)


def _orders(capture: Capture, place: int, item: PatternSet) -> Iterator[Change]:
    count = item.pattern.frame_count
    listed = list(range(count))
    pairs = list(combinations(listed, 2)) if count <= MOST_STEPS else []
    orders = [_exchanged(listed, one, other) for one, other in pairs]
    turned = [listed[n:] + listed[:n] for n in range(1, count)]
    orders += [listed[::-1], *turned, *(some[::-1] for some in turned)]
    for order in orders:
        words = " ".join(str(n + 1) for n in order)
        yield Change(
            "frame order", place, words, _with(capture, place, _pick(capture, place, order))
        )


def _exchanged(listed: list[int], one: int, other: int) -> list[int]:
    order = list(listed)
    order[one], order[other] = other, one
    return order


def _pick(capture: Capture, place: int, order: list[int]) -> Frames:
    repeats = capture.sequence.sets[place].repeats
    stack = capture.frames[place]
    frames = stack.reshape(-1, repeats, *stack.shape[1:])[order]
    return cast(Frames, frames.reshape(stack.shape))


def _with(capture: Capture, place: int, stack: Frames) -> Capture:
    frames = (*capture.frames[:place], stack, *capture.frames[place + 1 :])
    return replace(capture, frames=frames)


def _steps(capture: Capture, place: int, fringe: Fringe) -> Iterator[Change]:
    """Equal steps of other sizes, which four frames or more tell apart."""
    count = fringe.frame_count
    if count < 4:
        return
    first, second = fringe.shifts_rad[:2]
    sign = 1.0 if np.sin(second - first) > 0 else -1.0
    for parts in (3, 4, 5, 6, 8, 10, 12, 16):
        shifts = tuple(first + sign * 2 * np.pi * n / parts for n in range(count))
        if np.allclose(np.exp(1j * np.array(shifts)), np.exp(1j * np.array(fringe.shifts_rad))):
            continue
        sets = list(capture.sequence.sets)
        sets[place] = replace(sets[place], pattern=replace(fringe, shifts_rad=shifts))
        sequence = replace(capture.sequence, sets=tuple(sets))
        words = f"{360 / parts:g} degrees"
        yield Change("wrong shifts", place, words, replace(capture, sequence=sequence))


def _inverted(capture: Capture, place: int, item: PatternSet) -> Iterator[Change]:
    white, black = capture.white(), capture.black()
    if white is None or black is None or item.repeats != 1:
        return
    pattern = item.pattern
    bits = pattern.bits if isinstance(pattern, GrayCode) else 0
    for bit in range(bits):
        stack = capture.frames[place].copy()
        turned = np.clip(np.rint(white + black - stack[bit]), 0, np.iinfo(stack.dtype).max)
        stack[bit] = turned.astype(stack.dtype)
        yield Change("inverted bit", place, f"bit {bit + 1}", _with(capture, place, stack))


def missing_frames(capture: Capture) -> Iterator[Change]:
    """From some frame on every image is the next one's: one was dropped.

    The frame that is gone is made up: of fringes by the others of its set, else black.
    """
    plain = all(item.repeats == 1 and stack.ndim == 3 for item, stack in capture)
    if not plain:
        return
    flat: NDArray[np.integer] = np.concatenate(list(capture.frames))
    ends = np.cumsum([len(stack) for stack in capture.frames])
    for gone in range(len(flat) - 1):
        moved = np.concatenate([flat[:gone], flat[gone : gone + 1], flat[gone:-1]])
        stacks = tuple(cast(Frames, part) for part in np.split(moved, ends[:-1]))
        place = int(np.searchsorted(ends, gone, side="right"))
        mended = replace(capture, frames=stacks)
        within = gone - (int(ends[place - 1]) if place else 0)
        words = f"frame {within + 1} of the {name_of(capture.sequence.sets[place].pattern)}"
        yield Change("missing frame", place, words, _made_up(mended, place, within))


def _made_up(capture: Capture, place: int, within: int) -> Capture:
    pattern = capture.sequence.sets[place].pattern
    stack = capture.frames[place].copy()
    white, black = capture.white(), capture.black()
    if isinstance(pattern, Fringe):
        others = [n for n in range(len(stack)) if n != within]
        shifts = np.asarray(pattern.shifts_rad)
        if len(others) >= 3:
            solution = solve_shifts(shifts[others])
            shown = np.array([1, np.cos(shifts[within]), np.sin(shifts[within])])
            values = np.tensordot(shown @ solution.solve, stack[others].astype(np.float32), axes=1)
        elif white is not None and black is not None:
            values = 1.5 * (white + black) - stack[others].astype(np.float32).sum(axis=0)
        else:
            return capture
        highest = np.iinfo(stack.dtype).max
        stack[within] = np.clip(np.rint(values), 0, highest).astype(stack.dtype)
    elif isinstance(pattern, GrayCode) and black is not None:
        stack[within] = black.astype(stack.dtype)
    return _with(capture, place, stack)
