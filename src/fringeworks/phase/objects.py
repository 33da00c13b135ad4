"""Orders without a code: from where objects can be, pixel by pixel or object by object.

The paper's section 4 gets along with three fringes: an object's phase is unwrapped spatially and
shifted by whole turns to where the object is known to stand. What is known is a window of
projector coordinates per pixel, from a depth range for instance (An, Hyun and Zhang 2016). A
wrong turn puts the object a fringe too near or too far, 64 to 75 mm on the paper's rig.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.kernels.orders import unwrap
from fringeworks.model import AbsolutePhase, FloatMap, UnwrappedPhase, WrappedPhase
from fringeworks.model.phase import VOID_ORDER, OrderMap
from fringeworks.model.sequence import PROJECTOR_EDGE_PX
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.phase.regions import find_regions

Array = NDArray[np.float64]

SLACK_SIGMAS = 5.0
"""A coordinate beyond its window by no more than this many sigma is inside."""

LEAST_FIT = 0.95
"""Share of an object's pixels that must be inside their windows: the rest may be at its edges."""

MOST_FIT = 0.9
"""An object for which a second number of turns brings more than this share inside is undecided."""


def depth_window(frames: AxisFrames) -> Ordered:
    """The one order that puts a pixel into its window, where that is narrower than a period.

    Pixels whose window is wider, unknown, or missed by every order are void. `margin` is that to
    the middle of the window.

    Raises
    ------
    DecodeError
        No pixel has a window narrower than the period.
    """
    finest = frames.finest
    period = finest.fringe.period_px
    low, high = _window(frames)
    slack = _slack(finest)
    narrow = high - low + 2 * slack < period
    if not narrow.any():
        raise DecodeError(_too_wide(period, high - low))
    coordinate, margin = np.empty_like(finest.phase), np.empty_like(finest.phase)
    order = np.empty(finest.phase.shape, np.int32)
    middle = np.asarray((low + high) / 2, np.float32)
    unwrap(finest.phase, middle, period, finest.fringe.zero_px, coordinate, order, margin)
    inside = (coordinate >= low - slack) & (coordinate <= high + slack)
    return Ordered(_absolute(finest, order, np.where(narrow & inside, margin, np.nan)), ROUTE)


ROUTE = ("depth window",)


def by_objects(frames: AxisFrames) -> Ordered:
    """One number of turns for each region of `find_regions`, from the windows of all its pixels.

    A number fits where it brings `LEAST_FIT` of the pixels into their windows; a region that no
    number fits, or that two do, is void. The longer an object is in depth, the wider its window
    may be. `margin` is by which share of the pixels the best number leads.
    """
    finest = frames.finest
    unwrapped = find_regions(finest)
    placed = _place_regions(unwrapped, _window(frames))
    here = unwrapped.region
    known = (here >= 0) & placed.certain[here]
    order = unwrapped.turns + placed.turns[here]
    margin = np.where(known, placed.lead[here], np.nan)
    kept = int(np.count_nonzero(placed.certain))
    route = (f"{kept} of {unwrapped.region_count} regions in their depth window",)
    return Ordered(_absolute(finest, order, margin), route)


@dataclass(frozen=True, slots=True)
class _Placed:
    """Of each region: turns to add, whether they are certain, and their lead over the next."""

    turns: OrderMap
    certain: NDArray[np.bool_]
    lead: Array


def _place_regions(unwrapped: UnwrappedPhase, window: tuple[FloatMap, FloatMap]) -> _Placed:
    first, last, region = _admitted(unwrapped, window)
    if not region.size:
        nothing = np.zeros(max(unwrapped.region_count, 1))
        return _Placed(nothing.astype(np.int32), nothing > 0, nothing)
    lowest, size = int(first.min()), int(max(last.max(), first.max()) - first.min()) + 2
    shape = (unwrapped.region_count, size)
    some = first <= last
    begins = np.bincount((region * size + first - lowest)[some], minlength=shape[0] * size)
    ends = np.bincount((region * size + last + 1 - lowest)[some], minlength=shape[0] * size)
    pixels = np.bincount(region, minlength=shape[0])
    fits = np.cumsum((begins - ends).reshape(shape), axis=1) / np.maximum(pixels, 1)[:, None]
    best = np.argmax(fits, axis=1)
    ranked = np.partition(fits, -2, axis=1)
    certain = (ranked[:, -1] >= LEAST_FIT) & (ranked[:, -2] <= MOST_FIT)
    return _Placed((best + lowest).astype(np.int32), certain, ranked[:, -1] - ranked[:, -2])


def _admitted(
    unwrapped: UnwrappedPhase, window: tuple[FloatMap, FloatMap]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """First and last turns to add that leave a pixel in its window, and its region.

    Of the pixels that have a window; where none does, the last is below the first.
    """
    fringe, slack = unwrapped.fringe, _slack(unwrapped.wrapped)
    at = fringe.zero_px + unwrapped.phase.astype(np.float64) * (fringe.period_px / (2 * np.pi))
    first = np.ceil((window[0] - slack - at) / fringe.period_px)
    last = np.floor((window[1] + slack - at) / fringe.period_px)
    known = np.isfinite(first) & np.isfinite(last)
    return (
        first[known].astype(np.int64),
        last[known].astype(np.int64),
        unwrapped.region[known].astype(np.int64),
    )


def _window(frames: AxisFrames) -> tuple[FloatMap, FloatMap]:
    """Lowest and highest coordinate of each pixel, px: the projector's image if none is known."""
    if frames.window is not None:
        return frames.window.low_px, frames.window.high_px
    shape, extent = frames.finest.phase.shape, frames.capture.sequence.extent(frames.axis)
    low = np.full(shape, PROJECTOR_EDGE_PX, np.float32)
    return low, low + np.float32(extent)


def _slack(wrapped: WrappedPhase) -> FloatMap:
    """How far, px, noise may carry a coordinate out of its window."""
    scale = SLACK_SIGMAS * wrapped.fringe.period_px / (2 * np.pi)
    return np.asarray(wrapped.sigma * np.float32(scale), np.float32)


def _absolute(wrapped: WrappedPhase, order: OrderMap, margin: Array) -> AbsolutePhase:
    void = np.isnan(margin) | np.isnan(wrapped.phase)
    kept = np.where(void, np.float32(np.nan), margin).astype(np.float32)
    return AbsolutePhase(wrapped, np.where(void, VOID_ORDER, order).astype(np.int32), kept)


def _too_wide(period_px: float, widths: FloatMap) -> str:
    known = widths[np.isfinite(widths)]
    width = f"the narrowest is {known.min():.4g} px" if known.size else "no pixel has one"
    return (
        f"a depth window must be narrower than the fringes' period of {period_px:.4g} px, "
        f"{width}: give a narrower --z-range (and --rig), or project wider fringes"
    )
