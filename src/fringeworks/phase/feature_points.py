"""One fringe per region, cut out where the wrapped phase crosses from one period to the next.

Section 5 of the paper: step 1 sets a feature point in each continuous region, "in the middle of a
2 pi phase period", step 3 looks for the zero crossings A' and A'' on either side of it. The paper
sets its points by hand; here it is the middle of the whole period nearest to the region's middle.
Periods are looked for along the camera's rows for phase along x, along its columns for y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Axis, FloatMap
from fringeworks.model.phase import VOID_REGION, OrderMap

LEAST_SAMPLES = 8
"""A cut of fewer pixels has no spectrum to speak of."""

TURN = np.float32(2 * np.pi)

Indices: TypeAlias = NDArray[np.intp]
Lines: TypeAlias = tuple[Indices, Indices, Indices]
Value = TypeVar("Value", bound=np.generic)
Pixels: TypeAlias = tuple[int | slice, int | slice]


@dataclass(frozen=True, slots=True)
class Period:
    """A whole fringe of a region, along one line of the camera.

    Attributes
    ----------
    region
        Label of the region.
    axis
        The projector axis of the phase: "x" has its lines along the camera's rows.
    line
        The camera's row (axis x) or column (axis y).
    start_px, end_px
        The zero crossings A' and A'', camera px along the line, between two pixels each.
    feature
        Pixel along the line whose phase is nearest to zero: the feature point.
    """

    region: int
    axis: Axis
    line: int
    start_px: float
    end_px: float
    feature: int

    @property
    def length_px(self) -> float:
        """Camera px from crossing to crossing."""
        return self.end_px - self.start_px

    @property
    def along(self) -> slice:
        """Pixels between the crossings without the first and last, which see both fringes."""
        return slice(int(self.start_px) + 2, int(self.end_px))

    @property
    def cut(self) -> Pixels:
        """Index of those pixels in a map ``(H, W)``."""
        return (self.line, self.along) if self.axis == "x" else (self.along, self.line)

    @property
    def pixel(self) -> tuple[int, int]:
        """Row and column of the feature point."""
        return (self.line, self.feature) if self.axis == "x" else (self.feature, self.line)


def find_periods(phase: FloatMap, region: OrderMap, axis: Axis) -> list[Period]:
    """Every whole period of every region, line by line.

    Parameters
    ----------
    phase
        Wrapped phase ``(H, W)``, rad, in (-pi, pi]; NaN where void.
    region
        ``(H, W)`` label, `VOID_REGION` where void.
    axis
        The projector axis of the phase.
    """
    phase, region = _lines_as_rows(phase, axis), _lines_as_rows(region, axis)
    lines = _whole_periods(phase, region)
    return [_period_at(phase, region, axis, crossings) for crossings in zip(*lines, strict=True)]


def find_feature_periods(phase: FloatMap, region: OrderMap, axis: Axis) -> list[Period]:
    """The period of each region's feature point; parameters as of `find_periods`.

    Regions rise; one without a whole period is left out.
    """
    phase, region = _lines_as_rows(phase, axis), _lines_as_rows(region, axis)
    lines = _whole_periods(phase, region)
    nearest = [numbers[_nearest_to_middle(lines, region)] for numbers in lines]
    return [_period_at(phase, region, axis, crossings) for crossings in zip(*nearest, strict=True)]


def _lines_as_rows(image: NDArray[Value], axis: Axis) -> NDArray[Value]:
    return image if axis == "x" else np.ascontiguousarray(image.T)


def _whole_periods(phase: FloatMap, region: OrderMap) -> Lines:
    """Between two wraps in the same sense that no other region and no void pixel parts.

    Line, and the pixels before both crossings, of each. Where noise wraps the phase to and fro
    the senses differ, and the fringe is not taken.
    """
    joined = (region[:, 1:] == region[:, :-1]) & (region[:, 1:] != VOID_REGION)
    jump = np.rint(np.where(joined, np.diff(phase, axis=1), 0) / TURN).astype(np.int8)
    gaps = np.cumsum(~joined, axis=1, dtype=np.int32)
    line, at = np.nonzero(jump)
    first, second = (line[:-1], at[:-1]), (line[1:], at[1:])
    whole = (first[0] == second[0]) & (gaps[first] == gaps[second]) & (jump[first] == jump[second])
    whole &= second[1] - first[1] >= LEAST_SAMPLES + 2
    return first[0][whole], first[1][whole], second[1][whole]


def _nearest_to_middle(lines: Lines, region: OrderMap) -> Indices:
    """For each region the number of the period whose middle is nearest to the mean of its pixels.

    The nearest of equals is the first; regions rise.
    """
    line, start, end = lines
    inside = region != VOID_REGION
    labels = region[inside]
    middle = [
        np.bincount(labels, at) / np.maximum(np.bincount(labels), 1) for at in inside.nonzero()
    ]
    owner = region[line, end]
    across, along = line - middle[0][owner], (start + end + 1) / 2 - middle[1][owner]
    by_distance = np.argsort(across**2 + along**2, kind="stable")
    _, nearest = np.unique(owner[by_distance], return_index=True)
    return np.asarray(by_distance[nearest])


def _period_at(
    phase: FloatMap, region: OrderMap, axis: Axis, crossings: tuple[np.intp, np.intp, np.intp]
) -> Period:
    """The period between the crossings after two pixels of a line."""
    line, first, last = map(int, crossings)
    row = phase[line]
    return Period(
        region=int(region[line, last]),
        axis=axis,
        line=line,
        start_px=_crossing(row, first),
        end_px=_crossing(row, last),
        feature=first + 1 + int(np.argmin(np.abs(row[first + 1 : last + 1]))),
    )


def _crossing(row: FloatMap, before: int) -> float:
    """Where between a pixel and the next the phase reaches pi and goes on at -pi, or back."""
    near, far = (np.pi - abs(float(row[pixel])) for pixel in (before, before + 1))
    return before + (near / (near + far) if near + far > 0 else 0.5)
