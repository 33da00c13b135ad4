"""Where a known rig has a board's corners: for frames of boards and of turntables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.held.verify import verify_capture
from fringeworks.measure.turntable import TurntableAxis, find_axis
from fringeworks.model import Capture, Rig, Target

Array = NDArray[np.float64]


def locate_board(capture: Capture, rig: Rig, board: Target) -> tuple[Array, Array]:
    """Triangulated corners ``(k, 3)``, camera frame, and their places on the board, mm.

    Raises
    ------
    CalibrationError, DecodeError, ShapeError
        As `verify_capture`.
    """
    seen = verify_capture(capture, rig, board).seen
    return seen.measured, seen.view.board_mm[seen.view.kept]


def find_turntable(
    captures: Sequence[Capture], rig: Rig, board: Target, *, name: str = "table"
) -> TurntableAxis:
    """The axis of a turntable from captures of a board on it.

    Raises
    ------
    MeasurementError
        As `find_axis`.
    CalibrationError, DecodeError, ShapeError
        As `verify_capture`.
    """
    corners = np.full((len(captures), board.corner_count, 3), np.nan)
    for place, capture in enumerate(captures):
        seen = verify_capture(capture, rig, board).seen
        corners[place, seen.view.kept] = seen.measured
    return find_axis(corners, name=name)
