"""Order methods that go along a chain of carriers: from coarser fringes and beats, or a Gray code.

The chain itself is `temporal`. Whatever tells the orders of one set leads on to the finest here.
"""

from __future__ import annotations

import math

import numpy as np

from fringeworks.errors import DecodeError
from fringeworks.model import AbsolutePhase, Colour, FloatMap, Staircase, WrappedPhase
from fringeworks.model.phase import VOID_ORDER
from fringeworks.model.sequence import PROJECTOR_EDGE_PX
from fringeworks.phase.gray import GrayReading, read_gray
from fringeworks.phase.orders import AxisFrames, Ordered
from fringeworks.phase.temporal import PLANNED_SIGMA_RAD, plan_chain, run_chain

PIXEL_NATS = math.log(1000)
"""By so much a single pixel's order must be likelier than the next: there are many pixels."""

SAFE_MARGIN = 0.1
SAFE_SIGMAS = 5.0
"""Under a Gray code noise decides the order where a doubtful bit leaves less margin than the
former, or where less is left than this many sigma of the phase. Only plain codes whose cells are
as wide as the fringes bring pixels there, at the edges of their cells."""


def order_by_frequencies(frames: AxisFrames) -> Ordered:
    """Hierarchical or heterodyne, whichever the periods are made for (`plan_chain`).

    The chain starts from the centre of the projector's image for all pixels.

    Raises
    ------
    DecodeError
        No chain of the axis's periods leads to the finest.
    """
    extent = frames.capture.sequence.extent(frames.axis)
    centre = np.full((1, 1), (extent - 1) / 2, np.float32)
    return _follow(frames, centre, reach_px=extent / 2)


def order_by_gray(frames: AxisFrames) -> Ordered:
    """From the centre of the (half) cell of the axis's finest Gray code.

    Raises
    ------
    DecodeError
        The axis has no Gray code, or no chain leads on from its cells.
    FormatError
        There is nothing to tell light from dark by.
    """
    first = frames.phases[0]
    reading = read_gray(frames.capture, frames.axis, fringes=first, least_modulation=0.0)
    if reading is None:
        raise DecodeError(
            f"the capture has no Gray code along {frames.axis}: add one, or choose another method"
        )
    code_px = reading.code.code_px
    route = (f"Gray code of {code_px:g} px cells",)
    ordered = _follow(frames, reading.coordinate, reach_px=code_px / 2, route=route)
    return Ordered(_without_doubtful(ordered.phase, reading), ordered.route)


def find_carrier(frames: AxisFrames, code: Staircase | Colour, *, name: str) -> WrappedPhase:
    """The fringes whose orders a code tells.

    Raises
    ------
    DecodeError
        No fringes of the axis have the code's period and begin at the image's edge, as it does.
    """
    for wrapped in frames.phases:
        begins = wrapped.fringe.zero_px == PROJECTOR_EDGE_PX
        if begins and wrapped.fringe.period_px == code.period_px:
            return wrapped
    raise DecodeError(
        f"the {name} along {code.axis} changes every {code.period_px:g} px, and no fringes have "
        f"that period: add them, or make the {name} for the fringes that there are"
    )


def refine(frames: AxisFrames, phase: AbsolutePhase, route: tuple[str, ...]) -> Ordered:
    """From the orders of one of the sets to those of the finest.

    Raises
    ------
    DecodeError
        The step is too long, and no set stands between.
    """
    if phase.fringe.period_px <= frames.finest.fringe.period_px:
        return Ordered(phase, route)
    per_rad = phase.fringe.period_px / (2 * np.pi)
    reference = (phase.fringe.zero_px + per_rad * phase.phase).astype(np.float32)
    reach_px = SAFE_SIGMAS * PLANNED_SIGMA_RAD * per_rad
    return _follow(frames, reference, reach_px=reach_px, route=route, margin=phase.margin)


def _follow(
    frames: AxisFrames,
    reference_px: FloatMap,
    *,
    reach_px: float,
    route: tuple[str, ...] = (),
    margin: FloatMap | None = None,
) -> Ordered:
    """The chain from a coordinate that is wrong by `reach_px` at most."""
    chain = plan_chain([wrapped.fringe for wrapped in frames.phases], reach_px)
    _, order, least = run_chain(frames.phases, chain, reference_px)
    if margin is not None:
        np.minimum(least, margin, out=least)
    order[np.isnan(least)] = VOID_ORDER
    phase = AbsolutePhase(frames.finest, order, least)
    return Ordered(phase, (*route, *map(str, chain)))


def _without_doubtful(phase: AbsolutePhase, reading: GrayReading) -> AbsolutePhase:
    doubtful = reading.at_edge & (phase.margin < SAFE_MARGIN)
    doubtful |= phase.margin * np.float32(np.pi) < SAFE_SIGMAS * phase.wrapped.sigma
    order = np.where(doubtful, VOID_ORDER, phase.order).astype(np.int32)
    margin = np.where(doubtful, np.float32(np.nan), phase.margin)
    return AbsolutePhase(phase.wrapped, order, margin)
