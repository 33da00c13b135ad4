"""Paper mode: from captures of a printed and a projected checkerboard to a rig, as in section 4.2.

`projected_corners` finds the projected corners, `projected_camera` and `projected_fit` solve as the
paper does, `projected_record` keeps it. The joint model (`solve`) needs no projected checkerboard
and is better; this one is for repeating the paper, and for seeing by how much.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fringeworks.calibrate.boards.corners import find_board, square_sizes
from fringeworks.calibrate.boards.found import FoundCorners
from fringeworks.calibrate.judge.checks import LEAST_VIEWS, enough_views
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.projected.camera import PosedView
from fringeworks.calibrate.projected.corners import find_projected
from fringeworks.calibrate.projected.fit import fit_paper
from fringeworks.calibrate.projected.record import rig_of
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.calibrate.solve import same_sizes
from fringeworks.errors import CalibrationError, DecodeError, FormatError
from fringeworks.model import Capture, ProjectorMap, Rig, Target, corners_at
from fringeworks.phase.decode import decode_phases


def calibrate_paper(
    captures: Iterable[Capture],
    board: Target,
    *,
    settings: CalibrationSettings | None = None,
) -> Rig:
    """Calibrate the paper's way.

    Parameters
    ----------
    captures
        Each with a white frame and a projected checkerboard; one at a time is enough. Both axes
        coded tell which of the projected corners is which, else all of them must be in view.
    board
        The printed one, with its measured pitch.
    settings
        Of these `camera_free`, `projector_free` and `trim_sigmas` count; focal lengths and
        principal points are always free.

    Returns
    -------
    rig
        With `quality` over the kept corners, printed in the camera and projected in the projector,
        and a record in ``further["calibration"]`` (`projected_record.make_record`).

    Raises
    ------
    CalibrationError
        Fewer than three captures give a view (each failure is listed), their sizes differ, or as
        `projected_fit.fit_paper`.
    """
    settings = settings or CalibrationSettings()
    views: list[PosedView] = []
    failed: list[tuple[str, str]] = []
    sizes: tuple[ImageSize, ImageSize] | None = None
    for capture in captures:
        sizes = same_sizes(capture, sizes)
        try:
            views.append(observe_projected(capture, board))
        except CalibrationError as error:
            failed.append((capture.name, str(error).removeprefix(f"{capture.name}: ")))
        del capture  # the next one is read before the loop's name is bound anew
    if sizes is None:
        raise CalibrationError(f"no captures: at least {LEAST_VIEWS} poses of the board are needed")
    enough_views([view.printed for view in views], failed)
    return rig_of(fit_paper(views, sizes, settings), sizes, (board, settings, failed))


def observe_projected(capture: Capture, board: Target) -> PosedView:
    """Find the printed corners in a capture's white frame, and the projected ones on the board.

    Raises
    ------
    CalibrationError
        Naming the capture: it has no white frame, the board is not found, or as `find_projected`.
    """
    capture = capture.select()
    white = capture.white()
    if white is None:
        raise CalibrationError(
            f"{capture.name}: no white frame, in which --model paper looks for the printed board "
            "and by which it divides the projected one: add a set of kind uniform with level 1"
        )
    try:
        found = find_board(white, board)
    except CalibrationError as error:
        raise CalibrationError(f"{capture.name}: {error} (looked at the white frame)") from None
    smallest = float(np.nanmin(square_sizes(found.on_board(board), board)))
    projected = find_projected(capture, (found.pixels, smallest), _decoded(capture))
    return PosedView(_printed(capture, board, found), projected)


def _decoded(capture: Capture) -> ProjectorMap | None:
    """The capture's maps, where they code both axes: they only tell which corner is which."""
    try:
        projector_map = decode_phases(capture).projector_map()
    except (DecodeError, FormatError):
        return None
    return projector_map if len(projector_map.axes) == 2 else None


def _printed(capture: Capture, board: Target, found: FoundCorners) -> View:
    """The printed corners; nothing says where they lie in the projector."""
    void = np.full((len(found.index), 2), np.nan)
    return View(
        name=capture.name,
        board_mm=corners_at(board, capture.sensor.temperature_c)[found.index],
        camera_px=found.pixels,
        projector_px=void,
        camera_sigma_px=found.sigma,
        projector_sigma_px=void,
        reasons=found.reasons,
    )
