"""The fused pass up to the coordinate: sinusoids, Gray code, the chain to the finest fringes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.demodulate import fit_tile
from fringeworks.kernels.fused_nouns import (
    HIGHER,
    LEVEL,
    LOWER,
    MARGIN,
    NEAR,
    REFERENCE,
    SATURATED,
    VOID,
    Carrier,
    Code,
    Rules,
    Work,
)
from fringeworks.kernels.orders import coordinate_of, margin_of, order_of
from fringeworks.kernels.tile import (
    FIT_SLOTS,
    NAN,
    OFFSET,
    PHASE,
    TILE,
    Floats,
    Place,
    Three,
    append_bits,
    bound_by_noise,
    clear,
    judge_tile,
)

PI = np.float32(math.pi)
HALF = np.float32(0.5)
BYTE_BITS = 8
BYTE = np.float32(1 << BYTE_BITS)


@kernel
def demodulate_all(carriers: tuple[Carrier, ...], place: Place, rules: Rules, work: Work) -> None:
    """Phase and sigma of every carrier, and of every pixel the last rule broken."""
    void = work.marks[VOID : VOID + TILE]
    clear(place[2], void)
    for m in range(len(carriers)):
        carrier = carriers[m]
        fit = (carrier.basis, carrier.solve, carrier.covariance)
        s = work.fits[m * FIT_SLOTS * TILE : (m + 1) * FIT_SLOTS * TILE]
        saturated = work.marks[SATURATED : SATURATED + TILE]
        fit_tile(carrier.frames, place, fit, rules.saturation, s, saturated)
        judge_tile(place[2], carrier.noise, rules.limits, rules.broken, s, void)


@kernel
def find_levels(code: Code, place: Place, work: Work, intensity: Floats, finest: int) -> None:
    """Half of white and black, where both are shown, and a tile's intensity.

    That is the white frame's, else the offset of the finest fringes.
    """
    i, begin, n = place
    end = begin + n
    level = work.s[LEVEL : LEVEL + TILE]
    if code.white.size > 0 and code.black.size > 0:
        white, black = code.white[i, begin:end], code.black[i, begin:end]
        for j in range(min(n, TILE)):
            level[j] = HALF * (np.float32(white[j]) + np.float32(black[j]))
    seen = intensity[i, begin:end]
    if code.white.size > 0:
        white = code.white[i, begin:end]
        for j in range(min(n, TILE)):
            seen[j] = white[j]
    else:
        offset = work.fits[finest * FIT_SLOTS * TILE + OFFSET :]
        for j in range(min(n, TILE)):
            seen[j] = offset[j]


@kernel
def start_at(start_px: np.float32, n: int, s: Floats) -> None:
    """One reference coordinate for all pixels of a tile."""
    for j in range(min(n, TILE)):
        s[REFERENCE + j] = start_px


@kernel
def read_code(code: Code, place: Place, noise: Three, work: Work) -> None:
    """Centre of each pixel's cell, px; NaN outside the projector, and for two bits in doubt."""
    s, n, count = work.s, place[2], code.bits.shape[0]
    near, higher = work.marks[NEAR : NEAR + TILE], work.marks[HIGHER : HIGHER + TILE]
    lower, sigmas = work.marks[LOWER : LOWER + TILE], np.float32(code.doubt_sigmas)
    if code.white.size > 0 and code.black.size > 0:
        bound_by_noise(n, s[LEVEL : LEVEL + TILE], noise, sigmas, work.bounds)
    else:
        bound_by_noise(n, work.fits[OFFSET : OFFSET + TILE], noise, sigmas, work.bounds)
    clear(n, near)
    clear(n, higher)
    clear(n, lower)
    further = max(count - BYTE_BITS, 0)
    if further > 0:
        append_bits(code.bits, place, (0, further), work.bounds, higher, near)
        for j in range(min(n, TILE)):
            lower[j] = higher[j]  # the next bit goes by the one before it
    append_bits(code.bits, place, (further, count), work.bounds, lower, near)
    code_px, cells = np.float32(code.code_px), np.float32(code.cells)
    for j in range(min(n, TILE)):
        index = np.float32(higher[j]) * BYTE + np.float32(lower[j])
        centre = (index + HALF) * code_px - HALF
        s[REFERENCE + j] = NAN if index >= cells or near[j] >= np.uint8(2) else centre


@kernel
def follow_chain(
    carriers: tuple[Carrier, ...], chain: NDArray[np.int64], n: int, work: Work
) -> None:
    """Coordinate of the chain's last carrier, px, and the least margin of all steps."""
    for step in range(chain.size):
        phase = work.fits[chain[step] * FIT_SLOTS * TILE + PHASE :]
        take_step(phase, carriers[chain[step]].fringe, n, step == 0, work.s)


@kernel
def take_step(phase: Floats, fringe: tuple[float, float], n: int, first: bool, s: Floats) -> None:
    """One step of a chain: the coordinate becomes the reference of the next."""
    period, zero, per_px = np.float32(fringe[0]), np.float32(fringe[1]), np.float32(1 / fringe[0])
    if first:
        for j in range(min(n, TILE)):
            k = order_of(s[REFERENCE + j], phase[j], zero, per_px)
            at = coordinate_of(phase[j], k, period, zero)
            s[MARGIN + j] = margin_of(s[REFERENCE + j], at, per_px)
            s[REFERENCE + j] = at
    else:
        for j in range(min(n, TILE)):
            k = order_of(s[REFERENCE + j], phase[j], zero, per_px)
            at = coordinate_of(phase[j], k, period, zero)
            margin = margin_of(s[REFERENCE + j], at, per_px)
            s[MARGIN + j] = margin if margin < s[MARGIN + j] else s[MARGIN + j]
            s[REFERENCE + j] = at


@kernel
def void_coordinates(
    code: Code, rules: Rules, n: int, sigma: tuple[Floats, np.float32], work: Work
) -> None:
    """Make coordinates NaN outside the projector's image, and where noise decides the order.

    See `phase.decode` and `phase.chained`. `sigma` is the phase's, rad, and px per rad.
    """
    s, (of_phase, per_rad) = work.s, sigma
    middle, half = np.float32(rules.middle_px), np.float32(rules.half_px)
    outside = np.float32(rules.outside_sigmas)
    for j in range(min(n, TILE)):
        beyond = abs(s[REFERENCE + j] - middle) - half
        good = beyond <= outside * (of_phase[j] * per_rad)
        s[REFERENCE + j] = s[REFERENCE + j] if good else NAN
    if code.bits.shape[0] == 0:
        return
    near = work.marks[NEAR : NEAR + TILE]
    safe, sigmas = np.float32(code.safe_margin), np.float32(code.safe_sigmas)
    for j in range(min(n, TILE)):
        at_edge = near[j] == np.uint8(1) and s[MARGIN + j] < safe
        doubtful = at_edge or s[MARGIN + j] * PI < sigmas * of_phase[j]
        s[REFERENCE + j] = NAN if doubtful else s[REFERENCE + j]
