"""Which orders a region has, from the letters that its fringes carry.

Codewords, colours and any other letters are one case. Inside a region the order rises by one per
wrap, so all its fringes share one unknown start s: the fringe at relative turn j has order
``s + j`` and the letter that the pattern gives to that order. Every start is scored,
``L(s) = sum_j L_letter(s + j)(j)``, whether the sequence of letters repeats, is of the de Bruijn
kind, or anything else; what is known beforehand only bounds s. The confidence is what the best
start is ahead of the second, in nats.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import AbsolutePhase, UnwrappedPhase
from fringeworks.model.phase import VOID_ORDER
from fringeworks.phase.window import CoordinateWindow

LEAST_NATS = math.log(100)
"""A region whose best start is not a hundred times as likely as the second stays relative."""

DOUBT = 0.01
"""Share of fringes that may show any letter, however sure their pixels are: what misleads one
pixel of a fringe misleads its neighbours too."""

MOST_UNLIKELY_NATS = 1.5
"""Per fringe, what the best start may fall short of the fringes' own letters: at ln(99 letters)
for one that disagrees, about every fourth may."""

OUTSIDE_NATS = 5.0
"""Cost of a pixel whose light would come from outside the projector's image: a few wild pixels
may, a fringe may not."""

WINDOW_SHARE = 0.02
"""Of a region's pixels so many may contradict the window."""

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the fringes of each region say.

    Attributes
    ----------
    letters
        ``(regions, turns, letters)`` log-likelihood, summed over the fringe's pixels.
    pixels
        ``(regions, turns)``: how many there are.
    lowest
        ``(regions,)``: the turn that comes first in each region.
    """

    letters: Array
    pixels: Integers
    lowest: Integers


@dataclass(frozen=True, slots=True)
class Starts:
    """Order at turn zero of each region, ``(regions,)``, and by how many nats it leads.

    The lead is infinite where one start alone is admissible, -inf where none is. `shortfall` is
    by how many nats per fringe the best start is less likely than each fringe's own letter.
    """

    order: Integers
    lead: Array
    shortfall: Array


def gather_evidence(unwrapped: UnwrappedPhase, letters: NDArray[np.floating]) -> Evidence:
    """Sum log-likelihoods ``(letters, H, W)`` over every fringe of every region; NaN counts zero.

    Void pixels are left out.
    """
    use = unwrapped.region >= 0
    region, turn = unwrapped.region[use].astype(np.int64), unwrapped.turns[use].astype(np.int64)
    lowest = np.full(unwrapped.region_count, np.iinfo(np.int64).max)
    np.minimum.at(lowest, region, turn)
    step = turn - lowest[region]
    shape = (unwrapped.region_count, int(step.max(initial=-1)) + 1)
    cell, cells = region * shape[1] + step, shape[0] * shape[1]
    sums = [
        np.bincount(cell, np.nan_to_num(letter[use]), minlength=cells).reshape(shape)
        for letter in letters
    ]
    pixels = np.bincount(cell, minlength=cells).reshape(shape)
    return Evidence(np.stack(sums, axis=-1), pixels, lowest)


def doubt_fringes(evidence: Evidence) -> Evidence:
    """The same with `DOUBT`: log of each letter's probability, but for a small share of any."""
    best = evidence.letters.max(axis=-1, keepdims=True)
    odds = np.exp(evidence.letters - best)
    odds /= odds.sum(axis=-1, keepdims=True)
    letters = np.log((1 - DOUBT) * odds + DOUBT / evidence.letters.shape[-1])
    return replace(evidence, letters=np.where(evidence.pixels[..., None] > 0, letters, 0.0))


def admissible_starts(
    unwrapped: UnwrappedPhase, window: CoordinateWindow | None
) -> tuple[Array, Array]:
    """Lowest and highest order at turn zero of each region that the window admits, ``(regions,)``.

    Every pixel bounds its region's start; all but `WINDOW_SHARE` of them hold. Infinite without a
    window, and in regions that it says nothing of.
    """
    count, fringe = unwrapped.region_count, unwrapped.fringe
    if window is None:
        return np.full(count, -np.inf), np.full(count, np.inf)
    use = (unwrapped.region >= 0) & np.isfinite(window.low_px + window.high_px)
    region, turns = unwrapped.region[use], unwrapped.phase[use] / (2 * np.pi)
    low = (window.low_px[use] - fringe.zero_px) / fringe.period_px - turns
    high = (window.high_px[use] - fringe.zero_px) / fringe.period_px - turns
    most = _share_of_each(low, region, count=count, share=1 - WINDOW_SHARE, missing=-np.inf)
    least = _share_of_each(high, region, count=count, share=WINDOW_SHARE, missing=np.inf)
    return most, least


def _share_of_each(
    values: NDArray[np.floating],
    region: NDArray[np.integer],
    *,
    count: int,
    share: float,
    missing: float,
) -> Array:
    """The value below which a share of each region's values lies."""
    ranked = values[np.lexsort((values, region))]
    ends = np.searchsorted(np.sort(region), np.arange(count + 1))
    sizes = np.diff(ends)
    at = ends[:-1] + np.rint(share * np.maximum(sizes - 1, 0)).astype(np.int64)
    found = np.full(count, missing)
    found[sizes > 0] = ranked[at[sizes > 0]]
    return found


def find_starts(
    evidence: Evidence,
    letters: Integers,
    *,
    first: int = 0,
    admissible: tuple[Array, Array] | None = None,
) -> Starts:
    """The likeliest start of each region.

    Parameters
    ----------
    evidence
        Of all regions.
    letters
        ``(orders,)``: index of the letter that each of the projector's orders carries, from order
        `first` on.
    admissible
        Lowest and highest order at turn zero, ``(regions,)``.
    """
    regions, turns = evidence.pixels.shape
    if turns == 0:
        none = np.full(regions, -np.inf)
        return Starts(np.zeros(regions, np.int64), none, -none)
    scores = np.zeros((regions, len(letters) + turns - 1))
    for turn in range(turns):  # column i: lowest turn has order first - turns + 1 + i
        here = np.full(scores.shape, -OUTSIDE_NATS * evidence.pixels[:, turn, None])
        begin = turns - 1 - turn
        here[:, begin : begin + len(letters)] = evidence.letters[:, turn][:, letters]
        scores += here
    starts = first - turns + 1 + np.arange(scores.shape[1]) - evidence.lowest[:, None]
    if admissible is not None:
        low, high = admissible
        scores[(starts < low[:, None]) | (starts > high[:, None])] = -np.inf
    return _best_of(scores, starts, evidence)


def _best_of(scores: Array, starts: Integers, evidence: Evidence) -> Starts:
    rows, best = np.arange(len(scores)), scores.argmax(axis=1)
    top = scores[rows, best]
    rest = scores.copy()
    rest[rows, best] = -np.inf
    with np.errstate(invalid="ignore"):  # -inf - -inf: no start at all
        lead = top - rest.max(axis=1)
    own = evidence.letters.max(axis=-1).sum(axis=1)
    fringes = np.maximum(np.count_nonzero(evidence.pixels, axis=1), 1)
    return Starts(
        starts[rows, best], np.where(np.isnan(lead), -np.inf, lead), (own - top) / fringes
    )


def place_regions(unwrapped: UnwrappedPhase, starts: Starts) -> AbsolutePhase:
    """Absolute phase of the regions whose start leads by `LEAST_NATS` and is likely itself.

    The others are void: below `LEAST_NATS`, or with a shortfall above `MOST_UNLIKELY_NATS`.

    The margin is ``tanh(lead / 2)``, the difference of the two best starts' probabilities over
    their sum: zero where they are alike, one where the second is out of the question.
    """
    likely = (starts.lead >= LEAST_NATS) & (starts.shortfall <= MOST_UNLIKELY_NATS)
    sure = np.append(likely, False)  # the last one is for void pixels
    margin = np.append(np.tanh(starts.lead / 2), np.nan).astype(np.float32)
    order = unwrapped.turns + np.append(starts.order, 0)[unwrapped.region]
    known = sure[unwrapped.region] & np.isfinite(unwrapped.wrapped.phase)
    return AbsolutePhase(
        unwrapped.wrapped,
        np.where(known, order, VOID_ORDER).astype(np.int32),
        np.where(known, margin[unwrapped.region], np.float32(np.nan)),
    )
