"""The ways of telling fringe orders, by the names that the command line has for them.

`auto` takes what a capture holds: a Gray code; else fringes that tell each other's orders; else a
staircase, a code frame, colours. Neither a window alone nor the paper's own reading of a code
frame is taken unless it is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, TypeAlias, get_args

from fringeworks.errors import DecodeError, UsageError
from fringeworks.model import Codeword, Colour, GrayCode, Staircase
from fringeworks.patterns.checks import has_hues
from fringeworks.phase.chained import order_by_frequencies, order_by_gray
from fringeworks.phase.codeframe import order_by_code_frame
from fringeworks.phase.colour import order_by_colour
from fringeworks.phase.number_theory import order_by_number_theory
from fringeworks.phase.objects import by_objects, depth_window
from fringeworks.phase.orders import AxisFrames, OrderMethod
from fringeworks.phase.paper_code import code_correlation, paper_code
from fringeworks.phase.staircase import order_by_staircase
from fringeworks.phase.temporal import plan_chain

MethodName: TypeAlias = Literal[
    "gray",
    "frequencies",
    "number-theoretical",
    "staircase",
    "colour",
    "code-frame",
    "paper-code",
    "code-correlation",
    "depth-window",
    "objects",
]
OrdersName: TypeAlias = Literal["auto"] | MethodName

METHODS: Mapping[MethodName, OrderMethod] = MappingProxyType(
    {
        "gray": order_by_gray,
        "frequencies": order_by_frequencies,
        "number-theoretical": order_by_number_theory,
        "staircase": order_by_staircase,
        "colour": order_by_colour,
        "code-frame": order_by_code_frame,
        "paper-code": paper_code,
        "code-correlation": code_correlation,
        "depth-window": depth_window,
        "objects": by_objects,
    }
)

READS: Mapping[MethodName, type[Codeword | Colour | GrayCode | Staircase]] = MappingProxyType(
    {
        "gray": GrayCode,
        "staircase": Staircase,
        "code-frame": Codeword,
        "paper-code": Codeword,
        "code-correlation": Codeword,
        "colour": Colour,
    }
)
"""What a method reads besides fringes."""

PROJECTED_BY: Mapping[type[Codeword | Colour | GrayCode | Staircase], str] = MappingProxyType(
    {
        GrayCode: "Gray code (`--code gray`)",
        Staircase: "staircase (`--code staircase`)",
        Codeword: "code frame (`--codewords paper`)",
        Colour: "colour frame (`--code colour`)",
    }
)
"""Their names, and the option of `patterns` that adds them."""

ONE_FRAME_OR_THREE: tuple[MethodName, ...] = ("staircase", "code-frame", "colour")
"""Which codes `auto` looks for, one after the other, where there is no Gray code and no chain."""

WITHOUT_WINDOW: tuple[MethodName, ...] = ("gray", "frequencies")
"""Methods for which no window need be worked out."""


def check_orders(orders: str) -> None:
    """UsageError where there is no method of this name."""
    names = ("auto", *get_args(MethodName))
    if orders not in names:
        raise UsageError(f"orders must be one of {', '.join(names)}, got '{orders}'")


def choose_method(orders: OrdersName, frames: AxisFrames) -> MethodName:
    """The method for one axis of a capture; frequencies where `auto` finds nothing to read.

    Raises
    ------
    DecodeError
        The axis lacks what the method that is asked for reads.
    """
    if orders != "auto":
        if orders in READS and not holds(frames, orders):
            raise DecodeError(
                f"the capture has no {PROJECTED_BY[READS[orders]]} along {frames.axis}, which "
                f"--orders {orders} reads: project one too, or choose another method"
            )
        return orders
    if holds(frames, "gray"):
        return "gray"
    if not _chain_together(frames):
        for name in ONE_FRAME_OR_THREE:
            if holds(frames, name):
                return name
    return "frequencies"


def holds(frames: AxisFrames, name: MethodName) -> bool:
    """Whether the axis has the frames that a method reads besides fringes; greys are none."""
    return any(
        pattern.axis == frames.axis and not (isinstance(pattern, Colour) and not has_hues(pattern))
        for pattern, *_ in frames.capture.find(READS[name])
    )


def _chain_together(frames: AxisFrames) -> bool:
    """Whether the fringes alone tell their orders."""
    extent = frames.capture.sequence.extent(frames.axis)
    try:
        plan_chain([wrapped.fringe for wrapped in frames.phases], extent / 2)
    except DecodeError:
        return False
    return True
