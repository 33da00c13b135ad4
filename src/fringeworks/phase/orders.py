"""One interface for every way of telling fringe orders.

A method is a function from `AxisFrames`, all that a capture says about one projector axis, to
`Ordered`, the orders of the finest fringes. `decode` picks one and makes the coordinate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from fringeworks.model import AbsolutePhase, Axis, Capture, WrappedPhase
from fringeworks.phase.window import CoordinateWindow


@dataclass(frozen=True, slots=True)
class AxisFrames:
    """What a method may look at.

    Attributes
    ----------
    capture
        One group of it: frames other than fringes are read from here.
    phases
        Demodulated fringe sets of the axis, in the capture's order.
    window
        What is known of each pixel's coordinate beforehand; None: that it is inside the
        projector's image.
    """

    capture: Capture
    axis: Axis
    phases: tuple[WrappedPhase, ...]
    window: CoordinateWindow | None = None

    @property
    def finest(self) -> WrappedPhase:
        return min(self.phases, key=lambda wrapped: wrapped.fringe.period_px)


@dataclass(frozen=True, slots=True)
class Ordered:
    """Orders of the finest fringes, -1 and NaN margin where they are not certain.

    `route` says in words, coarse to fine, what led to them.
    """

    phase: AbsolutePhase
    route: tuple[str, ...]


OrderMethod: TypeAlias = Callable[[AxisFrames], Ordered]
"""Raises `DecodeError` where the capture lacks what the method reads, naming what to add."""
