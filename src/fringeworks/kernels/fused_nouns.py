"""What the fused pass takes, gives and works in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.lattice import STENCIL
from fringeworks.kernels.table import NUMBERS
from fringeworks.kernels.tile import TILE, Bytes, Floats, Images, Three

VOID, SATURATED, NEAR, HIGHER, LOWER = (n * TILE for n in range(5))
MARK_SLOTS = 5
"""Slots of marks; the last two are the bytes of the Gray index."""

LEVEL, REFERENCE, MARGIN, DEPTH, SLOPE, POWERS = (n * TILE for n in range(6))
LOCAL = POWERS + NUMBERS * STENCIL * TILE
RAY_X, RAY_Y, ORIGIN, C1, C2, C3, BEND = (LOCAL + STENCIL * n * TILE for n in range(NUMBERS))
SLOTS = 5 + 2 * NUMBERS * STENCIL
"""Slots of a tile's maps, of the table's numbers by powers of the row counted from a lattice cell's
first, and of the same counted from the middle of a block."""


class Carrier(NamedTuple):
    """One fringe set and how it is demodulated.

    Attributes
    ----------
    frames
        ``(N, H, W)``.
    basis, solve, covariance
        As `demodulate` takes them.
    noise
        Read variance, gain, black level, as `judge_tile` takes them.
    fringe
        Period and zero, projector px.
    """

    frames: Images
    basis: Floats
    solve: Floats
    covariance: Floats
    noise: Three
    fringe: tuple[float, float]


class Code(NamedTuple):
    """The Gray code before the chain; without bits the chain starts from `start_px`.

    Attributes
    ----------
    bits
        ``(n, H, W)``, the complementary one last; n may be 0.
    white, black
        ``(H, W)`` frames between which the threshold lies, or ``(0, 0)``: the fringes' offset.
    code_px, cells
        Width of the (half) cells and their count.
    doubt_sigmas, safe_margin, safe_sigmas
        See `phase.gray` and `phase.chained`.
    """

    bits: Images
    white: Images
    black: Images
    code_px: float
    cells: int
    doubt_sigmas: float
    safe_margin: float
    safe_sigmas: float
    start_px: float


class Rules(NamedTuple):
    """Limits, and the marks that a pixel gets.

    Attributes
    ----------
    saturation, limits, broken
        As `demodulate` and `judge_tile` take them.
    middle_px, half_px, outside_sigmas
        Centre and half the extent of the projector's image, and how far beyond it is void.
    marks
        Of a point that was not decoded, of one outside the depth range, and of one that was not
        decoded as its frames fit no sinusoid.
    """

    saturation: float
    limits: Three
    broken: tuple[np.uint8, np.uint8, np.uint8]
    middle_px: float
    half_px: float
    outside_sigmas: float
    marks: tuple[np.uint8, np.uint8, np.uint8]


class Table(NamedTuple):
    """A `DepthTable` of one axis as the kernels take it."""

    nodes: NDArray[np.float64]
    step: tuple[float, float]
    depths: tuple[float, float, float]


class Points(NamedTuple):
    """Outputs: ``(3, H, W)`` and three times ``(H, W)``."""

    xyz: Floats
    sigma_mm: Floats
    intensity: Floats
    reason: Bytes


class Work(NamedTuple):
    """Scratch memory of one thread.

    Attributes
    ----------
    fits
        Slots of `tile` for each carrier.
    s
        Slots of this module.
    bounds, marks
        Slots of `tile.append_bits`, and of marks.
    """

    fits: Floats
    s: Floats
    bounds: Images
    marks: Bytes
