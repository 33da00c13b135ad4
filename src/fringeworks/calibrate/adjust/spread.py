"""By how much observations scatter: what they say themselves, mended by the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.local_fit import MAD_TO_SIGMA

Array = NDArray[np.float64]

SMALLEST_SIGMA_PX = 1e-4
SAME_SPREAD = 1e-3


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations of a coordinate, px, that the residuals showed, robust.

    `together` says how far neighbouring sites err alike: the variance of their means over
    sixteenths of the board, over what it were if each erred by itself; one at least.
    """

    camera: float
    projector: float
    sites: float
    together: float

    def near(self, other: Spread) -> bool:
        """Whether solving again with the one's weights in place of the other's changes nothing."""
        mine, others = astuple(self), astuple(other)
        return all(abs(a - b) < SAME_SPREAD * b for a, b in zip(mine, others, strict=True))


def robust_sigma(residuals: Array) -> float:
    """Standard deviation of a coordinate by its median absolute residual, px."""
    return max(MAD_TO_SIGMA * float(np.median(np.abs(residuals))), SMALLEST_SIGMA_PX)


def total_sigma(own: Sequence[Array], shown: float) -> list[Array]:
    """Standard deviations of a class, px: what each observation says, mended by the residuals.

    The variance is the observation's own plus what the residuals show beyond the median of
    those: where the board's print dominates, all corners weigh the same. Where they show less,
    the observations' own are scaled down: else Huber's bound would be too far.
    """
    typical = float(np.median(np.concatenate(own)))
    scale, excess = min(shown / typical, 1.0), max(shown**2 - typical**2, 0)
    return [np.sqrt((part * scale) ** 2 + excess) for part in own]
