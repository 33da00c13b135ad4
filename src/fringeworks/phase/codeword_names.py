"""Which codeword one fringe of the code frame carries: by its spectrum, or by correlation.

The spectrum is the paper's (section 5, step 3 and Table 1), the correlation its future work. Both
take the grey levels as they are, with the surface's shading in them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Codeword

PADDED = 4096
"""Length of the zero-padded transform: its steps are far below the difference of two codewords."""

FRINGE_S = 0.2
"""Table 1 counts in Hz as if one fringe of 32 px lasted 0.2 s, sampled at 160 Hz."""

CAPTURED_OFFSET_HZ = 1.0
"""The captured column of Table 1 is ``160 / p + 1``, within the tolerance it prints."""

Signal: TypeAlias = NDArray[np.float64]
Quantity = TypeVar("Quantity", float, Signal)


@dataclass(frozen=True, slots=True)
class FringeCut:
    """What one period of the code frame shows.

    Attributes
    ----------
    grey
        Grey levels of the code frame from A' to A'', ``(n,)``.
    phase
        Wrapped phase of the same pixels, rad.
    length_px
        Camera px between the crossings, which is one period of the phase.
    """

    grey: Signal
    phase: Signal
    length_px: float


NameCodeword: TypeAlias = Callable[[FringeCut, Codeword], tuple[int, float]]
"""Index of the codeword that a fringe carries, and the margin."""


def spectrum(grey: Signal) -> tuple[Signal, Signal]:
    """Frequencies, cycles per sample, and magnitudes of a cut: zero mean, zero padded."""
    magnitude: Signal = np.abs(np.fft.rfft(grey - grey.mean(), PADDED))
    frequency: Signal = np.arange(len(magnitude)) / PADDED
    return frequency, magnitude


def peak_frequency(grey: Signal) -> float:
    """Cycles per sample at the highest point of the spectrum."""
    frequency, magnitude = spectrum(grey)
    return float(frequency[np.argmax(magnitude)])


def table_hz(cycles: Quantity) -> Quantity:
    """Cycles per fringe in the unit of Table 1's captured column."""
    return cycles / FRINGE_S + CAPTURED_OFFSET_HZ


def name_by_spectrum(fringe: FringeCut, code: Codeword) -> tuple[int, float]:
    """The codeword whose captured frequency in Table 1 is nearest to the peak.

    The margin falls from one at the codeword's own frequency to zero halfway to its neighbour's.
    """
    cycles = peak_frequency(fringe.grey) * fringe.length_px
    table = np.array([table_hz(code.period_px / word) for word in code.codewords_px])
    away = np.abs(table - table_hz(cycles))
    index = int(np.argmin(away))
    neighbours = np.delete(np.abs(table - table[index]), index)
    half_way = neighbours.min(initial=np.inf) / 2
    return index, float(1 - away[index] / half_way)


def name_by_correlation(fringe: FringeCut, code: Codeword) -> tuple[int, float]:
    """The codeword whose cosine, laid along the phase, correlates best with the code frame.

    The margin is the share by which the best correlation leads the next.
    """
    xi = code.period_px * (fringe.phase + np.pi) / (2 * np.pi)
    words = np.array(code.codewords_px)[:, None]
    found = _correlations(np.cos(2 * np.pi * (xi - 0.5) / words), fringe.grey)
    index = int(np.argmax(found))
    second = np.delete(found, index).max(initial=0.0)
    return index, float(1 - second / found[index]) if found[index] > 0 else 0.0


def _correlations(templates: Signal, grey: Signal) -> Signal:
    """Pearson's coefficient of each template ``(k, n)`` with the grey levels ``(n,)``."""
    templates = templates - templates.mean(axis=1, keepdims=True)
    signal = grey - grey.mean()
    size = np.linalg.norm(templates, axis=1) * np.linalg.norm(signal)
    return np.asarray(templates @ signal / np.maximum(size, np.finfo(float).tiny))
