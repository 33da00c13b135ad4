"""Codes and reference phases: where along the projector axis a pixel's light comes from."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Floats = NDArray[np.float32]

TWO_PI = 2 * math.pi


@kernel
def gray_index(
    bits: NDArray[np.generic],
    threshold: NDArray[np.generic],
    doubt: Floats,
    index: NDArray[np.int32],
    doubtful: NDArray[np.uint8],
) -> None:
    """Index of a reflected binary code, most significant bit first, appended to `index`.

    Parameters
    ----------
    bits
        ``(n, H, W)`` grey levels. A bit is one where it is brighter than its threshold.
    threshold
        ``(n, H, W)``, or ``(1, H, W)`` for all bits.
    doubt
        ``(H, W)`` grey levels: a bit this near its threshold, or nearer, is doubtful.
    index
        ``(H, W)``, starts at zero, or at the index of the bits before these.
    doubtful
        ``(H, W)`` count of doubtful bits, added to.
    """
    count, height, width = bits.shape
    for i in range(height):
        code, near, limit = index[i], doubtful[i], doubt[i]
        for n in range(count):
            image, level = bits[n, i], threshold[min(n, threshold.shape[0] - 1), i]
            for j in range(width):
                above = np.float32(image[j]) - np.float32(level[j])
                code[j] = (code[j] << 1) | (np.int32(above > 0) ^ (code[j] & 1))
                near[j] += np.uint8(abs(above) <= limit[j])


@kernel
def combine_phases(
    phases: NDArray[np.float32], weights: NDArray[np.float64], combined: Floats
) -> None:
    """Wrapped sum of ``weights[n] * phases[n]``, rad, in [-pi, pi]: the phase of a beat."""
    count, height, width = phases.shape
    for i in range(height):
        for j in range(width):
            total = 0.0
            for n in range(count):
                total += weights[n] * phases[n, i, j]
            combined[i, j] = total - TWO_PI * np.rint(total / TWO_PI)


@kernel
def order_of(reference_px: float, phase: float, period_px: float, zero_px: float) -> float:
    """The one unwrapping formula: ``k = round((Phi_ref - phi) / 2 pi)``."""
    return float(np.rint((reference_px - zero_px) / period_px - phase / TWO_PI))


@kernel
def unwrap(
    phase: Floats,
    reference_px: NDArray[np.float32],
    period_px: float,
    zero_px: float,
    coordinate: Floats,
    order: NDArray[np.int32],
    margin: Floats,
) -> None:
    """Coordinate, px, order and margin of each pixel from a reference coordinate.

    `reference_px` is ``(H, W)``, or ``(1, 1)`` where one reference serves all pixels. A pixel
    whose phase or reference is NaN gets NaN, -1, NaN. The order is right where the reference is
    within half a period of the truth; `margin` is 1 - |Phi_ref - Phi| / pi.
    """
    height, width = phase.shape
    one_for_all = reference_px.size == 1
    for i in range(height):
        for j in range(width):
            reference = reference_px[0, 0] if one_for_all else reference_px[i, j]
            phi = phase[i, j]
            k = order_of(reference, phi, period_px, zero_px)
            at = zero_px + period_px * (phi / TWO_PI + k)
            coordinate[i, j] = at
            order[i, j] = -1 if math.isnan(at) else int(k)
            margin[i, j] = 1 - abs(reference - at) / (period_px / 2)


@kernel
def place(
    phase: Floats,
    order: NDArray[np.int32],
    margin: Floats,
    period_px: float,
    zero_px: float,
    coordinate: Floats,
) -> None:
    """Coordinate, px, of absolute phases ``(H, W)``; NaN where the margin is."""
    height, width = phase.shape
    for i in range(height):
        for j in range(width):
            at = zero_px + period_px * (phase[i, j] / TWO_PI + order[i, j])
            coordinate[i, j] = at if margin[i, j] == margin[i, j] else math.nan
