"""What makes a pattern decodable: every rule that a sequence must meet before it is drawn.

The rules are the ones a decoder relies on. A code edge never meets a pixel centre, since rounding
would decide that pixel's code. A code frame's fringes are an even whole number of pixels wide (at
odd periods its two-pixel codeword is flat grey). Every fringe order that the projector shows has
its own place in an order code.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NoReturn

from fringeworks.errors import UsageError
from fringeworks.model import (
    AXES,
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    Picture,
    Sequence,
    Speckle,
    Staircase,
    Uniform,
    gray_bits,
    pixel_on_edge,
)
from fringeworks.model.sequence import (
    PROJECTOR_EDGE_PX,
    fringe_orders,
    shifts_are_solvable,
)

SIZE_RANGE_PX = (2, 8192)
SHORTEST_PERIOD_PX = 2.0
SHORTEST_CELL_PX = 1.0
MOST_BITS = 16
SHOWN_SHIFTS = 12

COLOURS = {
    "black": "#000000",
    "red": "#ff0000",
    "green": "#00ff00",
    "blue": "#0000ff",
    "cyan": "#00ffff",
    "magenta": "#ff00ff",
    "yellow": "#ffff00",
    "white": "#ffffff",
}
"""Names a palette may use besides ``#rrggbb``."""


def require(holds: bool, name: str, *, expected: str, actual: object) -> None:
    """Raise UsageError with the house's sentence unless the rule holds."""
    if not holds:
        raise UsageError(f"{name} must be {expected}, got {actual}")


def refuse_picture() -> NoReturn:
    """Say that a picture has no description to draw it from."""
    raise UsageError(
        "pattern must be a kind that is drawn from its description, got a picture: "
        "it is shown from its own image file"
    )


def parse_colour(name: str) -> tuple[float, float, float]:
    """Red, green and blue, each 0 to 1 of full scale, of a colour's name or ``#rrggbb``."""
    digits = COLOURS.get(name.lower(), name)
    try:
        red, green, blue = bytes.fromhex(digits.removeprefix("#"))
    except ValueError:
        expected = f"of {', '.join(COLOURS)} or #rrggbb"
        raise UsageError(f"palette must be {expected}, got '{name}'") from None
    return red / 255, green / 255, blue / 255


def has_hues(pattern: Colour) -> bool:
    """Whether it takes a colour camera to tell its colours: greys are told by any."""
    return any(len(set(parse_colour(name))) > 1 for name in pattern.palette)


def check_projector(*, width: int, height: int) -> None:
    """Bound a projector's size, px, before anything is allocated for it."""
    least, most = SIZE_RANGE_PX
    for name, size in (("width", width), ("height", height)):
        expected = f"{least} to {most} projector pixels"
        require(least <= size <= most, name, expected=expected, actual=size)


def check_pattern(pattern: Pattern, *, width: int, height: int) -> None:
    """Refuse what could not be drawn or decoded on a projector of this size.

    Raises
    ------
    UsageError
        Naming the value, what it must be and what it is.
    """
    check_projector(width=width, height=height)
    match pattern:
        case Uniform(level=level):
            require(0 <= level <= 1, "level", expected="0 to 1 of full scale", actual=level)
        case Checkerboard(square_px=square):
            _check_cells("square_px", square, extent=max(width, height))
        case Speckle(dot_px=dot):
            require(
                1 <= dot <= min(width, height),
                "dot_px",
                expected="1 px to the shorter side of the image",
                actual=f"{dot:g}",
            )
        case Picture():
            refuse_picture()
        case _:
            check_coding(pattern, width=width, height=height)


def check_coding(pattern: Pattern, *, width: int, height: int) -> None:
    """Refuse a coded pattern that no decoder could read; what codes no coordinate passes.

    The same rules hold for what is drawn and for what a capture says was shown.

    Raises
    ------
    UsageError
        Naming the value, what it must be and what it is.
    """
    extents = dict(zip(AXES, (width, height), strict=True))
    match pattern:
        case Fringe():
            _check_fringe(pattern)
        case GrayCode():
            _check_gray(pattern, extents[pattern.axis])
        case Codeword():
            _check_codeword(pattern, extents[pattern.axis])
        case Staircase():
            _check_staircase(pattern, extents[pattern.axis])
        case Colour():
            _check_colour(pattern, extents[pattern.axis])
        case _:
            pass


def check_sequence(sequence: Sequence) -> None:
    """Check every pattern, and that each code frame has the fringes it is read against.

    Raises
    ------
    UsageError
        For a pattern that `check_pattern` refuses, or a code frame without a fringe set of the
        same axis, period and zero in its group.
    """
    check_projector(width=sequence.width, height=sequence.height)
    for item in sequence.sets:
        check_pattern(item.pattern, width=sequence.width, height=sequence.height)
    for group in sequence.groups or (None,):
        shown = [sequence.sets[i].pattern for i in sequence.choose_group(group)]
        for code in shown:
            if isinstance(code, Codeword):
                require(
                    has_carrier(code, shown),
                    "a code frame",
                    expected="beside fringes of its own axis, period and zero",
                    actual=f"none along {code.axis} with period_px = {code.period_px:g}",
                )


def has_carrier(code: Codeword, shown: Iterable[Pattern]) -> bool:
    """Whether the fringes along whose phase a code frame is read are among `shown`."""
    return any(_carrier(item) == _carrier(code) for item in shown if isinstance(item, Fringe))


def _carrier(pattern: Fringe | Codeword) -> tuple[str, float, float]:
    """What the phase along which a code frame is read depends on."""
    return pattern.axis, pattern.period_px, pattern.zero_px


def _check_period(period_px: float) -> None:
    sampled = SHORTEST_PERIOD_PX <= period_px < math.inf
    require(sampled, "period_px", expected="at least 2 px", actual=f"{period_px:g}")


def _check_fringe(fringe: Fringe) -> None:
    _check_period(fringe.period_px)
    _check_shifts(fringe.shifts_rad)


def _check_shifts(shifts_rad: tuple[float, ...]) -> None:
    degrees = ", ".join(f"{math.degrees(shift):.6g}" for shift in shifts_rad[:SHOWN_SHIFTS])
    require(
        shifts_are_solvable(shifts_rad),
        "shifts",
        expected="three at least that differ clearly modulo 360 degrees",
        actual=f"{len(shifts_rad)}: {degrees}" if shifts_rad else "none",
    )


def _check_cells(name: str, cell_px: float, *, extent: int, per_cell: int = 1) -> None:
    """Cells of at least a pixel whose edges, `per_cell` of them in each, miss pixel centres."""
    code_px = cell_px / per_cell
    expected = f"at least {SHORTEST_CELL_PX * per_cell:g} px"
    require(SHORTEST_CELL_PX <= code_px < math.inf, name, expected=expected, actual=f"{cell_px:g}")
    clear = pixel_on_edge(extent, code_px) is None
    kind = "an even" if per_cell == 2 else "a"
    expected = (
        f"a width whose edges (every {code_px:g} px from the image's edge) meet no pixel centre, "
        f"as {kind} whole number is"
    )
    require(clear, name, expected=expected, actual=f"{cell_px:g}")


def _check_gray(code: GrayCode, extent: int) -> None:
    halves = 2 if code.complementary else 1
    _check_cells("cell_px", code.cell_px, extent=extent, per_cell=halves)
    needed = gray_bits(extent, code.cell_px)
    expected = f"{needed} to {MOST_BITS} for {extent} px in cells of {code.cell_px:g} px"
    require(needed <= code.bits <= MOST_BITS, "bits", expected=expected, actual=code.bits)


def _check_codeword(code: Codeword, extent: int) -> None:
    _check_period(code.period_px)
    even = code.period_px % 2 == 0
    require(
        even,
        "period_px",
        expected="an even whole number of px under a code frame",
        actual=f"{code.period_px:g}",
    )
    on_edge = (code.zero_px - PROJECTOR_EDGE_PX) % 1 == 0
    require(on_edge, "zero_px", expected="on an edge between pixels", actual=f"{code.zero_px:g}")
    words = code.codewords_px
    usable = bool(words) and all(SHORTEST_PERIOD_PX <= word <= code.period_px for word in words)
    require(
        usable and len(set(words)) == len(words),
        "codewords_px",
        expected=f"different periods from 2 px to the fringe's {code.period_px:g} px",
        actual=words,
    )
    if code.sequence is not None:
        _check_code_order(code, fringe_orders(extent, code.period_px, zero_px=code.zero_px))


def _check_code_order(code: Codeword, orders: range) -> None:
    """An explicit order of codewords names one for every fringe order."""
    sequence = code.sequence or ()
    last = len(code.codewords_px) - 1
    for index in sequence:
        require(0 <= index <= last, "sequence", expected=f"of indices 0 to {last}", actual=index)
    covered = orders[0] >= 0 and orders[-1] < len(sequence)
    require(
        covered,
        "sequence",
        expected=f"long enough for orders {orders[0]} to {orders[-1]}",
        actual=f"{len(sequence)} entries",
    )


def _check_staircase(stair: Staircase, extent: int) -> None:
    _check_period(stair.period_px)
    _check_shifts(stair.shifts_rad)
    _check_cells("period_px", stair.period_px, extent=extent, per_cell=2)
    orders = fringe_orders(extent, stair.period_px)
    require(
        stair.levels >= len(orders),
        "levels",
        expected=f"at least {len(orders)}, one per fringe order 0 to {orders[-1]}",
        actual=stair.levels,
    )


def _check_colour(colour: Colour, extent: int) -> None:
    _check_period(colour.period_px)
    _check_cells("period_px", colour.period_px, extent=extent, per_cell=2)
    require(bool(colour.palette), "palette", expected="one colour at least", actual="none")
    for name in colour.palette:
        parse_colour(name)
