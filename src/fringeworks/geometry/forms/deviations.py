"""How far points lie from the form that was fitted to them: one home of each number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rms_per_freedom(deviations: Array, *, parameters: int) -> float:
    """Root mean square of deviations ``(n,)`` over n less the number of fitted parameters."""
    freedom = max(len(deviations) - parameters, 1)
    return float(np.sqrt(np.sum(deviations**2) / freedom))


def range_of(deviations: Array) -> float:
    """Largest less smallest deviation: grows with the number of points by noise alone."""
    return float(np.ptp(deviations))


def band95_of(deviations: Array) -> float:
    """Width between the 2.5 % and 97.5 % quantiles (ISO 10360-13's manner)."""
    low, high = np.quantile(deviations, [0.025, 0.975])
    return float(high - low)
