"""From showing an image to frames that show it: how long it takes, and what to wait for.

A frame that begins `delay` after the call shows the new image alone. One that begins earlier shows
a part of it, that grows evenly with its start over one `change`: the exposure of a camera whose
shutter is global before a fast projector; longer where rows are exposed one after the other or
the display is slow. So each partly lit frame tells the delay to a fraction of a frame. Flashes
without one only bound it, by the frames before and after; they begin at all phases of the camera's
rhythm, so that together they bound it closely. Delays vary no more than all bounds demand.

Times are those that the camera gives its frames. If it gives their arrival, its own delay is part
of what is found, as it is part of what an acquisition has to wait for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fringeworks.acquire.flashes import Floats, Record, interval_of, levels_after
from fringeworks.errors import DeviceError
from fringeworks.files.station import Timing
from fringeworks.model import Finding

UNLIT, LIT = 0.05, 0.95
"""Shares of a step beyond which a frame shows one image."""

LEAST_PARTLY = 6
"""Partly lit frames from which the length of a change can be told."""

SIGMAS = 4.0
"""By so much a change must exceed the exposure to be taken for longer; it is never shorter."""

LEAST_MARGIN_MS = 2.0
WEAK_STEP = 0.05
SATURATED_SHARE = 0.2
DRIFT = 0.1
UNSTEADY = 0.1
"""A step of the full scale, a share of pixels, of a step, of the interval that are told of."""


@dataclass(frozen=True, slots=True, eq=False)
class Latency:
    """What flashes have told.

    Attributes
    ----------
    delays_ms
        ``(n,)`` from the end of the call to the start of the first frame that shows the image
        alone could have, one per flash.
    bounds_ms
        ``(n, 2)`` between which each is for certain.
    change_ms
        How long frames begin that show both images.
    interval_ms, unsteady_ms
        From frame to frame, and how far 95 % of the frames are from it.
    black, white, full_scale
        Grey levels.
    since_ms, shares
        ``(m,)`` starts of all frames near a flash since its call, and their shares of the step.
    timing
        What to wait for: `settle_ms` and `drop_frames`.
    findings
        What is wrong.
    """

    delays_ms: Floats
    bounds_ms: Floats
    change_ms: float
    interval_ms: float
    unsteady_ms: float
    black: float
    white: float
    full_scale: float
    since_ms: Floats
    shares: Floats
    timing: Timing
    findings: tuple[Finding, ...]


def find_latency(record: Record, timing: Timing | None = None) -> Latency:
    """The delay of each flash, and the timing to use instead of the one given.

    Raises
    ------
    DeviceError
        Half of the flashes or more are not followed to their end.
    """
    timing = timing or Timing()
    steps = _steps(record)
    change_ms = _change(steps, record.exposure_ms)
    bounds = np.array([_bounds(step[0], step[1], change_ms) for step in steps])
    followed = np.isfinite(bounds).all(axis=1)
    if followed.mean() <= 1 / 2:
        raise DeviceError(
            f"only {followed.sum()} of {len(steps)} flashes are seen from one image to the next; "
            "keep other light away, hold the scene still, and look for frames that are lost"
        )
    bounds = bounds[followed]
    common = _common(bounds)
    delays = np.clip(sum(common) / 2, bounds[:, 0], bounds[:, 1])
    interval_s, unsteady_s = interval_of(record.numbers, record.starts_s)
    slow_ms = 0.0 if change_ms == record.exposure_ms else change_ms
    settle_ms = _settle(delays, common, slow_ms)
    unsteady = unsteady_s > UNSTEADY * interval_s
    advice = Timing(settle_ms, int(unsteady), timing.timeout_s, timing.retries)
    findings = _findings(record, timing=timing, advice=advice, unsteady=unsteady)
    since, shares = np.concatenate(steps, axis=1)
    return Latency(
        delays,
        bounds,
        change_ms,
        1000 * interval_s,
        1000 * unsteady_s,
        record.black,
        record.white,
        record.full_scale,
        since,
        shares,
        advice,
        tuple(findings),
    )


def _steps(record: Record) -> list[Floats]:
    """Per flash ``(2, k)``: start of each frame around it, ms since, and its share of the step."""
    levels = levels_after(record)
    starts = [flash.shown_s for flash in record.flashes]
    ends = [*starts[1:], math.inf]
    steps = []
    for place in range(1, len(starts)):
        step = levels[place] - levels[place - 1]
        begin_s = (starts[place - 1] + starts[place]) / 2
        near = (record.starts_s >= begin_s) & (
            record.starts_s + record.exposure_ms / 1000 <= ends[place]
        )
        shares = (record.levels[near] - levels[place - 1]) / (step or math.nan)
        since = 1000 * (record.starts_s[near] - starts[place])
        steps.append(np.stack([since, shares]))
    return steps


def _change(steps: Sequence[Floats], exposure_ms: float) -> float:
    """Length of a change: the exposure, unless the partly lit frames say another for certain."""
    since, shares = np.concatenate(steps, axis=1)
    partly = (shares > UNLIT) & (shares < LIT)
    if partly.sum() < LEAST_PARTLY:
        return exposure_ms
    (slope, _), covariance = np.polyfit(shares[partly], since[partly], 1, cov=True)
    longer = slope - exposure_ms > SIGMAS * math.sqrt(covariance[0, 0])
    return float(slope) if longer else exposure_ms


def _bounds(since: Floats, shares: Floats, change_ms: float) -> tuple[float, float]:
    """Between which values the delay of one flash is; infinite where a side was not seen.

    A frame with a share f of the step began change (1 - f) before the delay.
    """
    partly = (shares > UNLIT) & (shares < LIT)
    if partly.any():
        told = since[partly] + change_ms * (1 - shares[partly])
        return float(told.min()), float(told.max())
    last = since[shares <= UNLIT].max(initial=-math.inf)
    first = since[(shares >= LIT) & (since > last)].min(initial=math.inf)
    return float(last + LIT * change_ms), float(first + (1 - LIT) * change_ms)


def _common(bounds: Floats) -> tuple[float, float]:
    """The delays that are the least outside of all bounds, together."""
    candidates = np.unique(bounds)
    below = np.maximum(bounds[:, 0] - candidates[:, np.newaxis], 0)
    above = np.maximum(candidates[:, np.newaxis] - bounds[:, 1], 0)
    outside = (below + above).sum(axis=1)
    best = candidates[outside <= outside.min() + 1e-9]
    return float(best[0]), float(best[-1])


def _settle(delays: Floats, common: tuple[float, float], slow_ms: float) -> float:
    """The longest delay, what is not known of it, and a margin, whole ms.

    The margin is half of the spread; a quarter of a slow change, which is no straight line.
    """
    longest = max(0.0, float(delays.max())) + (common[1] - common[0]) / 2
    margin = max(LEAST_MARGIN_MS, float(np.ptp(delays)) / 2, slow_ms / 4)
    return float(math.ceil(longest + margin))


def _findings(record: Record, *, timing: Timing, advice: Timing, unsteady: bool) -> list[Finding]:
    """What is wrong with the light, the camera, and the timing given."""
    found = []
    step = record.white - record.black
    if step < WEAK_STEP * record.full_scale:
        found.append(
            Finding(
                "warning",
                f"the flash is hardly seen: {record.black:.1f} to {record.white:.1f} of "
                f"{record.full_scale:g} grey levels.",
                "Take off the lens cap, keep other light away, or expose longer.",
                name="weak flash",
            )
        )
    if record.saturated > SATURATED_SHARE:
        found.append(
            Finding(
                "warning",
                f"{record.saturated:.0%} of the pixels that see the flash are saturated: partly "
                "lit frames look brighter than they are.",
                "Expose shorter.",
                name="saturation",
            )
        )
    if _drift(record) > DRIFT:
        found.append(
            Finding(
                "warning",
                f"a still image changes its brightness by {_drift(record):.0%} of the step: the "
                "camera adjusts itself, or other light changes.",
                "Switch off automatic exposure, gain and white balance.",
                name="adjusts itself",
            )
        )
    if unsteady:
        found.append(
            Finding(
                "note",
                "the camera's frame times are unsteady: they tell when frames arrived, not when "
                "they began.",
                "One frame more is passed over.",
                name="unsteady times",
            )
        )
    if timing.settle_ms < advice.settle_ms:
        found.append(
            Finding(
                "warning",
                f"the station's settle_ms of {timing.settle_ms:g} is too short.",
                f"Set settle_ms = {advice.settle_ms:g} in [timing].",
                name="settles too early",
            )
        )
    return found


def _drift(record: Record) -> float:
    """How far frames of the later half of each flash differ, as a share of the step."""
    ends = [flash.shown_s for flash in record.flashes[1:]]
    drifts = [0.0]
    for flash, end_s in zip(record.flashes, ends, strict=False):
        half_s = flash.shown_s + (end_s - flash.shown_s) / 3
        late = (record.starts_s > half_s) & (record.starts_s + record.exposure_ms / 1000 < end_s)
        if late.any():
            drifts.append(float(np.ptp(record.levels[late])))
    across = [levels_after(record)[place::2] for place in (0, 1)]
    drifts += [float(np.ptp(values)) for values in across if np.isfinite(values).all()]
    return max(drifts) / max(record.white - record.black, 1e-9)
