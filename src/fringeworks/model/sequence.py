"""What is projected: patterns, sets of frames, and the sequence they make.

A sequence is a description, not pixels. It travels inside its capture, so that the encoder and
the decoder cannot disagree. Angles are radians here; files hold degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fringeworks.errors import UsageError

Axis: TypeAlias = Literal["x", "y"]
AXES: tuple[Axis, Axis] = ("x", "y")

PROJECTOR_EDGE_PX = -0.5
"""Coordinate of the projector image's edge: pixel centres sit at integers."""

HALF_LEVEL = 0.5
"""A uniform frame above this share of full scale is white, below it black."""

EDGE_TOLERANCE_PX = 1e-6
"""An edge this close to a pixel centre counts as on it."""

MIN_CONDITION = 1e-3
"""Smallest over largest singular value of the shifts' design matrix that is still solvable."""


@dataclass(frozen=True, slots=True)
class Fringe:
    """Sinusoidal fringes, one frame per shift: ``I_n = A + B cos(Phi - shift_n)``.

    ``Phi(u) = 2 pi (u - zero_px) / period_px`` with u the projector coordinate along `axis`.
    """

    axis: Axis
    period_px: float
    shifts_rad: tuple[float, ...]
    zero_px: float = PROJECTOR_EDGE_PX

    @property
    def frame_count(self) -> int:
        return len(self.shifts_rad)

    def phase_at(self, coordinate_px: float) -> float:
        """Absolute phase, rad, of a projector coordinate."""
        return 2 * math.pi * (coordinate_px - self.zero_px) / self.period_px


@dataclass(frozen=True, slots=True)
class GrayCode:
    """Reflected binary code of cells `cell_px` wide, the first starting at the image's edge.

    Frames stand in this order: the bits, most significant first; the complementary bit (the
    half-cell-shifted one, which halves the cells) if there is one; the inverse of each bit if
    `inverted`.
    """

    axis: Axis
    bits: int
    cell_px: float
    inverted: bool = False
    complementary: bool = False

    @property
    def frame_count(self) -> int:
        return self.bits * (2 if self.inverted else 1) + self.complementary

    @property
    def code_px(self) -> float:
        """Width of the smallest distinguishable cell: half of `cell_px` with a complement."""
        return self.cell_px / 2 if self.complementary else self.cell_px


@dataclass(frozen=True, slots=True)
class Uniform:
    """One flat frame; `level` is the share of full scale, 0 to 1."""

    level: float

    @property
    def frame_count(self) -> int:
        return 1


@dataclass(frozen=True, slots=True)
class Codeword:
    """The paper's code frame: inside fringe k a cosine of period ``codewords_px[sequence[k]]``."""

    axis: Axis
    period_px: float
    codewords_px: tuple[float, ...]
    sequence: tuple[int, ...] | None = None
    zero_px: float = PROJECTOR_EDGE_PX

    @property
    def frame_count(self) -> int:
        return 1

    def codeword_of(self, order: int) -> float:
        """Period, projector px, of the codeword that fringe `order` carries."""
        index = order if self.sequence is None else self.sequence[order]
        return self.codewords_px[index % len(self.codewords_px)]


@dataclass(frozen=True, slots=True)
class Checkerboard:
    """A projected checkerboard with squares of `square_px` projector pixels."""

    square_px: float

    @property
    def frame_count(self) -> int:
        return 1


@dataclass(frozen=True, slots=True)
class Staircase:
    """Phase coding (Wang and Zhang 2012): shifted frames whose phase is a stair of the order."""

    axis: Axis
    period_px: float
    levels: int
    shifts_rad: tuple[float, ...]

    @property
    def frame_count(self) -> int:
        return len(self.shifts_rad)


@dataclass(frozen=True, slots=True)
class Colour:
    """Colour-coded fringe order (Su): fringe k is painted with ``palette[k mod len]``."""

    axis: Axis
    period_px: float
    palette: tuple[str, ...]

    @property
    def frame_count(self) -> int:
        return 1


@dataclass(frozen=True, slots=True)
class Speckle:
    """Random dots of `dot_px` projector pixels drawn from `seed`."""

    seed: int
    dot_px: float

    @property
    def frame_count(self) -> int:
        return 1


@dataclass(frozen=True, slots=True)
class Picture:
    """Frames of no coded meaning (kind ``image`` in files)."""

    frames: int = 1

    @property
    def frame_count(self) -> int:
        return self.frames


Pattern: TypeAlias = (
    Fringe | GrayCode | Uniform | Codeword | Checkerboard | Staircase | Colour | Speckle | Picture
)


@dataclass(frozen=True, slots=True)
class PatternSet:
    """A pattern as it is shown once: its frames, `repeats` images of each, at one exposure.

    `group` keeps alternatives apart; sets without a group belong to all of them.
    """

    pattern: Pattern
    group: str | None = None
    exposure_ms: float | None = None
    repeats: int = 1
    timestamps_s: tuple[float, ...] | None = None

    @property
    def image_count(self) -> int:
        return self.pattern.frame_count * self.repeats


@dataclass(frozen=True, slots=True)
class Sequence:
    """All that one projector shows for one capture; sizes in projector pixels."""

    width: int
    height: int
    sets: tuple[PatternSet, ...]

    def extent(self, axis: Axis) -> int:
        """Number of projector pixels along `axis`."""
        return self.width if axis == "x" else self.height

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the alternatives, in the order in which they first appear."""
        names = (pattern_set.group for pattern_set in self.sets)
        return tuple(dict.fromkeys(name for name in names if name is not None))

    @property
    def reference_ms(self) -> float | None:
        """Longest exposure, ms, where a pattern of the first group is shown at several, else None.

        Grey levels of all exposures are brought to this one.
        """
        sets = (self.sets[place] for place in self.choose_group(None))
        shown = {(one.pattern, one.exposure_ms) for one in sets if one.exposure_ms is not None}
        several = len({pattern for pattern, _ in shown}) < len(shown)
        return max(exposure_ms for _, exposure_ms in shown) if several else None

    @property
    def white_set(self) -> int | None:
        """Index of the brightest uniform set above half of full scale; the first of equals."""
        levels = [(-level, index) for level, index in self._uniform_levels() if level > HALF_LEVEL]
        return min(levels)[1] if levels else None

    @property
    def black_set(self) -> int | None:
        """Index of the darkest uniform set below half of full scale; the first of equals."""
        levels = [(level, index) for level, index in self._uniform_levels() if level < HALF_LEVEL]
        return min(levels)[1] if levels else None

    def _uniform_levels(self) -> list[tuple[float, int]]:
        patterns = ((item.pattern, index) for index, item in enumerate(self.sets))
        return [(p.level, index) for p, index in patterns if isinstance(p, Uniform)]

    def choose_group(self, name: str | None) -> tuple[int, ...]:
        """Indices of the sets that belong to group `name` (None: the first one there is)."""
        if name is not None and name not in self.groups:
            offered = ", ".join(self.groups) or "none"
            raise UsageError(f"group must be one of the capture's ({offered}), got '{name}'")
        chosen = name if name is not None else next(iter(self.groups), None)
        return tuple(i for i, item in enumerate(self.sets) if item.group in (None, chosen))


def fringe_order(turns: ArrayLike) -> NDArray[np.int64]:
    """Fringe order at ``turns = Phi / 2 pi``: k spans ``(2 pi k - pi, 2 pi k + pi]``."""
    return np.ceil(np.asarray(turns, dtype=np.float64) - 0.5).astype(np.int64)


def fringe_orders(extent: int, period_px: float, *, zero_px: float = PROJECTOR_EDGE_PX) -> range:
    """Fringe orders that a projector of `extent` pixels shows (C19).

    With the zero at the image's edge they run 0 .. floor(extent / period + 1/2), and the first and
    last fringe are cut by the edges.
    """
    first = int(fringe_order((PROJECTOR_EDGE_PX - zero_px) / period_px))
    last = math.floor((extent + PROJECTOR_EDGE_PX - zero_px) / period_px + 0.5)
    return range(first, last + 1)


def shifts_are_solvable(shifts_rad: tuple[float, ...]) -> bool:
    """Whether offset, cosine and sine follow from frames at these shifts.

    It takes three directions that differ clearly: the design matrix with rows
    ``(1, cos shift, sin shift)`` must have rank three, by `MIN_CONDITION`.
    """
    shifts = np.array(shifts_rad, dtype=np.float64)
    if len(shifts) < 3 or not np.isfinite(shifts).all():
        return False
    design = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    values = np.linalg.svd(design, compute_uv=False)
    return bool(values[-1] >= MIN_CONDITION * values[0])


def gray_bits(extent_px: float, cell_px: float) -> int:
    """Bits of a Gray code whose cells of `cell_px` cover `extent_px` projector pixels."""
    return max(1, (gray_cells(extent_px, cell_px) - 1).bit_length())


def gray_cells(extent_px: float, cell_px: float) -> int:
    """Cells of `cell_px` that it takes to cover `extent_px`; one all but whole counts as whole."""
    return math.ceil(extent_px / cell_px - 1e-9)


def pixel_on_edge(extent: int, step_px: float, *, edge_px: float = PROJECTOR_EDGE_PX) -> int | None:
    """First of `extent` pixels whose centre lies on a code's edge ``edge_px + i step_px``, or None.

    Such a pixel belongs to neither side: rounding would decide its code. For a Gray code the step
    is `GrayCode.code_px`; steps are projector px, above zero.
    """
    for pixel in range(extent):
        steps = (pixel - edge_px) / step_px
        if abs(steps - round(steps)) * step_px < EDGE_TOLERANCE_PX:
            return pixel
    return None
