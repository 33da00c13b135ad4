"""One tile of an image row: sinusoid, masks and code in scratch memory that stays in the cache.

Maps of a tile are *slots* of one flat array, at distances that are known when the loops are
compiled. So their compiler sees that they do not overlap, needs no checks at run time, and
vectorises loops over any number of them; over separate arrays it gives up at a few.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.arctangent import arctangent
from fringeworks.kernels.compiled import Real, kernel

Floats = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Images = NDArray[np.unsignedinteger[Any]]
Three: TypeAlias = tuple[np.float32, np.float32, np.float32]
Place: TypeAlias = tuple[int, int, int]
"""A tile: its image row, its first column, and how many pixels it has."""

TILE = 2464
"""Pixels; wider images are worked in strips. Slots whose lengths were powers of two would all fall
upon the same places of the cache, and shorter ones pay more for the beginnings of their loops."""

PHASE, OFFSET, MODULATION, RESIDUAL, SPREAD, COSINE, SINE = (n * TILE for n in range(7))
FIT_SLOTS = 7
"""Slots of a fitted sinusoid."""

LOW, HIGH, DARK = (n * TILE for n in range(3))
BOUND_SLOTS = 3
"""Slots of the grey levels that tell a bit, see `bound_levels`."""

ZERO, ONE, TWO = np.float32(0), np.float32(1), np.float32(2)
NAN = np.float32(math.nan)


@kernel
def modulation_of(c: Real, s: Real) -> Real:
    """B of ``C = B cos Phi, S = B sin Phi``."""
    return np.sqrt(c * c + s * s)


@kernel
def spread_of(c: Real, s: Real, cc: Real, cs: Real, ss: Real) -> Real:
    """Standard deviation of the phase, rad, per grey level of noise, from covariance of C, S.

    NaN where C = S = 0: no modulation has no phase.
    """
    square = c * c + s * s
    across = cc * s * s - TWO * cs * s * c + ss * c * c
    return np.sqrt(max(across, ZERO)) / square


@kernel
def even_spread(modulation: Real, root: Real) -> Real:
    """The same where the covariance is `root` squared times the unit matrix: ``root / B``."""
    return root * modulation / (modulation * modulation)


@kernel
def noise_of(grey: Real, variance: Real, gain: Real, black: Real) -> Real:
    """Standard deviation of a grey level: ``sqrt(read^2 + gain * signal)``."""
    return np.sqrt(variance + gain * max(grey - black, ZERO))


@kernel
def rule_of(
    phase: Real,
    modulation: Real,
    residual: Real,
    sigma: Real,
    limits: Three,
    broken: tuple[np.uint8, np.uint8, np.uint8],
) -> np.uint8:
    """The first rule that a pixel breaks; zero for none. See `demodulate.apply_rules`."""
    rule = broken[2] if residual > limits[2] * sigma else np.uint8(0)
    rule = broken[1] if modulation < max(limits[0], limits[1] * sigma) else rule
    return rule if phase == phase else broken[0]


@kernel
def clear(n: int, marks: NDArray[np.integer]) -> None:
    """Zero for a tile's marks; numba's own assignment to a slice takes ten times as long."""
    for j in range(min(n, TILE)):
        marks[j] = 0


@kernel
def sum_tile(frames: Images, place: Place, solve: Floats, s: Floats) -> None:
    """Sums A, C, S of a tile, weighted by `solve`, ``(3, N)``."""
    i, begin, n = place
    end = begin + n
    first, second, third = frames[0, i, begin:end], frames[1, i, begin:end], frames[2, i, begin:end]
    a0, a1, a2 = solve[0, 0], solve[0, 1], solve[0, 2]
    c0, c1, c2 = solve[1, 0], solve[1, 1], solve[1, 2]
    s0, s1, s2 = solve[2, 0], solve[2, 1], solve[2, 2]
    for j in range(min(n, TILE)):
        f, g, h = np.float32(first[j]), np.float32(second[j]), np.float32(third[j])
        s[OFFSET + j] = a0 * f + a1 * g + a2 * h
        s[COSINE + j] = c0 * f + c1 * g + c2 * h
        s[SINE + j] = s0 * f + s1 * g + s2 * h
    for m in range(3, frames.shape[0]):
        image = frames[m, i, begin:end]
        to_offset, to_cosine, to_sine = solve[0, m], solve[1, m], solve[2, m]
        for j in range(min(n, TILE)):
            grey = np.float32(image[j])
            s[OFFSET + j] += to_offset * grey
            s[COSINE + j] += to_cosine * grey
            s[SINE + j] += to_sine * grey


@kernel
def residual_tile(frames: Images, place: Place, basis: Floats, s: Floats) -> None:
    """Root mean square per degree of freedom of what the fit leaves; NaN for three frames."""
    i, begin, n = place
    count = frames.shape[0]
    start = ZERO if count > 3 else NAN
    for j in range(min(n, TILE)):
        s[RESIDUAL + j] = start
    if count <= 3:
        return
    for m in range(count):
        image = frames[m, i, begin : begin + n]
        of_cosine, of_sine = basis[m, 1], basis[m, 2]
        for j in range(min(n, TILE)):
            left = np.float32(image[j]) - s[OFFSET + j]
            left -= of_cosine * s[COSINE + j] + of_sine * s[SINE + j]
            s[RESIDUAL + j] += left * left
    per_freedom = np.float32(1 / (count - 3))
    for j in range(min(n, TILE)):
        s[RESIDUAL + j] = np.sqrt(s[RESIDUAL + j] * per_freedom)


@kernel
def find_saturated(frames: Images, place: Place, saturation: float, some_frame: Bytes) -> bool:
    """Whether any frame of a pixel reaches `saturation`, and whether any of a tile does."""
    i, begin, n = place
    if saturation > np.iinfo(frames.dtype).max:
        return False
    limit = np.uint16(max(math.ceil(saturation), 0))
    clear(n, some_frame)
    some = np.uint8(0)
    for m in range(0, frames.shape[0], 3):
        one = frames[m, i, begin : begin + n]
        two = frames[min(m + 1, frames.shape[0] - 1), i, begin : begin + n]
        three = frames[min(m + 2, frames.shape[0] - 1), i, begin : begin + n]
        for j in range(min(n, TILE)):
            reached = np.uint8(one[j] >= limit)
            reached = np.uint8(reached | (two[j] >= limit))
            some_frame[j] = np.uint8(some_frame[j] | reached | (three[j] >= limit))
    for j in range(min(n, TILE)):
        some = np.uint8(some | some_frame[j])
    return bool(some)


@kernel
def angle_tile(n: int, covariance: Floats, s: Floats) -> None:
    """Phase, modulation and spread of a tile from its sums."""
    cc, cs, ss = covariance[0], covariance[1], covariance[2]
    if cs == ZERO and cc == ss:
        root = np.sqrt(cc)
        for j in range(min(n, TILE)):
            modulation = modulation_of(s[COSINE + j], s[SINE + j])
            s[PHASE + j] = arctangent(s[SINE + j], s[COSINE + j])
            s[MODULATION + j] = modulation
            s[SPREAD + j] = even_spread(modulation, root)
    else:
        for j in range(min(n, TILE)):
            s[PHASE + j] = arctangent(s[SINE + j], s[COSINE + j])
            s[MODULATION + j] = modulation_of(s[COSINE + j], s[SINE + j])
            s[SPREAD + j] = spread_of(s[COSINE + j], s[SINE + j], cc, cs, ss)


@kernel
def judge_tile(
    n: int,
    noise: Three,
    limits: Three,
    broken: tuple[np.uint8, np.uint8, np.uint8],
    s: Floats,
    void: Bytes,
) -> None:
    """Turn a tile's spread into sigma, and both it and the phase into NaN where a rule is broken.

    `noise` is read variance, gain and black level. `void` keeps what it has where none is.
    """
    for j in range(min(n, TILE)):
        sigma = noise_of(s[OFFSET + j], noise[0], noise[1], noise[2])
        rule = rule_of(s[PHASE + j], s[MODULATION + j], s[RESIDUAL + j], sigma, limits, broken)
        s[PHASE + j] = NAN if rule else s[PHASE + j]
        s[SPREAD + j] = NAN if rule else s[SPREAD + j] * sigma
        void[j] = rule if rule else void[j]


@kernel
def bound_levels(n: int, level: Floats, near: Floats, bounds: Images) -> None:
    """Whole grey levels that say the same as a tile's thresholds, `level`, and doubts.

    A grey level is doubtful that is no further than `near` from its threshold. Doubtful ones are
    those from `LOW` to `HIGH`, dark ones those up to `DARK`; where none is doubtful `LOW` is above
    `HIGH`.
    """
    most = np.float32(np.iinfo(bounds.dtype).max)
    for j in range(min(n, TILE)):
        enter_bounds(level[j], near[j], most, bounds, j)


@kernel
def bound_by_noise(n: int, level: Floats, noise: Three, sigmas: Real, bounds: Images) -> None:
    """The same where levels within so many sigma of the noise at the threshold are doubtful."""
    most = np.float32(np.iinfo(bounds.dtype).max)
    for j in range(min(n, TILE)):
        near = sigmas * noise_of(level[j], noise[0], noise[1], noise[2])
        enter_bounds(level[j], near, most, bounds, j)


@kernel
def enter_bounds(level: Real, near: Real, most: Real, bounds: Images, j: int) -> None:
    """The bounds of one pixel; `most` is the highest level that there is."""
    first, last = np.ceil(level - near), np.floor(level + near)
    some = last >= ZERO and first <= most
    bounds[LOW + j] = max(first, ZERO) if some else most
    bounds[HIGH + j] = min(last, most) if some else ZERO
    bounds[DARK + j] = min(max(np.floor(level), ZERO), most)


@kernel
def append_bits(
    bits: Images,
    place: Place,
    part: tuple[int, int],
    bounds: Images,
    index: NDArray[np.integer],
    doubtful: Bytes,
) -> None:
    """Append the bits from `part[0]` to before `part[1]` to the index of a tile's reflected code.

    Two at a time: the loops are short of loads, not of sums.
    """
    i, begin, n = place
    end = begin + n
    for m in range(part[0], part[1] - 1, 2):
        one, two = bits[m, i, begin:end], bits[m + 1, i, begin:end]
        for j in range(min(n, TILE)):
            first = (one[j] > bounds[DARK + j]) ^ (index[j] & 1)
            index[j] = (index[j] << 2) | (first << 1) | ((two[j] > bounds[DARK + j]) ^ first)
        for j in range(min(n, TILE)):
            near = one[j] >= bounds[LOW + j] and one[j] <= bounds[HIGH + j]
            next_near = two[j] >= bounds[LOW + j] and two[j] <= bounds[HIGH + j]
            doubtful[j] += np.uint8(near) + np.uint8(next_near)
    if (part[1] - part[0]) % 2:
        one = bits[part[1] - 1, i, begin:end]
        for j in range(min(n, TILE)):
            index[j] = (index[j] << 1) | ((one[j] > bounds[DARK + j]) ^ (index[j] & 1))
        for j in range(min(n, TILE)):
            near = one[j] >= bounds[LOW + j] and one[j] <= bounds[HIGH + j]
            doubtful[j] += np.uint8(near)
