"""Phase shifting: the least-squares sinusoid of each pixel.

A frame is ``I_n = A + C cos d_n + S sin d_n`` with C = B cos Phi, S = B sin Phi (methods page,
Demodulation). Rows are worked in buffers that stay in the first cache; the loops over a row
vectorise. Pixels with saturated frames are solved one by one from the frames that are left.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.arctangent import arctangent
from fringeworks.kernels.compiled import kernel

Floats = NDArray[np.float32]

ROOT_3 = np.float32(math.sqrt(3))
TWO = np.float32(2)
ZERO = np.float32(0)
NAN = np.float32(math.nan)
WELL_POSED = 1e-3
"""Smallest determinant of the normal matrix, per frame cubed, that is solved."""


@kernel
def wrap_three_steps(frames: NDArray[np.generic], phase: Floats) -> None:
    """Equation (10) of the paper alone: phase of frames shifted by 120, 0 and -120 degrees."""
    _, height, width = frames.shape
    for i in range(height):
        first, second, third, out = frames[0, i], frames[1, i], frames[2, i], phase[i]
        for j in range(width):
            a, b, c = np.float32(first[j]), np.float32(second[j]), np.float32(third[j])
            out[j] = arctangent(ROOT_3 * (a - c), TWO * b - a - c)


@kernel
def _accumulate_row(
    row: NDArray[np.generic], solve: Floats, saturation: float, sums: Floats
) -> int:
    """Sums A, C, S and the count of saturated frames (``sums``, (4, W)) of one image row."""
    frames, width = row.shape
    limit, one, zero = np.float32(saturation), np.float32(1), np.float32(0)
    offset, cosine, sine, saturated = sums[0], sums[1], sums[2], sums[3]
    sums[:] = zero
    for n in range(frames):
        to_offset, to_cosine, to_sine = solve[0, n], solve[1, n], solve[2, n]
        image = row[n]
        for j in range(width):
            grey = np.float32(image[j])
            offset[j] += to_offset * grey
            cosine[j] += to_cosine * grey
            sine[j] += to_sine * grey
            saturated[j] += one if grey >= limit else zero
    total = zero
    for j in range(width):
        total += saturated[j]
    return int(total)


@kernel
def _residual_row(row: NDArray[np.generic], basis: Floats, sums: Floats, residual: Floats) -> None:
    """Root mean square per degree of freedom of what the fit of one row leaves."""
    frames, width = row.shape
    residual[:] = np.float32(0) if frames > 3 else NAN
    if frames <= 3:
        return
    offset, cosine, sine = sums[0], sums[1], sums[2]
    for n in range(frames):
        of_cosine, of_sine = basis[n, 1], basis[n, 2]
        image = row[n]
        for j in range(width):
            left = np.float32(image[j]) - offset[j] - of_cosine * cosine[j] - of_sine * sine[j]
            residual[j] += left * left
    per_freedom = np.float32(1 / (frames - 3))
    for j in range(width):
        residual[j] = np.sqrt(residual[j] * per_freedom)


@kernel
def _solve_unsaturated(
    grey: NDArray[np.generic], basis: Floats, saturation: float, fit: NDArray[np.float64]
) -> bool:
    """Put A, C, S, residual and the covariances cc, cs, ss of the frames below saturation in `fit`.

    False where fewer than three such frames are left or they do not determine the sinusoid.
    """
    m00, m01, m02, m11, m12, m22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    b0, b1, b2 = 0.0, 0.0, 0.0
    for n in range(grey.shape[0]):
        value = float(grey[n])
        if value < saturation:
            c, s = float(basis[n, 1]), float(basis[n, 2])
            m00, m01, m02 = m00 + 1, m01 + c, m02 + s
            m11, m12, m22 = m11 + c * c, m12 + c * s, m22 + s * s
            b0, b1, b2 = b0 + value, b1 + value * c, b2 + value * s
    i00, i01, i02 = m11 * m22 - m12 * m12, m02 * m12 - m01 * m22, m01 * m12 - m02 * m11
    i11, i12, i22 = m00 * m22 - m02 * m02, m01 * m02 - m00 * m12, m00 * m11 - m01 * m01
    det = m00 * i00 + m01 * i01 + m02 * i02
    if m00 < 3 or det < WELL_POSED * m00**3:
        return False
    a = (i00 * b0 + i01 * b1 + i02 * b2) / det
    c_part = (i01 * b0 + i11 * b1 + i12 * b2) / det
    s_part = (i02 * b0 + i12 * b1 + i22 * b2) / det
    left = 0.0
    for n in range(grey.shape[0]):
        value = float(grey[n])
        if value < saturation:
            left += (value - a - c_part * basis[n, 1] - s_part * basis[n, 2]) ** 2
    fit[0], fit[1], fit[2] = a, c_part, s_part
    fit[3] = math.sqrt(left / (m00 - 3)) if m00 > 3 else math.nan
    fit[4], fit[5], fit[6] = i11 / det, i12 / det, i22 / det
    return True


@kernel
def _spread(
    c: np.float32, s: np.float32, cc: np.float32, cs: np.float32, ss: np.float32
) -> np.float32:
    """Standard deviation of the phase, rad, per grey level of noise, from covariance of C, S.

    NaN where C = S = 0: no modulation has no phase.
    """
    square = c * c + s * s
    across = cc * s * s - TWO * cs * s * c + ss * c * c
    return np.float32(np.sqrt(max(across, ZERO)) / square)


@kernel
def demodulate(
    frames: NDArray[np.generic],
    basis: Floats,
    solve: Floats,
    covariance: Floats,
    saturation: float,
    phase: Floats,
    offset: Floats,
    modulation: Floats,
    residual: Floats,
    spread: Floats,
) -> None:
    """Fill the five ``(H, W)`` outputs from frames ``(N, H, W)``.

    `basis` is ``(N, 3)``: 1, cos d_n, sin d_n; `solve` its pseudo-inverse; `covariance` the
    elements cc, cs, ss of its inverse normal matrix. `phase` is NaN where saturation leaves
    fewer than three frames; `residual` is NaN where only three are used.
    """
    _, height, width = frames.shape
    sums = np.empty((4, width), np.float32)
    fit = np.empty(7)
    cc, cs, ss = covariance[0], covariance[1], covariance[2]
    for i in range(height):
        row = frames[:, i]
        saturated = _accumulate_row(row, solve, saturation, sums)
        _residual_row(row, basis, sums, residual[i])
        for j in range(width):
            c, s = sums[1, j], sums[2, j]
            phase[i, j] = arctangent(s, c)
            offset[i, j] = sums[0, j]
            modulation[i, j] = np.sqrt(c * c + s * s)
            spread[i, j] = _spread(c, s, cc, cs, ss)
        if saturated == 0:
            continue
        for j in range(width):
            if sums[3, j] == 0:
                continue
            if not _solve_unsaturated(row[:, j], basis, saturation, fit):
                phase[i, j] = NAN
                continue
            phase[i, j] = arctangent(np.float32(fit[2]), np.float32(fit[1]))
            offset[i, j], modulation[i, j] = fit[0], math.hypot(fit[1], fit[2])
            residual[i, j] = fit[3]
            spread[i, j] = _spread(
                np.float32(fit[1]),
                np.float32(fit[2]),
                np.float32(fit[4]),
                np.float32(fit[5]),
                np.float32(fit[6]),
            )


@kernel
def apply_rules(
    phase: Floats,
    spread: Floats,
    offset: Floats,
    modulation: Floats,
    residual: Floats,
    noise: tuple[float, float, float],
    limits: tuple[float, float, float],
    broken: tuple[int, int, int],
    void: NDArray[np.uint8],
) -> None:
    """Turn `spread` into sigma of the phase, and void pixels of both into NaN; all ``(H, W)``.

    `noise` is read, gain and black level: its variance is ``read^2 + gain * signal``. `limits`
    are the least modulation in grey levels and in sigma, and the largest residual in sigma.
    `broken` are the marks of a pixel with no phase, too little modulation, too large a residual;
    `void`, which starts at zero, gets the first that holds.
    """
    height, width = phase.shape
    variance, gain = np.float32(noise[0] ** 2), np.float32(noise[1])
    black = np.float32(noise[2])
    least, in_sigmas, most = np.float32(limits[0]), np.float32(limits[1]), np.float32(limits[2])
    saturated, dim, misfit = np.uint8(broken[0]), np.uint8(broken[1]), np.uint8(broken[2])
    for i in range(height):
        phi, of_phase, grey = phase[i], spread[i], offset[i]
        contrast, left, mark = modulation[i], residual[i], void[i]
        for j in range(width):
            sigma = np.sqrt(variance + gain * max(grey[j] - black, ZERO))
            rule = misfit if left[j] > most * sigma else mark[j]
            rule = dim if contrast[j] < max(least, in_sigmas * sigma) else rule
            rule = rule if phi[j] == phi[j] else saturated
            mark[j] = rule
            of_phase[j] = NAN if rule else of_phase[j] * sigma
            phi[j] = NAN if rule else phi[j]
