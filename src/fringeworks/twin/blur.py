"""Point spreads with exactly the variance asked for, however narrow."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Image: TypeAlias = NDArray[np.float32]

SIGMAS_KEPT = 6.0
LEAST_RADIUS = 4
"""Narrow kernels fall off like ``(t / 2)^n / n!``, more slowly than six sigmas say."""


def discrete_gaussian(variance: float) -> NDArray[np.float64]:
    """Weights ``exp(-t) I_n(t)``, n = -r .. r, of variance t, samples squared; their sum is one.

    Lindeberg's discrete Gaussian (1990): unlike a sampled one its variance is t for every t, and
    two of them after each other have the sum of both.
    """
    from scipy.special import ive

    radius = math.ceil(SIGMAS_KEPT * math.sqrt(variance)) + LEAST_RADIUS
    weights = ive(np.abs(np.arange(-radius, radius + 1)), variance)
    return np.asarray(weights / weights.sum())


def blur(image: Image, *, across: float, down: float) -> Image:
    """Image ``(H, W)`` spread with these variances, samples squared; its edge is continued."""
    import cv2

    if across <= 0 and down <= 0:
        return image
    kernel_x, kernel_y = (discrete_gaussian(max(variance, 0.0)) for variance in (across, down))
    blurred: NDArray[Any] = cv2.sepFilter2D(
        image, -1, kernel_x, kernel_y, borderType=cv2.BORDER_REPLICATE
    )
    return blurred.astype(np.float32, copy=False)
