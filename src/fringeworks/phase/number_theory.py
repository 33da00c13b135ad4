"""Orders of several periods by number theory: all integer tuples, the least spread wins.

Every order of the finest set within reach is tried with the orders of the other sets that come
nearest to it, and the weighted spread of the coordinates they say, ``sum w (x_n - mean)^2`` with
``w = 1 / sigma_x^2``, is chi squared of that tuple. Two coprime periods repeat together only
after their least common multiple (Gushov and Solodkin 1991); with noise what counts is how far
the next best tuple stays behind. No step builds on another, as in a chain.
"""

from __future__ import annotations

import numpy as np

from fringeworks.errors import DecodeError
from fringeworks.kernels.periods import agree_on_order
from fringeworks.model import AbsolutePhase, FloatMap, Fringe, WrappedPhase
from fringeworks.model.phase import VOID_ORDER
from fringeworks.model.sequence import PROJECTOR_EDGE_PX
from fringeworks.phase.chained import PIXEL_NATS
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.phase.temporal import LEAST_SAFETY, PLANNED_SIGMA_RAD

LEAST_SIGMA_RAD = 0.05
"""No phase is trusted beyond this: the response's ripple is in no sigma."""

MISFIT_SIGMAS = 5.0
"""A pixel whose best order leaves more than this, per phase to spare, sees no one place."""

EDGE_TURNS = 0.25
"""Noise may put light from the projector's first or last pixel so far outside its image."""


def order_by_number_theory(frames: AxisFrames) -> Ordered:
    """Orders of the finest set on which all sets agree best.

    A pixel is void where the next best order is not a thousand times less likely, or where even
    the best is out of the question. The margin is
    ``(s2 - s1) / (s2 + s1)``, s the roots of the best two spreads: one where all sets agree.

    Raises
    ------
    DecodeError
        The axis has one period only, or its periods look alike again within the projector's
        image.
    """
    phases = sorted(frames.phases, key=lambda wrapped: wrapped.fringe.period_px)
    fringes = [wrapped.fringe for wrapped in phases]
    extent = frames.capture.sequence.extent(frames.axis)
    _check(fringes, extent)
    order, best, second = _agree(phases, _limits(frames, extent, fringes[0].period_px))
    with np.errstate(invalid="ignore"):  # infinite over infinite: one order alone is admissible
        roots = np.sqrt(best), np.sqrt(second)
        margin = (roots[1] - roots[0]) / (roots[1] + roots[0])
    margin[np.isinf(second)] = 1.0
    sure = second - best >= 2 * PIXEL_NATS
    sure &= best <= MISFIT_SIGMAS**2 * (len(phases) - 1)
    periods = ", ".join(f"{fringe.period_px:.4g}" for fringe in reversed(fringes))
    phase = AbsolutePhase(
        phases[0],
        np.where(sure, order, VOID_ORDER).astype(np.int32),
        np.where(sure, margin, np.float32(np.nan)).astype(np.float32),
    )
    return Ordered(phase, (f"fringes of {periods} px together",))


def _agree(
    phases: list[WrappedPhase], limits_px: tuple[FloatMap, FloatMap]
) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.int32]], FloatMap, FloatMap]:
    shape = phases[0].phase.shape
    order = np.empty(shape, np.int32)
    best, second = np.empty(shape, np.float32), np.empty(shape, np.float32)
    agree_on_order(
        np.stack([wrapped.phase for wrapped in phases]),
        np.stack([np.maximum(wrapped.sigma, np.float32(LEAST_SIGMA_RAD)) for wrapped in phases]),
        (
            np.array([wrapped.fringe.period_px for wrapped in phases]),
            np.array([wrapped.fringe.zero_px for wrapped in phases]),
        ),
        limits_px,
        order,
        best,
        second,
    )
    return order, best, second


def _limits(frames: AxisFrames, extent: int, period_px: float) -> tuple[FloatMap, FloatMap]:
    """Where the light can come from: the window within the image, or the whole image."""
    edge = EDGE_TURNS * period_px
    low = np.full((1, 1), PROJECTOR_EDGE_PX - edge, np.float32)
    high = np.full((1, 1), PROJECTOR_EDGE_PX + extent + edge, np.float32)
    if frames.window is None:
        return low, high
    return np.fmax(frames.window.low_px, low), np.fmin(frames.window.high_px, high)


def _check(fringes: list[Fringe], extent: int) -> None:
    axis = fringes[0].axis
    if len(fringes) < 2:
        raise DecodeError(
            f"number-theoretical orders need fringes of two periods or more along {axis}, got "
            f"{fringes[0].period_px:g} px alone: add a period"
        )
    apart, safety = least_safe_step(fringes, extent)
    if safety < LEAST_SAFETY:
        periods = " and ".join(f"{fringe.period_px:.4g}" for fringe in fringes)
        raise DecodeError(
            f"fringes of {periods} px along {axis} look alike again after {apart:.4g} px, and the "
            f"projector has {extent}: add a period, or take ones with a longer common multiple"
        )


def least_safe_step(fringes: list[Fringe], extent: int) -> tuple[float, float]:
    """The step, px, that the sets tell worst from none, and by how many sigma it is safe.

    Half the distance between two orders, in sigma of `PLANNED_SIGMA_RAD` in every set; steps are
    whole periods of `fringes[0]` within `extent`.
    """
    periods = np.array([fringe.period_px for fringe in fringes])
    steps = np.arange(1, int(extent / periods[0]) + 1) * periods[0]
    away = steps[:, None] - periods * np.rint(steps[:, None] / periods)
    weights = (2 * np.pi / (periods * PLANNED_SIGMA_RAD)) ** 2
    mean = (away * weights).sum(axis=1) / weights.sum()
    safety = np.sqrt((weights * (away - mean[:, None]) ** 2).sum(axis=1)) / 2
    worst = int(safety.argmin())
    return float(steps[worst]), float(safety[worst])
