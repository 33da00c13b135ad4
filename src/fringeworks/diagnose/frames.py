"""Frames that are missing, repeated, out of order, inverted, or of other shifts than listed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fringeworks.diagnose.hypotheses import (
    Change,
    changes_of_axis,
    missing_frames,
    part_of,
    score_axis,
    thin,
)
from fringeworks.diagnose.look import LEAST_PIXELS, Look, codes_in_light, name_of
from fringeworks.diagnose.suspicion import Suspicion, wrong_order_px
from fringeworks.model import AXES, Axis, Capture, FloatMap, GrayCode
from fringeworks.phase.bit_order import find_bit_order

ALIKE = 0.15
"""Difference of two frames, share of what their patterns differ by, below which they are one."""

BETTER = 0.12
"""By how much a change must raise the score to be the cause."""

LEAST_AFTER = 0.5
"""Score that a change of one set must reach: half mended is not mended."""

GOOD_ENOUGH = 0.93
"""Scores beyond it leave nothing to explain."""

REMEDIES = {
    "frame order": "List the images in that order in capture.toml, or look at how the camera is "
    "triggered.",
    "wrong shifts": "Correct shifts_deg in capture.toml.",
    "inverted bit": "Invert that image, or list the inverted images under `inverted`.",
    "missing frame": "A frame was dropped: capture again, with the camera triggered by the "
    "projector, or with more time per image.",
}


def find_repeated(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Frames that show what another one shows."""
    for look in looks:
        pair = _alike(look)
        if pair is not None:
            one, other = pair
            yield _repeated(look, one, other)
    yield from _repeated_bits(capture, looks)


def _alike(look: Look) -> tuple[int, int] | None:
    """Two frames of a set that are the same though their shifts differ."""
    swing = look.frames.max(axis=0) - look.frames.min(axis=0)
    lit = (swing > 0.5 * np.percentile(swing, 90)) & (look.lit | look.clipped)
    if np.count_nonzero(lit) < LEAST_PIXELS:
        return None
    turns = np.exp(1j * np.asarray(look.fringe.shifts_rad))
    for one in range(len(turns)):
        for other in range(one + 1, len(turns)):
            expected = abs(turns[one] - turns[other]) / np.sqrt(2)
            if expected < 0.3:
                continue
            change = look.frames[one][lit] - look.frames[other][lit]
            half = 0.5 * float(np.median(swing[lit]))
            if np.sqrt(np.median(change**2)) < ALIKE * expected * half:
                return one, other
    return None


def _repeated(look: Look, one: int, other: int) -> Suspicion:
    return Suspicion(
        "repeated frame",
        wrong_order_px(1.0, look.fringe.period_px),
        f"frames {one + 1} and {other + 1} of {look.name} are the same image, though their shifts "
        "differ.",
        "The camera gave one image twice: trigger it by the projector, or wait longer after each "
        "image; capture again.",
        f"{look.where}, frame {other + 1}",
        np.abs(look.frames[one] - look.frames[other]),
        "grey levels by which the two frames differ",
    )


def _repeated_bits(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Two bits that change over the image, and nowhere apart: no code has such bits."""
    for place, code, black, contrast, lit in codes_in_light(capture):
        share = (capture.frames[place].astype(np.float32) - black)[:, lit] / contrast[lit]
        bits = share[: code.bits] > 0.5
        for one in range(len(bits) - 1):
            told = 0.02 < bits[one].mean() < 0.98
            if told and np.mean(bits[one] != bits[one + 1]) < 0.005:
                yield _repeated_bit(capture, place, one, looks)


def _repeated_bit(capture: Capture, place: int, one: int, looks: Sequence[Look]) -> Suspicion:
    pattern = capture.sequence.sets[place].pattern
    stack = capture.frames[place].astype(np.float32)
    period = looks[0].fringe.period_px if looks else 1.0
    return Suspicion(
        "repeated frame",
        wrong_order_px(1.0, period),
        f"bits {one + 1} and {one + 2} of the {name_of(pattern)} are the same image.",
        "The camera gave one image twice: trigger it by the projector, or wait longer after each "
        "image; capture again.",
        f"set {place + 1}, {name_of(pattern)}, frame {one + 2}",
        np.abs(stack[one] - stack[one + 1]),
        "grey levels by which the two frames differ",
    )


def find_misplaced(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Orders, shifts, inverted bits and a missing frame, each by decoding again."""
    wrong_bits = list(_bit_orders(capture, looks))
    if wrong_bits:
        yield from wrong_bits
        return
    if not any(look.enough for look in looks):
        return
    few = {axis: thin(capture, axis) for axis in AXES}
    now = {axis: value for axis in AXES if (value := score_axis(few[axis], axis)) is not None}
    if not now or min(now.values()) > GOOD_ENOUGH:
        return
    best = [found for axis in now if (found := _best_change(few[axis], axis, now[axis]))]
    gain = max((gain for gain, _ in best), default=0.0)
    lost = _missing(few, now, gain / len(now))
    if lost is not None:
        best = [lost]
    if best:
        _, change = max(best, key=lambda item: item[0])
        yield _misplaced(capture, change, min(now.values()), looks)


def _best_change(capture: Capture, axis: Axis, now: float) -> tuple[float, Change] | None:
    """The change that raises an axis's score most, where it does so by enough."""
    part = part_of(capture, axis)
    tried = (
        (score_axis(change.capture, axis) or 0.0, change) for change in changes_of_axis(part, axis)
    )
    after, change = max(tried, key=lambda item: item[0], default=(0.0, None))
    if change is None or after < now + BETTER or after < LEAST_AFTER:
        return None
    return after - now, _placed(capture, part, change)


def _placed(capture: Capture, part: Capture, change: Change) -> Change:
    """The change with its place among all sets of the capture."""
    item = part.sequence.sets[change.place]
    place = next(n for n, other in enumerate(capture.sequence.sets) if other is item)
    return Change(change.name, place, change.words, change.capture)


def _missing(
    few: Mapping[Axis, Capture], now: Mapping[Axis, float], rival: float
) -> tuple[float, Change] | None:
    """The frame whose loss would explain more, over all axes, than a change of one set does."""
    before = float(np.mean(list(now.values())))
    tried = []
    for changes in zip(*(missing_frames(few[axis]) for axis in now), strict=True):
        scores = [
            score_axis(change.capture, axis) or 0.0
            for axis, change in zip(now, changes, strict=True)
        ]
        tried.append((float(np.mean(scores)) - before, changes[0]))
    gain, change = max(tried, key=lambda item: item[0], default=(0.0, None))
    return None if change is None or gain < max(BETTER, 1.02 * rival) else (gain, change)


def _misplaced(
    capture: Capture, change: Change, score_now: float, looks: Sequence[Look]
) -> Suspicion:
    pattern = capture.sequence.sets[change.place].pattern
    name = name_of(pattern)
    period = max((look.fringe.period_px for look in looks), default=1.0)
    message = {
        "frame order": f"the frames of the {name} fit together in the order {change.words}, not "
        "as they are listed.",
        "wrong shifts": f"the frames of the {name} fit steps of {change.words}, not those that "
        "are listed.",
        "inverted bit": f"{change.words} of the {name} fits when it is inverted.",
        "missing frame": f"{change.words} is missing: from there on every image is the next one's.",
    }[change.name]
    return Suspicion(
        change.name,
        wrong_order_px(1 - score_now, period),
        message,
        REMEDIES[change.name],
        f"set {change.place + 1}, {name}",
        _picture(capture, change.place),
        "spread of the set's frames, grey levels",
    )


def _picture(capture: Capture, place: int) -> FloatMap:
    return np.asarray(capture.frames[place].std(axis=0, dtype=np.float32))


def _bit_orders(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    period = max((look.fringe.period_px for look in looks), default=1.0)
    for axis in AXES:
        order = find_bit_order(capture, axis)
        if order is None:
            continue
        place = next(
            n
            for n, item in enumerate(capture.sequence.sets)
            if isinstance(item.pattern, GrayCode) and item.pattern.axis == axis
        )
        listed = " ".join(str(bit + 1) for bit in order)
        yield Suspicion(
            "bit order",
            wrong_order_px(1.0, period),
            f"the Gray bits along {axis} are out of order: of the images listed they fit together "
            f"as {listed}, most significant first.",
            "List them so in capture.toml.",
            f"set {place + 1}, Gray code along {axis}",
            _picture(capture, place),
            "spread of the set's frames, grey levels",
        )
