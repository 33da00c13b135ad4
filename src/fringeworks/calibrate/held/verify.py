"""Whether a rig still holds: one new view of a board, beside what the calibration's views have.

The same numbers of those views, from the rig's record, say what is usual, whatever the board is
like; a rig without a record, or of paper mode, is judged by fixed limits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.held.misfit import Misfit, Seen, hold_against
from fringeworks.calibrate.held.moved import Explanation, explain
from fringeworks.calibrate.observe import View, observe_board
from fringeworks.calibrate.projected.record import model_of
from fringeworks.calibrate.record import read_record
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.errors import CalibrationError, ShapeError
from fringeworks.geometry.forms import fit_plane
from fringeworks.measure.board import BoardSpacing
from fringeworks.model import Capture, Finding, Rig, Target
from fringeworks.phase.decode import decode_capture

Array = NDArray[np.float64]

TIMES_USUAL = 3.0
"""More than so many times the rms of the calibration's own views is a move."""

SMALLEST_LIMIT_PX = 0.05
"""However well a calibration fits: a new place of the board and its flatness do as much."""

FITTED_VIEWS = 2
"""Of n views so many say little: what a rig solved from them leaves is widened by n / (n - 2).
Three views of procam-half are fitted to 0.06 px in the projector, the fourth then has 0.2 px."""

FIXED_LIMIT_PX = 0.3
FAR_BEYOND_PX = 50.0
"""Beyond it nothing has moved: it is another rig, or another board."""


@dataclass(frozen=True, slots=True, eq=False)
class Verification:
    """What one view says about a rig.

    Attributes
    ----------
    name
        Of the capture.
    misfit, limits
        What was found, and what would be too much; `limits_from` says in words whence.
    epipolar_rms_px
        Root mean square of the misses across the epipolar lines.
    depth_error_mm
        Mean of measured minus true depth, z of the camera's frame, as the camera alone has the
        board: what the miss along the epipolar lines means.
    squares_mean_mm, squares_sd_mm
        Distances of neighbouring triangulated corners, and how they scatter about the pitch.
    scale
        Mean share by which they are longer than on the board.
    plane_rms_mm
        Root mean square distance of the triangulated corners from their plane.
    seen
        Corner by corner.
    moved
        Which part moved; None where the rig holds.
    """

    name: str
    misfit: Misfit
    limits: Misfit
    limits_from: str
    epipolar_rms_px: float
    depth_error_mm: float
    squares_mean_mm: float
    squares_sd_mm: float
    scale: float
    plane_rms_mm: float
    seen: Seen
    moved: Explanation | None

    @property
    def holds(self) -> bool:
        """Whether no number is beyond its limit."""
        return self.moved is None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """That the rig has moved, with the error of depth as its cost; none where it holds."""
        if self.moved is None:
            return ()
        remedy = "Calibrate again; look at what carries the part that is named."
        return (
            Finding(
                "warning",
                self.moved.sentence,
                remedy,
                name="rig moved",
                cost=abs(self.depth_error_mm),
                unit="mm",
                where=", ".join(cause.name for cause in self.moved.named) or "rig",
            ),
        )

    @property
    def verdict(self) -> str:
        return "holds" if self.holds else "has moved"


def verify_capture(capture: Capture, rig: Rig, board: Target) -> Verification:
    """Decode a capture of a board, find its corners, and hold them against a rig.

    Raises
    ------
    CalibrationError
        The board is not found, or as `observe_board` and `verify_view`.
    DecodeError
        Nothing can be decoded.
    ShapeError
        The camera's or the projector's image is not of the rig's size.
    """
    capture = capture.select()
    _refuse_other_sizes(capture, rig)
    settings = CalibrationSettings(dense=False)
    view = observe_board(capture, decode_capture(capture), board, settings=settings)
    return verify_view(view, rig, board)


def verify_view(view: View, rig: Rig, board: Target) -> Verification:
    """Hold a view of a board against a rig.

    Raises
    ------
    CalibrationError
        Too few corners, or they are so far off that this cannot be the rig or the board.
    FormatError
        The rig's record of its calibration is damaged.
    """
    seen = hold_against(view, rig)
    found = seen.misfit
    if not max(found.camera_rms_px, found.projector_rms_px) < FAR_BEYOND_PX:
        raise CalibrationError(
            f"{view.name}: the corners lie {found.camera_rms_px:.0f} px (camera) and "
            f"{found.projector_rms_px:.0f} px (projector) from where this rig would see them: it "
            "is another rig, or the pitch in board.toml is not that of this board"
        )
    limits, source = _limits(rig)
    weights = (limits.camera_rms_px, limits.projector_rms_px)
    squares, pitches = _squares(seen, board)
    return Verification(
        name=view.name,
        misfit=found,
        limits=limits,
        limits_from=source,
        epipolar_rms_px=float(np.sqrt(np.mean(seen.across**2))),
        depth_error_mm=float(np.mean(seen.measured[:, 2] - seen.board[:, 2])),
        squares_mean_mm=float(squares.mean()),
        squares_sd_mm=float((squares - pitches).std(ddof=1)),
        scale=float(np.mean(squares / pitches) - 1),
        plane_rms_mm=fit_plane(seen.measured).form_rms_mm,
        seen=seen,
        moved=None if found.within(limits) else explain(seen, weights),
    )


def _limits(rig: Rig) -> tuple[Misfit, str]:
    """What would be too much, px, and whence it is in words."""
    record = read_record(rig.further)
    if record is None or model_of(rig.further) == "paper":
        source = "fixed, since the rig has no record of corners that both devices see"
        return _limits_of(FIXED_LIMIT_PX, FIXED_LIMIT_PX), source
    found = [hold_against(entry.view, rig).misfit for entry in record.views]
    count = len(found)
    times = TIMES_USUAL * count / max(count - FITTED_VIEWS, 1)
    usual = np.sqrt(np.mean([(m.camera_rms_px**2, m.projector_rms_px**2) for m in found], axis=0))
    camera, projector = np.maximum(times * usual, SMALLEST_LIMIT_PX)
    source = (
        f"{times:.1f} times the rms of the {count} views of the calibration, half of it for "
        f"means, {SMALLEST_LIMIT_PX:g} px at least"
    )
    return _limits_of(float(camera), float(projector)), source


def _limits_of(camera: float, projector: float) -> Misfit:
    """A mean is what all corners have in common: half of what one corner may have."""
    mean = max(projector / 2, SMALLEST_LIMIT_PX)
    return Misfit(camera, projector, along_px=mean, across_px=mean)


def _squares(seen: Seen, board: Target) -> tuple[Array, Array]:
    """Distances of neighbouring corners, mm, as triangulated and as they are on the board."""
    grid = np.full((2, board.corner_count, 3), np.nan)
    grid[:, seen.view.kept] = seen.measured, seen.view.board_mm[seen.view.kept]
    measured, true = (
        BoardSpacing(part.reshape(board.rows, board.columns, 3)).all_mm for part in grid
    )
    if len(measured) < 2:
        raise CalibrationError(
            f"{seen.view.name}: no two pairs of neighbouring corners: show more of the board"
        )
    return measured, true


def _refuse_other_sizes(capture: Capture, rig: Rig) -> None:
    height, width = capture.shape
    shown = capture.sequence
    pairs = (
        ("camera", (width, height), (rig.camera.width, rig.camera.height)),
        ("projector", (shown.width, shown.height), (rig.projector.width, rig.projector.height)),
    )
    for name, size, known in pairs:
        if size != known:
            raise ShapeError(
                f"the capture's {name} must be {known[0]}x{known[1]} like the rig's, "
                f"got {size[0]}x{size[1]}"
            )
