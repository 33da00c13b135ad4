"""One pattern shown at several exposures: its grey levels on the scale of one of them.

Light above black level grows with the exposure, so that ``black + (I - black) t_ref / t`` is what
an exposure t_ref would have shown, had the camera no full scale.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def extrapolate(
    level: NDArray[np.floating] | float, ratio: float, black_level: float
) -> NDArray[np.float32]:
    """Grey levels at an exposure `ratio` times as long; any shape."""
    return np.asarray(black_level + (level - np.float32(black_level)) * ratio, np.float32)


def compose_levels(
    images: Sequence[tuple[float, NDArray[np.number]]],
    *,
    black_level: float,
    saturation: float,
    reference_ms: float,
) -> NDArray[np.float32]:
    """Mean ``(H, W)`` of one pattern, grey levels of the exposure `reference_ms`.

    Each pixel is from the longest exposure at which none of its images is saturated; where all
    are, from the shortest: its level is then the least that it can be.

    Parameters
    ----------
    images
        Exposure, ms, and ``(n, H, W)`` grey levels, one entry per exposure.
    black_level, saturation
        Grey levels of the sensor.
    """
    (shortest_ms, first), *longer = sorted(images, key=lambda entry: entry[0])
    level = extrapolate(_mean(first), reference_ms / shortest_ms, black_level)
    for exposure_ms, stack in longer:
        scaled = extrapolate(_mean(stack), reference_ms / exposure_ms, black_level)
        np.copyto(level, scaled, where=stack.max(axis=0) < saturation)
    return level


def _mean(stack: NDArray[np.number]) -> NDArray[np.float32]:
    return np.asarray(stack.mean(axis=0, dtype=np.float32))
