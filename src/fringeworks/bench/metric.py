"""What a benchmark says: a number with its unit and the direction in which it gets better."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Direction: TypeAlias = Literal["higher", "lower", "one"]


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of a benchmark.

    Attributes
    ----------
    key
        Unique within a run: group, subject and quantity, as ``speed.1280x1024.numpy_float64``.
    value
        None where it was not measured; `note` then says why.
    unit
        Unit of the value; ``x`` for a ratio.
    direction
        Which way is better; "one" where that is the nearness to one.
    note
        The bar it must meet, the spread, what a peer does differently.
    """

    key: str
    value: float | None
    unit: str
    direction: Direction
    note: str = ""
