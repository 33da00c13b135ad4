"""Phases and projector coordinates: one type per stop of the line.

A wrapped phase cannot be triangulated by mistake: only `ProjectorMap` goes into `reconstruct`.
All maps are ``(H, W)``, camera pixels; invalid is NaN (order: -1) and only that.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.model.sequence import Axis, Fringe

FloatMap: TypeAlias = NDArray[np.float32]
OrderMap: TypeAlias = NDArray[np.int32]
VoidMap: TypeAlias = NDArray[np.uint8]
NoiseSource: TypeAlias = Literal["camera", "residual", "high-pass"]

VOID_ORDER = -1
VOID_REGION = -1
NO_EXPOSURE = 255


@dataclass(frozen=True, slots=True)
class Noise:
    """Camera noise used for sigma and masks: its variance is ``read^2 + gain * signal``.

    `source` says where it comes from: the capture's ``[camera]`` table, the residual of the
    demodulation (N >= 4), or high-pass differences of the frames (N = 3).
    """

    read: float
    gain: float
    black_level: float
    source: NoiseSource

    def sigma(self, grey: NDArray[np.floating]) -> NDArray[np.floating]:
        """Standard deviation, grey levels, at the mean grey level `grey`."""
        signal = np.maximum(grey - self.black_level, 0)
        return np.asarray(np.sqrt(self.read**2 + self.gain * signal))


class Void(IntEnum):
    """Why a pixel is void; the first rule that it breaks."""

    VALID = 0
    SATURATED = 1
    MODULATION = 2
    RESIDUAL = 3
    ORDER = 4
    OTHER_LIGHT = 5


VOID_WORDS = {
    Void.SATURATED: "saturated",
    Void.MODULATION: "too little modulation",
    Void.RESIDUAL: "too large a residual",
    Void.ORDER: "no certain order inside the projector's image",
    Void.OTHER_LIGHT: "light by way of other surfaces",
}


def describe_voids(void: VoidMap) -> str:
    """Shares of all pixels, rule by rule, in words."""
    counts = np.bincount(void.ravel(), minlength=len(Void)) / void.size
    parts = [f"{counts[rule]:.1%} {words}" for rule, words in VOID_WORDS.items() if counts[rule]]
    return ", ".join(parts) or "none void"


@dataclass(frozen=True, slots=True, eq=False)
class Fusion:
    """Of which exposures a phase was put together.

    Attributes
    ----------
    exposures_ms
        Shortest first.
    ruling
        ``(H, W)`` uint8: place in `exposures_ms` of the one that weighs most; `NO_EXPOSURE` where
        the phase is void.
    """

    exposures_ms: tuple[float, ...]
    ruling: VoidMap

    @property
    def shares(self) -> tuple[float, ...]:
        """Of the pixels that have a phase those that each exposure rules; zeros without any."""
        counts = np.bincount(self.ruling.ravel(), minlength=NO_EXPOSURE + 1)[:NO_EXPOSURE]
        total = max(int(counts.sum()), 1)
        return tuple(float(counts[place] / total) for place in range(len(self.exposures_ms)))


@dataclass(frozen=True, slots=True)
class WrappedPhase:
    """Demodulated fringes of one set.

    Attributes
    ----------
    fringe
        The pattern that made it.
    phase
        Wrapped phase, rad, in (-pi, pi]; NaN where void.
    offset, modulation
        A and B of ``I_n = A + B cos(Phi - shift_n)``, grey levels, defined at every pixel.
    residual
        Root mean square of what the fit leaves, grey levels, per degree of freedom; NaN for
        three frames.
    sigma
        Standard deviation of `phase`, rad, from `noise`; NaN where void.
    void
        A `Void` per pixel: why `phase` is NaN.
    fusion
        Of which exposures it was put together; None for one exposure. Grey levels are then those
        of `Sequence.reference_ms`, `noise` that of the longest exposure.
    """

    fringe: Fringe
    phase: FloatMap
    offset: FloatMap
    modulation: FloatMap
    residual: FloatMap
    sigma: FloatMap
    noise: Noise
    void: VoidMap
    fusion: Fusion | None = None


@dataclass(frozen=True, slots=True)
class UnwrappedPhase:
    """A wrapped phase that is continuous inside regions, each with a constant nobody knows yet.

    Attributes
    ----------
    wrapped
        What was unwrapped.
    turns
        ``(H, W)`` int32: ``phi + 2 pi turns`` is continuous inside a region; counted from
        wherever the unwrapping began, 0 where void.
    region
        ``(H, W)`` int32 label, 0 to `region_count` - 1; `VOID_REGION` where void.
    residues, open_loops
        Loops of four pixels, and longer ones round holes, that do not close. With neither, every
        path through a region gives the same phase.
    torn_links
        Neighbours whose unwrapped phases are more than half a turn apart: there the phase had to
        be torn. Zero where all loops close.
    """

    wrapped: WrappedPhase
    turns: OrderMap
    region: OrderMap
    region_count: int
    residues: int = 0
    open_loops: int = 0
    torn_links: int = 0

    @property
    def fringe(self) -> Fringe:
        return self.wrapped.fringe

    @property
    def phase(self) -> FloatMap:
        """Relative phase, rad; NaN where void."""
        return (self.wrapped.phase + np.float32(2 * np.pi) * self.turns).astype(np.float32)


@dataclass(frozen=True, slots=True)
class AbsolutePhase:
    """A wrapped phase with its fringe orders: ``Phi = phi + 2 pi k``, counted from `zero_px`.

    `margin` is how far every reference phase stayed from a wrong order: the least
    1 - |Phi_ref - Phi| / pi of the chain's steps, one where they agree, zero at the edge of the
    next order; NaN where void.
    """

    wrapped: WrappedPhase
    order: OrderMap
    margin: FloatMap

    @property
    def fringe(self) -> Fringe:
        return self.wrapped.fringe

    @property
    def phase(self) -> FloatMap:
        """Absolute phase, rad; NaN where void (order -1 may be a true one, left of `zero_px`)."""
        turns = np.where(np.isnan(self.margin), np.float32(np.nan), self.order)
        return (self.wrapped.phase + np.float32(2 * np.pi) * turns).astype(np.float32)


@dataclass(frozen=True, slots=True)
class CodedAxis:
    """The projector coordinate along one axis.

    Attributes
    ----------
    axis
        The projector axis it counts along.
    coordinate, sigma
        Projector px and its standard deviation; NaN where void.
    offset, modulation
        Grey levels: of the finest fringes, or half the sum and difference of white and black.
    phase
        The absolute phase of the finest period; None for a Gray code alone.
    void
        A `Void` per pixel: why `coordinate` is NaN.
    route
        The steps that led to the order, in words, coarse to fine.
    """

    axis: Axis
    coordinate: FloatMap
    sigma: FloatMap
    offset: FloatMap
    modulation: FloatMap
    phase: AbsolutePhase | None
    void: VoidMap
    route: tuple[str, ...]

    @property
    def valid_share(self) -> float:
        return float(np.mean(np.isfinite(self.coordinate)))


@dataclass(frozen=True, slots=True)
class ProjectorMap:
    """Where in the projector each camera pixel's light comes from: what `reconstruct` eats.

    `column` and `row` are None for an axis that the capture does not code; one of them is set.
    """

    column: CodedAxis | None
    row: CodedAxis | None

    @property
    def axes(self) -> tuple[CodedAxis, ...]:
        return tuple(axis for axis in (self.column, self.row) if axis is not None)

    @property
    def shape(self) -> tuple[int, int]:
        height, width = self.axes[0].coordinate.shape
        return height, width
