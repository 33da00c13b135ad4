"""A sequence shown again at every one of several exposures, for scenes of bright and dark parts."""

from __future__ import annotations

import math
from dataclasses import replace

from fringeworks.model import Sequence
from fringeworks.patterns.checks import require


def expose_repeatedly(sequence: Sequence, exposures_ms: tuple[float, ...]) -> Sequence:
    """All sets of a sequence at the first exposure, then all at the next; ms.

    A camera changes its exposure once for each. In colour a cloud is that of the first.

    Raises
    ------
    UsageError
        There is no exposure, two are equal, or one is not above zero.
    """
    usable = all(0 < exposure_ms < math.inf for exposure_ms in exposures_ms)
    distinct = len(set(exposures_ms)) == len(exposures_ms) > 0
    require(
        usable and distinct,
        "exposures",
        expected="one or more different times above 0 ms",
        actual=", ".join(f"{exposure_ms:g}" for exposure_ms in exposures_ms) or "none",
    )
    sets = tuple(
        replace(item, exposure_ms=exposure_ms)
        for exposure_ms in exposures_ms
        for item in sequence.sets
    )
    return replace(sequence, sets=sets)
