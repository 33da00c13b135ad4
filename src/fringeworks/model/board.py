"""Calibration boards: printed points on a grid, where they are and how they grow with warmth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class CheckerboardTarget:
    """A printed checkerboard: inner corners and their measured pitch in mm.

    The board's frame has z = 0 on the board, x along its columns and y along its rows.

    Attributes
    ----------
    columns, rows
        Inner corners.
    pitch_x_mm, pitch_y_mm
        Distance of neighbouring corners, measured.
    pitch_sigma_mm
        Standard deviation of the pitches.
    cte_per_k, temperature_c
        Thermal expansion per kelvin, and the temperature at which the pitch was measured.
    """

    columns: int
    rows: int
    pitch_x_mm: float
    pitch_y_mm: float
    pitch_sigma_mm: float | None = None
    cte_per_k: float | None = None
    temperature_c: float | None = None

    @property
    def corner_count(self) -> int:
        return self.columns * self.rows

    def corners_mm(self) -> NDArray[np.float64]:
        """``(rows * columns, 3)`` inner corners, row by row, mm in the board's frame."""
        return _grid(self)


@dataclass(frozen=True, slots=True)
class CharucoTarget:
    """A checkerboard whose white squares hold markers: part of it in view is enough.

    As `CheckerboardTarget`; columns and rows count inner corners, the square up and left of the
    first of them is black.

    Attributes
    ----------
    marker_mm
        Side of a marker with its black rim; it takes no part in lengths.
    dictionary
        Name of OpenCV's dictionary, as DICT_4X4_250.
    """

    columns: int
    rows: int
    pitch_x_mm: float
    pitch_y_mm: float
    marker_mm: float
    dictionary: str
    pitch_sigma_mm: float | None = None
    cte_per_k: float | None = None
    temperature_c: float | None = None

    @property
    def corner_count(self) -> int:
        return self.columns * self.rows

    def corners_mm(self) -> NDArray[np.float64]:
        """``(rows * columns, 3)`` inner corners, row by row, mm in the board's frame."""
        return _grid(self)


@dataclass(frozen=True, slots=True)
class CirclesTarget:
    """Dark circles on a symmetric grid; as `CheckerboardTarget` with centres for corners.

    Attributes
    ----------
    diameter_mm
        Of each circle: a circle seen at a slant has its centre elsewhere than its image has.
    """

    columns: int
    rows: int
    pitch_x_mm: float
    pitch_y_mm: float
    diameter_mm: float
    pitch_sigma_mm: float | None = None
    cte_per_k: float | None = None
    temperature_c: float | None = None

    @property
    def corner_count(self) -> int:
        return self.columns * self.rows

    def corners_mm(self) -> NDArray[np.float64]:
        """``(rows * columns, 3)`` centres, row by row, mm in the board's frame."""
        return _grid(self)


Target: TypeAlias = CheckerboardTarget | CharucoTarget | CirclesTarget


def kind_of(target: Target) -> str:
    """What files call it."""
    match target:
        case CheckerboardTarget():
            return "checkerboard"
        case CharucoTarget():
            return "charuco"
        case CirclesTarget():
            return "circles"


def expansion(target: Target, temperature_c: float | None) -> float:
    """How much larger the board is than when it was measured: ``1 + cte (T - T0)``.

    1 where the board's expansion, its temperature T0 or the capture's T is not known.
    """
    if target.cte_per_k is None or target.temperature_c is None or temperature_c is None:
        return 1.0
    return 1 + target.cte_per_k * (temperature_c - target.temperature_c)


def scale_sigma(target: Target) -> float | None:
    """One standard deviation of the scale, as a share: that of the pitch over the smaller pitch.

    Every length that is measured with a rig errs by the same share as the board that calibrated
    it. The errors of both pitches are taken as one: it is the calliper's. None where the board
    does not say.
    """
    if target.pitch_sigma_mm is None:
        return None
    return target.pitch_sigma_mm / min(target.pitch_x_mm, target.pitch_y_mm)


def corners_at(target: Target, temperature_c: float | None) -> NDArray[np.float64]:
    """``(n, 3)`` corners or centres, mm in the board's frame, at a capture's temperature."""
    return target.corners_mm() * expansion(target, temperature_c)


def _grid(target: Target) -> NDArray[np.float64]:
    y, x = np.mgrid[: target.rows, : target.columns].astype(np.float64)
    flat = np.stack([x * target.pitch_x_mm, y * target.pitch_y_mm, np.zeros_like(x)], axis=-1)
    return flat.reshape(-1, 3)
