"""Whether a value keeps a limit, when neither is known exactly (ISO 14253-1).

Who has to prove conformance takes the uncertainty U off the limit; nonconformance is proven only
beyond the limit and U. In between nothing is proven.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

Decision: TypeAlias = Literal["conforms", "undecided", "fails"]


def decide(value_mm: float, limit_mm: float, u95_mm: float) -> Decision:
    """What is proven of a signed value against a limit of its size, both mm."""
    if abs(value_mm) <= limit_mm - u95_mm:
        return "conforms"
    return "fails" if abs(value_mm) > limit_mm + u95_mm else "undecided"
