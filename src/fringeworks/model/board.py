"""The calibration board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class CheckerboardTarget:
    """A printed checkerboard: inner corners and their measured pitch in mm.

    The board's frame has z = 0 on the board, x along its columns and y along its rows.
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
        y, x = np.mgrid[: self.rows, : self.columns].astype(np.float64)
        flat = np.stack([x * self.pitch_x_mm, y * self.pitch_y_mm, np.zeros_like(x)], axis=-1)
        return flat.reshape(-1, 3)
