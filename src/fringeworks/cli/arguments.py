"""What is written on a command line, made into values; messages show what is wanted."""

from __future__ import annotations

import math
import re
from typing import Annotated, Literal

import typer

from fringeworks.errors import UsageError

Range = tuple[float, float]


def parse_size(text: str) -> tuple[int, int]:
    """``608x684``: width and height, px."""
    match = re.fullmatch(r"(\d{1,6})\s*[xX×]\s*(\d{1,6})", text.strip())
    if match is None:
        raise UsageError(f"--projector must be WIDTHxHEIGHT in px, as 1920x1080, got '{text}'")
    return int(match[1]), int(match[2])


def parse_ranges(text: str, *, option: str, form: str) -> tuple[Range, ...]:
    """``MIN:MAX,MIN:MAX``: as many ranges as `form` has; an empty end is open."""
    parts = text.split(",")
    if len(parts) != form.count(":"):
        raise UsageError(f"{option} must be {form}, got '{text}'")
    return tuple(_parse_range(part, text, option=option, form=form) for part in parts)


def _parse_range(part: str, whole: str, *, option: str, form: str) -> Range:
    ends = part.split(":")
    try:
        low, high = (
            float(end) if end.strip() else default
            for end, default in zip(ends, (-math.inf, math.inf), strict=True)
        )
    except ValueError:
        raise UsageError(f"{option} must be {form}, got '{whole}'") from None
    if math.isnan(low) or math.isnan(high) or low >= high:
        raise UsageError(f"{option}: each range must rise, got '{part}' in '{whole}'")
    return low, high


def parse_numbers(text: str, *, option: str) -> tuple[float, ...]:
    """``32`` or ``2,3,4``: numbers with commas between them; ``none`` for no number at all."""
    if text.strip().lower() == "none":
        return ()
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = (math.nan,)
    if not all(math.isfinite(number) for number in numbers):
        raise UsageError(
            f"{option} must be numbers with commas between them, or none, got '{text}'"
        )
    return numbers


def require_positive(option: str, value: float) -> None:
    """Refuse a length that is none."""
    if not 0 < value < math.inf:
        raise UsageError(f"{option} must be positive, got {value:g}")


Axis = Literal["x", "y"]

GroupOption = Annotated[
    str | None,
    typer.Option(
        "--group", metavar="NAME", help="Which alternative, where the capture has several groups."
    ),
]
ZRangeOption = Annotated[
    str | None,
    typer.Option(
        "--z-range",
        metavar="MIN:MAX",
        help="Depths to keep, mm, camera frame [default: the rig's volume, 10 % wider].",
    ),
]

Orders = Literal[
    "auto",
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

OrdersOption = Annotated[
    Orders,
    typer.Option(
        "--orders",
        help="What tells the fringe orders; auto takes what the capture holds: a Gray code, else "
        "fringes of several periods, else a staircase, a code frame, colours.",
    ),
]
