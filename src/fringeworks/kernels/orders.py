"""Codes and reference phases: where along the projector axis a pixel's light comes from."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import Real, kernel
from fringeworks.kernels.tile import BOUND_SLOTS, TILE, Images, append_bits, bound_levels

Floats = NDArray[np.float32]

TWO_PI = 2 * math.pi
PER_TURN = np.float32(1 / TWO_PI)
ONE = np.float32(1)


@kernel
def gray_index(
    bits: Images,
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
    bounds, level = np.empty(BOUND_SLOTS * TILE, bits.dtype), np.empty(TILE, np.float32)
    for i in range(height):
        for begin in range(0, width, TILE):
            n = min(TILE, width - begin)
            end = begin + n
            near, code = doubt[i, begin:end], index[i, begin:end]
            for m in range(count):
                if m < threshold.shape[0]:
                    level[:n] = threshold[m, i, begin:end]
                    bound_levels(n, level, near, bounds)
                place, found = (i, begin, n), doubtful[i, begin:end]
                append_bits(bits, place, (m, m + 1), bounds, code, found)


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
def order_of(reference_px: Real, phase: Real, zero_px: Real, per_px: Real) -> Real:
    """The one unwrapping formula: ``k = round((Phi_ref - phi) / 2 pi)``; `per_px` is 1 / period."""
    return np.rint((reference_px - zero_px) * per_px - phase * PER_TURN)


@kernel
def coordinate_of(phase: Real, order: Real, period_px: Real, zero_px: Real) -> Real:
    """Coordinate, px, of an absolute phase: ``zero + P (phi / 2 pi + k)``."""
    return (zero_px + period_px * order) + period_px * (phase * PER_TURN)


@kernel
def margin_of(reference_px: Real, coordinate_px: Real, per_px: Real) -> Real:
    """How far a reference stays from the next order: ``1 - |Phi_ref - Phi| / pi``."""
    return ONE - abs(reference_px - coordinate_px) * (per_px + per_px)


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
    one_for_all = reference_px.size == 1
    for i in range(phase.shape[0]):
        reference = reference_px[0] if one_for_all else reference_px[i]
        unwrap_row(phase[i], reference, (period_px, zero_px), coordinate[i], order[i], margin[i])


@kernel
def unwrap_row(
    phase: Floats,
    reference_px: Floats,
    fringe: tuple[float, float],
    coordinate: Floats,
    order: NDArray[np.int32],
    margin: Floats,
) -> None:
    """`unwrap` of pixels ``(n,)``; `reference_px` may be ``(1,)``. `fringe` is period and zero."""
    period, zero = np.float32(fringe[0]), np.float32(fringe[1])
    per_px = np.float32(1 / fringe[0])
    one_for_all = reference_px.size == 1
    for j in range(phase.size):
        reference = reference_px[0] if one_for_all else reference_px[j]
        k = order_of(reference, phase[j], zero, per_px)
        at = coordinate_of(phase[j], k, period, zero)
        coordinate[j] = at
        order[j] = np.int32(k) if at == at else np.int32(-1)
        margin[j] = margin_of(reference, at, per_px)


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
    period, zero = np.float32(period_px), np.float32(zero_px)
    for i in range(height):
        for j in range(width):
            at = coordinate_of(phase[i, j], np.float32(order[i, j]), period, zero)
            coordinate[i, j] = at if margin[i, j] == margin[i, j] else math.nan
