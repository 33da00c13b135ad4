"""Phase shifting: the least-squares sinusoid of each pixel.

A frame is ``I_n = A + C cos d_n + S sin d_n`` with C = B cos Phi, S = B sin Phi (methods page,
Demodulation). What is done to a pixel is in `tile`. Pixels with saturated frames are solved one by
one from the frames that are left.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.arctangent import arctangent
from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.tile import (
    FIT_SLOTS,
    MODULATION,
    NAN,
    OFFSET,
    PHASE,
    RESIDUAL,
    SPREAD,
    TILE,
    Images,
    Place,
    angle_tile,
    find_saturated,
    noise_of,
    residual_tile,
    rule_of,
    spread_of,
    sum_tile,
)

Floats = NDArray[np.float32]

ROOT_3 = np.float32(math.sqrt(3))
TWO = np.float32(2)
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
def fit_tile(
    frames: Images,
    place: Place,
    fit: tuple[Floats, Floats, Floats],
    saturation: float,
    s: Floats,
    saturated: NDArray[np.uint8],
) -> None:
    """The sinusoid of every pixel of a tile into the slots of `s`.

    `fit` is basis, solve and covariance as `demodulate` takes them; `saturated` tells of which
    pixels some frames are.
    """
    basis, solve, covariance = fit
    i, begin, n = place
    sum_tile(frames, place, solve, s)
    residual_tile(frames, place, basis, s)
    angle_tile(n, covariance, s)
    if find_saturated(frames, place, saturation, saturated):
        for j in range(n):
            if saturated[j] > 0:
                _fit_the_rest(frames[:, i, begin + j], basis, saturation, s[j:])


@kernel
def _fit_the_rest(grey: NDArray[np.generic], basis: Floats, saturation: float, s: Floats) -> None:
    """The pixel at the start of `s` from its frames below saturation; NaN where they are few."""
    fit = np.empty(7)
    if len(grey) == 3 or not _solve_unsaturated(grey, basis, saturation, fit):
        s[PHASE] = NAN
        return
    c, up = np.float32(fit[1]), np.float32(fit[2])
    s[PHASE], s[OFFSET], s[RESIDUAL] = arctangent(up, c), fit[0], fit[3]
    s[MODULATION] = math.hypot(fit[1], fit[2])
    s[SPREAD] = spread_of(c, up, np.float32(fit[4]), np.float32(fit[5]), np.float32(fit[6]))


@kernel
def demodulate(
    frames: Images,
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
    s, saturated = np.empty(FIT_SLOTS * TILE, np.float32), np.empty(TILE, np.uint8)
    for i in range(height):
        for begin in range(0, width, TILE):
            n = min(TILE, width - begin)
            end = begin + n
            fit_tile(frames, (i, begin, n), (basis, solve, covariance), saturation, s, saturated)
            phase[i, begin:end] = s[PHASE : PHASE + n]
            offset[i, begin:end] = s[OFFSET : OFFSET + n]
            modulation[i, begin:end] = s[MODULATION : MODULATION + n]
            residual[i, begin:end] = s[RESIDUAL : RESIDUAL + n]
            spread[i, begin:end] = s[SPREAD : SPREAD + n]


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
    variance, gain, black = np.float32(noise[0] ** 2), np.float32(noise[1]), np.float32(noise[2])
    most = (np.float32(limits[0]), np.float32(limits[1]), np.float32(limits[2]))
    marks = (np.uint8(broken[0]), np.uint8(broken[1]), np.uint8(broken[2]))
    for i in range(phase.shape[0]):
        phi, of_phase, grey = phase[i], spread[i], offset[i]
        contrast, left, mark = modulation[i], residual[i], void[i]
        for j in range(phi.size):
            sigma = noise_of(grey[j], variance, gain, black)
            rule = rule_of(phi[j], contrast[j], left[j], sigma, most, marks)
            mark[j] = rule if rule else mark[j]
            of_phase[j] = NAN if rule else of_phase[j] * sigma
            phi[j] = NAN if rule else phi[j]
