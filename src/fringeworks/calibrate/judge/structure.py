"""Whether what a calibration leaves of the sites has a structure, and where it stays put.

Noise errs site by site. A board that is not flat, a lens beyond the model or a projector that
drifted move whole regions alike, far below what a single site tells: means over cells of many
sites then scatter more than those sites let them. Cells are laid in each view by itself, which
says whether there is anything; and over all views together on the board, in the camera's image
and in the projector's, which says what it belongs to. It is seen even where all views agree, when
two halves of them (`halves`) are wrong alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.board_shape import BoardFrame, cut_rays
from fringeworks.calibrate.adjust.projection import project_sites
from fringeworks.calibrate.adjust.spread import robust_sigma
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.observe import View
from fringeworks.errors import CalibrationError
from fringeworks.geometry.lens import pixel_rays
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Finding

Array = NDArray[np.float64]

CELLS_IN_VIEW = 4
"""Each way over the board, in one view; over all views together there are `CELLS`."""

CELLS = 8
LEAST_IN_CELL = 5
BOUND = 3.0
"""Standard deviations at which a site is clipped, so that a wrong code does not speak for many."""

LARGEST_IN_VIEWS = 1.6
"""Fourteen views of the twin's board have 0.9 to 1.2, bowed by 0.12 mm 3.1, of a lens with a pupil
that moves by 5 mm 2.3 to 3.1."""

BOARD_ABOVE = 1.5
"""By how much the ratio on the board must exceed both images' to be the board's doing: 3 with the
bow, 0.6 to 0.8 with the lens."""


@dataclass(frozen=True, slots=True)
class Structure:
    """Variance of cells' means over what their sites' scatter lets them have: one without any.

    `in_views` is over cells of the board in each view, the others over all views together.
    """

    in_views: float
    on_board: float
    in_camera: float
    in_projector: float

    @property
    def finding(self) -> Finding | None:
        """A warning where sites err together by more than chance has them."""
        if self.in_views <= LARGEST_IN_VIEWS:
            return None
        board = self.on_board > BOARD_ABOVE * max(self.in_camera, self.in_projector)
        what, remedy = BOARD if board else DEVICES
        return Finding(
            "warning",
            "the decoded coordinates err together over whole regions: means over sixteenths of "
            f"the board have {self.in_views:.1f} times the variance that scatter gives them, "
            f"{what}.",
            remedy,
            name="regional errors",
            where="board" if board else "rig",
        )


BOARD = (
    "always at the same places of the board: it is not the surface that it is taken for",
    "Mount it on something stiff, or solve for its shape (--board-shape paraboloid).",
)
DEVICES = (
    "at no fixed places of the board: a lens beyond the model, or something that moved",
    "Take deviations of smooth shape for the rig's, calibrate at the depth that you measure, and "
    "try a residual field (--residual auto).",
)


def find_structure(state: RigState, views: Sequence[View]) -> Structure:
    """Look for structure in what a solution leaves of the sites.

    Parameters
    ----------
    state
        The solution from all `views`, in their order.

    Raises
    ------
    CalibrationError
        No cell has five sites.
    """
    frame = BoardFrame.of(view.board_mm for view in views)
    residuals, boards = [], []
    for view, pose in zip(views, state.camera_from_board, strict=True):
        sites = view.sites
        seen = project_sites(state, pose, (sites.camera_px, frame))[0]
        residuals.append(sites.projector_px - seen)
        boards.append(_on_board(state, pose, (sites.camera_px, frame)))
    score = _scores(np.concatenate(residuals))
    board = np.concatenate(boards)
    view_of = np.repeat(np.arange(len(views)), [len(part) for part in boards])
    camera = np.concatenate([view.sites.camera_px for view in views])
    projector = np.concatenate([view.sites.projector_px for view in views])
    in_view = lay_cells(board, CELLS_IN_VIEW) + CELLS_IN_VIEW**2 * view_of
    return Structure(
        in_views=_excess(score, in_view),
        on_board=_excess(score, lay_cells(board, CELLS)),
        in_camera=_excess(score, lay_cells(camera, CELLS)),
        in_projector=_excess(score, lay_cells(projector, CELLS)),
    )


def _on_board(state: RigState, pose: Array, sites: tuple[Array, BoardFrame]) -> Array:
    """``(m, 2)`` mm: where the board is that camera pixels ``(m, 2)`` see."""
    pixels, frame = sites
    rays = pixel_rays(pixels, state.camera)
    turn, shift = rotation_matrix(pose[:3]), pose[3:]
    depth, _ = cut_rays(rays, np.vstack([turn, shift]), (frame, state.board_shape))
    return np.asarray(((rays * depth[:, None] - shift) @ turn)[:, :2])


def _scores(residuals: Array) -> Array:
    """``(m, 2)``, each coordinate with a mean square of one."""
    sigma = np.array([robust_sigma(part) for part in residuals.T])
    clipped = np.clip(residuals / sigma, -BOUND, BOUND)
    return np.asarray(clipped / np.sqrt(np.mean(clipped**2, axis=0)))


def lay_cells(places: Array, across: int) -> NDArray[np.intp]:
    """``(m,)`` which of `across` times `across` equal cells over all places each one is in."""
    low, high = places.min(axis=0), places.max(axis=0)
    cell = np.minimum((places - low) / (high - low) * across, across - 1).astype(np.intp)
    return np.asarray(cell[:, 0] * across + cell[:, 1])


def _excess(score: Array, cell: NDArray[np.intp]) -> float:
    """Mean over cells of n times the squared mean of their n scores: one for noise."""
    count = np.bincount(cell)
    full = count >= LEAST_IN_CELL
    if not full.any():
        raise CalibrationError("too few sites to look for structure: no cell has five of them")
    sums = np.stack([np.bincount(cell, part)[full] for part in score.T], axis=1)
    return float(np.mean(sums**2 / count[full, None]))
