"""How far the Gray bits stay from their threshold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fringeworks.diagnose.look import Look, codes_in_light, name_of
from fringeworks.diagnose.suspicion import Suspicion, wrong_order_px
from fringeworks.model import Capture

LEAST_LEVEL = 0.75
"""Median level of the lit bits, 0 black and 1 white; and one less that of the dark ones."""

NARROWEST_PX = 8.0
"""Stripes below it are blurred, and say nothing of the light."""

NEAR = 0.15
"""Levels this near the threshold are anyone's guess."""

LEAST_SIDE = 0.1
"""Of the pixels that must lie on either side: fewer look across a stripe's edge."""


def find_margin(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Codes whose bits are neither as light as white nor as dark as black."""
    period = max((look.fringe.period_px for look in looks), default=1.0)
    for place, code, black, contrast, lit in codes_in_light(capture):
        wide = [n for n in range(code.bits) if code.cell_px * 2 ** (code.bits - n) >= NARROWEST_PX]
        if not wide:
            continue
        level = (capture.frames[place][wide].astype(np.float32) - black) / np.maximum(contrast, 1)
        seen = np.asarray(level[:, lit], np.float32)
        light, dark = _levels(seen)
        if light > LEAST_LEVEL and dark < 1 - LEAST_LEVEL:
            continue
        near = np.abs(level - 0.5).min(axis=0)
        share = float(np.mean(near[lit] < NEAR))
        yield Suspicion(
            "gray margin",
            wrong_order_px(share, period),
            f"the bits of the {name_of(code)} lie at {dark:.0%} and {light:.0%} between the black "
            f"and the white frame, not at 0% and 100%: {share:.0%} of the pixels are near the "
            "threshold in some bit.",
            "Take white, black and code with one exposure and the same light, or show the inverted "
            "bits too (patterns --inverted).",
            f"set {place + 1}, {name_of(code)}",
            np.where(lit, near, np.nan).astype(np.float32),
            "least distance of a bit from its threshold",
        )


def _levels(seen: np.ndarray[tuple[int, int], np.dtype[np.float32]]) -> tuple[float, float]:
    """Lowest median of the light bits and highest of the dark ones, over all bits."""
    light, dark = 1.0, 0.0
    for bit in seen:
        split = 0.5 * (np.percentile(bit, 2) + np.percentile(bit, 98))
        above, below = bit[bit > split], bit[bit <= split]
        few = min(len(above), len(below)) < LEAST_SIDE * len(bit)
        if few or np.ptp(np.percentile(bit, (2, 98))) < 0.2:
            continue
        light = min(light, float(np.median(above)))
        dark = max(dark, float(np.median(below)))
    return light, dark
