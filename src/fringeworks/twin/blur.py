"""Point spreads with exactly the variance asked for, however narrow."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Image: TypeAlias = NDArray[np.float32]

SIGMAS_KEPT = 6.0
NARROWEST = 0.01
"""A Gaussian of this variance has nothing left at its next sample."""

LEAST_VARIANCE = 1e-12
"""Below this, and where its Gaussian would be narrower than `NARROWEST`, nothing is blurred."""


@lru_cache(maxsize=64)
def discrete_gaussian(variance: float) -> NDArray[np.float64]:
    """Weights of samples -r .. r of a Gaussian, whose own variance is the one asked for.

    Samples of a Gaussian of that very variance have a smaller one where it is below one sample
    squared; a slightly wider one is sampled in its place. The contrast that is passed is a
    Gaussian's up to the highest frequencies, and variances of two in a row add.
    """
    from scipy.optimize import brentq

    if variance < LEAST_VARIANCE:
        return np.ones(1)
    places = np.arange(-(reach := math.ceil(SIGMAS_KEPT * math.sqrt(variance + 0.25))), reach + 1)

    def excess(wider: float) -> float:
        return float(_sampled(places, wider) @ places**2) - variance

    return _sampled(places, float(brentq(excess, NARROWEST, variance + 0.25, xtol=1e-14)))


def _sampled(places: NDArray[np.int64], variance: float) -> NDArray[np.float64]:
    weights = np.exp(-(places**2) / (2 * variance))
    return np.asarray(weights / weights.sum())


def blur(image: Image, *, across: float, down: float) -> Image:
    """Image ``(H, W)`` spread with these variances, samples squared; its edge is continued."""
    import cv2

    if across <= 0 and down <= 0:
        return image
    kernel_x, kernel_y = (discrete_gaussian(max(float(v), 0.0)) for v in (across, down))
    blurred: NDArray[Any] = cv2.sepFilter2D(
        image, -1, kernel_x, kernel_y, borderType=cv2.BORDER_REPLICATE
    )
    return blurred.astype(np.float32, copy=False)
