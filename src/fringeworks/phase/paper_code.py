"""The paper's way to the fringe orders of isolated objects: section 5, step by step.

Step 1 cuts the image into continuous regions and sets a feature point in each; step 2 unwraps
each region by itself (equation 12: a relative phase); step 3 takes the spectrum of the one fringe
of the code frame that holds the feature point, names its codeword from Table 1, and moves the
region by whole turns (equation 13, which must read ``Phi_cyl^a = Phi_cyl^r - 2 pi k``). Which of
the code's repeats a region lies in says the partition of the template, or a depth window.

Departures: feature points are found, not set by hand; the cone's phase of equation 12 is absolute
by its own codeword and partition like every other region's; a region whose spectrum peaks nearer
to no codeword than half the way to the next, or that has no whole fringe, stays without order.

`code_correlation` is the paper's future work, "combining the FFT and a correlation technique for
the phase period signal". The wrapped phase says where in its fringe each pixel lies, so that each
codeword's cosine is known pixel by pixel: its correlation with the frame is the value of the
Fourier transform at the codeword's frequency, in the phase that the pattern prescribes.
Both decide by one fringe; `codeframe` by all fringes of a region, and their sequence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import AbsolutePhase, Codeword, FloatMap, Frames, UnwrappedPhase
from fringeworks.model.phase import VOID_ORDER, VOID_REGION, OrderMap
from fringeworks.phase.chained import refine
from fringeworks.phase.codeframe import (
    find_code_frame,
    find_fringes,
    orders_of,
    refuse_saturated,
)
from fringeworks.phase.codeword_names import (
    FringeCut,
    NameCodeword,
    name_by_correlation,
    name_by_spectrum,
)
from fringeworks.phase.feature_points import Period, find_feature_periods
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.phase.regions import find_regions
from fringeworks.phase.window import CoordinateWindow


@dataclass(frozen=True, slots=True)
class RegionCode:
    """What a method found in one region.

    Attributes
    ----------
    period, fringe
        Where the feature point's period is and what it shows.
    codeword
        Index into the code's `codewords_px`.
    margin
        1 where the evidence is the codeword's own, 0 and less where the next is as good.
    order
        Fringe order of the feature point; None if its codeword is not certain, or where the
        window holds no fringe of it or several.
    """

    period: Period
    fringe: FringeCut
    codeword: int
    margin: float
    order: int | None


def paper_code(frames: AxisFrames) -> Ordered:
    """Orders by the FFT of one fringe per region (section 5 of the paper).

    Raises
    ------
    DecodeError
        No code frame, or no fringes under it; its orders repeat and no window tells the repeats
        apart; it is saturated.
    """
    return _order(frames, name_by_spectrum, "code frame, FFT of a fringe per region")


def code_correlation(frames: AxisFrames) -> Ordered:
    """Orders by correlating one fringe per region with each codeword (the paper's future work).

    Raises
    ------
    DecodeError
        As `paper_code`.
    """
    return _order(frames, name_by_correlation, "code frame, correlation of a fringe per region")


@dataclass(frozen=True, slots=True)
class CodeReading:
    """All that a method looked at and found, for pictures too.

    Attributes
    ----------
    code, grey
        The code frame and its grey levels, ``(H, W)``.
    unwrapped
        Steps 1 and 2: regions and their relative phase.
    regions
        Step 3, region by region; one without a whole fringe has no entry.
    """

    code: Codeword
    grey: Frames | FloatMap
    unwrapped: UnwrappedPhase
    regions: tuple[RegionCode, ...]


def read_code_frame(frames: AxisFrames, name: NameCodeword = name_by_spectrum) -> CodeReading:
    """Steps 1 to 3, up to the order of each region's feature point.

    Raises
    ------
    DecodeError
        As `paper_code`.
    """
    code, grey = find_code_frame(frames)
    where, wrapped = _where(frames, code), find_fringes(frames, code)
    refuse_saturated(grey, wrapped, frames.capture.saturation_of(code))
    unwrapped, phase = find_regions(wrapped), wrapped.phase
    found: list[RegionCode] = []
    for period in find_feature_periods(phase, unwrapped.region, code.axis):
        fringe = cut_fringe(period, grey, phase)
        word, margin = name(fringe, code)
        places = code.zero_px + code.period_px * (where.orders + phase[period.pixel] / (2 * np.pi))
        fits = (where.words == word) & where.holds(places, period.pixel) & (margin > 0)
        order = int(where.orders[fits][0]) if np.count_nonzero(fits) == 1 else None
        found.append(RegionCode(period, fringe, word, margin, order))
    return CodeReading(code, grey, unwrapped, tuple(found))


def cut_fringe(period: Period, grey: Frames | FloatMap, phase: FloatMap) -> FringeCut:
    """What the maps ``(H, W)`` of grey level and wrapped phase show of a period."""
    levels, angles = (image[period.cut].astype(np.float64) for image in (grey, phase))
    return FringeCut(levels, angles, period.length_px)


@dataclass(frozen=True, slots=True)
class _Where:
    """Which orders the projector shows, the index of each one's codeword, and the window."""

    orders: NDArray[np.int64]
    words: OrderMap
    window: CoordinateWindow | None

    def holds(self, places_px: NDArray[np.float64], pixel: tuple[int, int]) -> NDArray[np.bool_]:
        """Which of these coordinates, px, the window admits at a pixel."""
        if self.window is None:
            return np.ones(places_px.shape, dtype=bool)
        low, high = self.window.low_px[pixel], self.window.high_px[pixel]
        return np.asarray((low <= places_px) & (places_px <= high))


def _where(frames: AxisFrames, code: Codeword) -> _Where:
    known = orders_of(code, frames.capture.sequence.extent(code.axis))
    words, orders = known.words, known.first + np.arange(len(known.words))
    if frames.window is None and len(np.unique(words)) < len(words):
        raise DecodeError(
            f"the codewords repeat over the {len(words)} fringes that the projector shows: say "
            "where objects can be, by --rig rig.json, whose volume counts, or with "
            "--z-range MIN:MAX as well"
        )
    return _Where(orders, words, frames.window)


def _order(frames: AxisFrames, name: NameCodeword, route: str) -> Ordered:
    """Move every region by whole turns, so that its feature point has its order (13)."""
    reading = read_code_frame(frames, name)
    unwrapped = reading.unwrapped
    shift = np.zeros(unwrapped.region_count, np.int32)
    margins = np.full(unwrapped.region_count, np.nan, np.float32)
    for found in reading.regions:
        if found.order is not None:
            label = found.period.region
            shift[label] = found.order - unwrapped.turns[found.period.pixel]
            margins[label] = found.margin
    inside = unwrapped.region != VOID_REGION
    order = np.full(inside.shape, VOID_ORDER, np.int32)
    margin = np.full(inside.shape, np.nan, np.float32)
    margin[inside] = margins[unwrapped.region[inside]]
    certain = np.isfinite(margin)
    order[certain] = unwrapped.turns[certain] + shift[unwrapped.region[certain]]
    return refine(frames, AbsolutePhase(unwrapped.wrapped, order, margin), (route,))
