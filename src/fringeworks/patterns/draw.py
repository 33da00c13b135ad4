"""The light of each kind of pattern, as a share of full scale, before it becomes grey levels.

Everything is sampled at pixel centres, which sit at integers; the image's edge is at -1/2. Arrays
are ``(n, H, W)`` with length 1 along every direction in which the pattern does not vary, so that
a fringe is computed once per column and not once per pixel.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import (
    Axis,
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    Picture,
    Speckle,
    Staircase,
    Uniform,
)
from fringeworks.model.sequence import PROJECTOR_EDGE_PX, fringe_order
from fringeworks.patterns.checks import parse_colour, refuse_picture

Light: TypeAlias = NDArray[np.float64]

SPECKLE_COVERAGE = 0.5
"""Share of a speckle image that is white."""


def draw(pattern: Pattern, *, width: int, height: int) -> Light:
    """Light of a pattern, 0 to 1, broadcastable to ``(n, H, W)``, or ``(1, H, W, 3)`` in colour."""
    if isinstance(pattern, Picture):
        refuse_picture()
    match pattern:
        case Uniform(level=level):
            return np.full((1, 1, 1), level)
        case Checkerboard(square_px=square):
            return _checkerboard(square, width=width, height=height)
        case Speckle():
            return _speckle(pattern, width=width, height=height)
        case _:
            extent = width if pattern.axis == "x" else height
            return _across(pattern.axis, _profile(pattern, np.arange(extent, dtype=np.float64)))


def _across(axis: Axis, profile: Light) -> Light:
    """A profile ``(n, extent[, 3])`` along `axis`, as a stack of images constant across it."""
    return np.expand_dims(profile, 1 if axis == "x" else 2)


def _profile(pattern: Fringe | GrayCode | Codeword | Staircase | Colour, u: Light) -> Light:
    """Light ``(n, extent)``, in colour ``(1, extent, 3)``, at projector coordinates `u`, px."""
    match pattern:
        case Fringe():
            return _sinusoids(2 * np.pi * _turns(pattern, u), pattern.shifts_rad)
        case GrayCode():
            return _gray(pattern, u)
        case Codeword():
            return _codewords(pattern, u)
        case Staircase():
            stairs = -np.pi + 2 * np.pi * (fringe_order(_turns(pattern, u)) + 0.5) / pattern.levels
            return _sinusoids(stairs, pattern.shifts_rad)
        case Colour():
            palette = np.array([parse_colour(name) for name in pattern.palette], dtype=np.float64)
            return palette[None, fringe_order(_turns(pattern, u)) % len(palette)]


def _turns(pattern: Fringe | Codeword | Staircase | Colour, u: Light) -> Light:
    """Absolute phase over 2 pi: ``(u - zero_px) / period_px``."""
    zero_px = pattern.zero_px if isinstance(pattern, Fringe | Codeword) else PROJECTOR_EDGE_PX
    return (u - zero_px) / pattern.period_px


def _sinusoids(phase: Light, shifts_rad: tuple[float, ...]) -> Light:
    """``I_n = A + B cos(Phi - shift_n)`` with A = B = 1/2."""
    light: Light = 0.5 + 0.5 * np.cos(phase - np.array(shifts_rad)[:, None])
    return light


def _gray(code: GrayCode, u: Light) -> Light:
    """Bits of the reflected binary code of each pixel's cell, in the order `GrayCode` states.

    The complementary bit is the last bit of the code of one bit more, whose cells are half as
    wide: both codes agree in all other bits.
    """
    finest = np.floor((u - PROJECTOR_EDGE_PX) / code.code_px).astype(np.int64)
    reflected = finest ^ (finest >> 1)
    count = code.bits + code.complementary
    bits = (reflected >> np.arange(count - 1, -1, -1)[:, None]) & 1
    inverted = 1 - bits[: code.bits] if code.inverted else bits[:0]
    return np.concatenate([bits, inverted]).astype(np.float64)


def _codewords(code: Codeword, u: Light) -> Light:
    """Inside fringe k ``cos(2 pi (xi - 1/2) / p_k)``, ``xi = P (phi + pi) / 2 pi`` in (0, P]."""
    turns = _turns(code, u)
    orders = fringe_order(turns)
    xi = code.period_px * (turns - orders + 0.5)
    period = np.array([code.codeword_of(int(order)) for order in orders])
    return _sinusoids(2 * np.pi * (xi - 0.5) / period, (0.0,))


def _checkerboard(square_px: float, *, width: int, height: int) -> Light:
    """Squares counted from the image's corner, which is black."""
    v, u = np.ogrid[:height, :width]
    column, row = (np.floor((c - PROJECTOR_EDGE_PX) / square_px).astype(np.int64) for c in (u, v))
    return ((column + row) % 2).astype(np.float64)[None]


def _speckle(speckle: Speckle, *, width: int, height: int) -> Light:
    """White round dots at uniformly random places, that may overlap, on black.

    Of n dots of area a each, dropped on an area S, a point stays black with probability
    exp(-n a / S): n is chosen for `SPECKLE_COVERAGE`. Dots are dropped up to a radius outside the
    image too, so that its edges are covered as its middle is.
    """
    from scipy.spatial import KDTree

    radius = speckle.dot_px / 2
    size = np.array([width, height]) + speckle.dot_px
    count = round(-math.log(1 - SPECKLE_COVERAGE) * size.prod() / (math.pi * radius**2))
    rng = np.random.default_rng(speckle.seed)
    dots = rng.random((max(count, 1), 2)) * size + PROJECTOR_EDGE_PX - radius
    v, u = np.mgrid[:height, :width]
    distance, _ = KDTree(dots).query(np.stack([u, v], axis=-1), distance_upper_bound=radius)
    return np.isfinite(distance).astype(np.float64)[None]
