"""The reader of the tests: plain formulas of docs/conventions.md, none of the package's own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Frames

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def read_gray(bit_frames: Frames, *, full_scale: int = 255) -> Ints:
    """Index of the cell from its reflected binary code, most significant bit first."""
    reflected = (bit_frames > full_scale / 2).astype(np.int64)
    binary = np.cumsum(reflected, axis=0) % 2
    weights = 2 ** np.arange(len(binary) - 1, -1, -1)
    cells: Ints = np.tensordot(weights, binary, axes=1)
    return cells


def wrapped_phase(frames: Frames, shifts_rad: tuple[float, ...]) -> Floats:
    """arg sum I_n exp(i delta_n), for equal steps."""
    total = np.tensordot(np.exp(1j * np.array(shifts_rad)), frames.astype(np.float64), axes=1)
    wrapped: Floats = np.angle(total)
    return wrapped


def fringe_order(reference: Floats, wrapped: Floats) -> Floats:
    """k = round((Phi_ref - phi) / 2 pi)."""
    return np.round((reference - wrapped) / (2 * np.pi))


def phase_bound(full_scale: int) -> float:
    """Largest phase error that rounding N frames of equal steps can cause.

    sum I_n exp(i delta_n) has modulus N B / 2 with B = full_scale / 2; rounding adds at most
    N / 2 to it. So sin(error) <= 1 / B.
    """
    return float(np.arcsin(2 / full_scale)) + 1e-9
