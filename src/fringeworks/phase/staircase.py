"""Phase coding (Wang and Zhang 2012): a second set of fringes whose phase is a stair of the order.

The stair's phase is ``-pi + 2 pi (k + 1/2) / K`` over fringe k, K the number of levels, so that
``l = K (phi_stair + pi) / 2 pi - 1/2`` is the order. At the edges of the fringes blur smears the
steps: a pixel right of a wrap may still see part of the level before it. How much it sees is
known from where it stands in its fringe, so that share of a step is taken off before rounding;
every pixel then has the whole half level to the next order, at an edge with the noise of the
wrapped phase on top. (As with a complementary Gray code,
the wrapped phase itself says on which side of the wrap a pixel is.)

One pixel tells K levels at five sigma where ``K <= pi / (5 sigma)``, sigma that of the stair's
phase, rad: 13 levels at three frames and B = 17 sigma. Beyond that pixels become void.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from fringeworks.errors import DecodeError
from fringeworks.model import AbsolutePhase, FloatMap, Staircase, WrappedPhase
from fringeworks.model.phase import VOID_ORDER
from fringeworks.model.sequence import fringe_orders
from fringeworks.phase.chained import PIXEL_NATS, find_carrier, refine
from fringeworks.phase.exposures import demodulate_stair
from fringeworks.phase.orders import AxisFrames, Ordered

STEP_SIGMA_PX = 1.0
"""Blur of the steps, standard deviation in projector px, camera's pixels included. Twice or half
as much misplaces a pixel by less than a fifth of a level."""


def order_by_staircase(frames: AxisFrames) -> Ordered:
    """Orders of the fringes on whose wraps the stair steps, then of the finest.

    A pixel is void where the next level is not a thousand times less likely. The margin is one
    where a pixel sees its level exactly, zero halfway to the next.

    Raises
    ------
    DecodeError
        The capture has no staircase along the axis, or no fringes of its period.
    """
    stair, seen = _find_stair(frames)
    carrier = find_carrier(frames, stair, name="staircase")
    level = (seen.phase + np.float32(np.pi)) * np.float32(stair.levels / (2 * np.pi))
    share, slope = _step_share(carrier)
    level -= np.float32(0.5) + share
    order = np.rint(level)
    margin = 1 - 2 * np.abs(level - order)
    sigma = np.hypot(seen.sigma * stair.levels, slope * carrier.sigma) / np.float32(2 * np.pi)
    order %= stair.levels  # the level before the first is the last one
    shown = len(fringe_orders(frames.capture.sequence.extent(frames.axis), stair.period_px))
    sure = (margin >= 2 * PIXEL_NATS * sigma**2) & (order < shown) & np.isfinite(carrier.phase)
    phase = AbsolutePhase(
        carrier,
        np.where(sure, order, VOID_ORDER).astype(np.int32),
        np.where(sure, margin, np.float32(np.nan)),
    )
    return refine(frames, phase, (f"staircase of {stair.levels} levels",))


def _find_stair(frames: AxisFrames) -> tuple[Staircase, WrappedPhase]:
    """The axis's first staircase, and its phase."""
    for stair, *_ in frames.capture.find(Staircase):
        if stair.axis == frames.axis:
            return stair, demodulate_stair(stair, frames.capture)
    raise DecodeError(
        f"the capture has no staircase along {frames.axis}: add one (`--code staircase`), or "
        "choose another method"
    )


def _step_share(carrier: WrappedPhase) -> tuple[FloatMap, FloatMap]:
    """What blur adds to the level of each pixel's own fringe, and how it rises per turn.

    Minus half a level where a fringe begins, zero inside, half a level where it ends.
    """
    sigma = STEP_SIGMA_PX / carrier.fringe.period_px
    within = carrier.phase / np.float32(2 * np.pi)
    after, before = (within - np.float32(0.5)) / sigma, (np.float32(-0.5) - within) / sigma
    share = ndtr(after) - ndtr(before)
    bells = np.exp(-np.square(after) / 2) + np.exp(-np.square(before) / 2)
    slope = bells / np.float32(np.sqrt(2 * np.pi) * sigma)
    return np.asarray(share, np.float32), np.asarray(slope, np.float32)
