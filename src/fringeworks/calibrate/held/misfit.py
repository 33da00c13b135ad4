"""By how much one view of a board misses a known rig.

The board's pose comes from the camera alone. Where the projector's coordinates then miss is split
along the epipolar lines, which is depth, and across them, which no surface explains.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.board_shape import BoardFrame, cut_rays
from fringeworks.calibrate.adjust.projection import project_corners
from fringeworks.calibrate.adjust.spread import robust_sigma
from fringeworks.calibrate.adjust.state import SHARED, RigState
from fringeworks.calibrate.observe import View
from fringeworks.errors import CalibrationError
from fringeworks.geometry.lens import pixel_rays, project_jacobian, unproject
from fringeworks.geometry.minimise import Block, minimise
from fringeworks.geometry.pose import rotation_matrix, rotation_vector
from fringeworks.model import Rig

Array = NDArray[np.float64]

OUTLIER_SIGMAS = 6.0
LARGEST_SHARE = 0.1
"""Of the corners that may stand apart; more of them are what there is to see."""

HUBER_PX = 0.5
LEAST_CORNERS = 8
NEWTON_STEPS = 4
"""Of a triangulation that starts on the board; a miss of 30 px needs three to a nanometre."""


@dataclass(frozen=True, slots=True)
class Misfit:
    """By how much a view misses a rig, px.

    Attributes
    ----------
    camera_rms_px, projector_rms_px
        Root mean squared distance of the corners from where the rig has them.
    along_px, across_px
        Mean of the projector's misses along and across the epipolar lines.
    """

    camera_rms_px: float
    projector_rms_px: float
    along_px: float
    across_px: float

    def within(self, limits: Misfit) -> bool:
        """Whether no number is beyond its limit."""
        pairs = zip(astuple(self), astuple(limits), strict=True)
        return all(abs(value) <= limit for value, limit in pairs)


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A view of k corners that fit each other, held against a rig.

    Attributes
    ----------
    view
        With the corners left out that do not fit the others.
    state
        The rig, with the board's pose.
    board
        ``(k, 3)`` where the corners' rays meet the board, mm, camera frame.
    measured
        ``(k, 3)`` where the rig triangulates them, on the camera's rays.
    camera, projector
        ``(k, 2)`` measured minus computed px.
    along, across
        ``(k,)`` the latter along and across the epipolar lines; along grows with depth.
    """

    view: View
    state: RigState
    board: Array
    measured: Array
    camera: Array
    projector: Array
    along: Array
    across: Array

    @property
    def misfit(self) -> Misfit:
        return Misfit(
            camera_rms_px=_rms(self.camera),
            projector_rms_px=_rms(self.projector),
            along_px=float(self.along.mean()),
            across_px=float(self.across.mean()),
        )


def hold_against(view: View, rig: Rig) -> Seen:
    """Hold a view against a rig without the corners that stand apart: a curl, a wrong code.

    Raises
    ------
    CalibrationError
        Fewer than eight corners, or they are no image of a board.
    """
    if view.kept.sum() < LEAST_CORNERS:
        raise CalibrationError(
            f"{view.name}: {view.kept.sum()} corners can be used, {LEAST_CORNERS} are needed"
        )
    seen = _hold(view, rig)
    # what the misses have in common is what is looked for, so only a corner apart is left out
    apart = seen.projector - np.median(seen.projector, axis=0)
    far = np.zeros(len(apart), dtype=np.bool_)
    for coordinate in (*seen.camera.T, *apart.T):
        far |= np.abs(coordinate) > OUTLIER_SIGMAS * robust_sigma(coordinate)
    if not 0 < far.mean() <= LARGEST_SHARE or len(far) - far.sum() < LEAST_CORNERS:
        return seen
    reasons = np.array(view.reasons, dtype=object)
    reasons[np.flatnonzero(view.kept)[far]] = "does not fit the other corners"
    return _hold(replace(view, reasons=tuple(reasons)), rig)


def _hold(view: View, rig: Rig) -> Seen:
    state = _placed(view, rig)
    pose, frame = state.camera_from_board[0], BoardFrame.of([view.board_mm])
    corners, _ = project_corners(state, pose, (view.board_mm[view.kept], frame))
    sites = view.corner_sites
    rays = pixel_rays(sites.camera_px, state.camera)
    turn = np.vstack([rotation_matrix(pose[:3]), pose[3:]])
    depth, _ = cut_rays(rays, turn, (frame, state.board_shape))
    board = rays * depth[:, None]
    pixels, slope = _in_projector(state, rig, board)
    missed = sites.projector_px - pixels
    line = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    return Seen(
        view=view,
        state=state,
        board=board,
        measured=_triangulate(state, rig, (board, sites.projector_px)),
        camera=view.camera_px[view.kept] - corners,
        projector=missed,
        along=np.sum(missed * line, axis=1),
        across=missed[:, 1] * line[:, 0] - missed[:, 0] * line[:, 1],
    )


def _in_projector(state: RigState, rig: Rig, points: Array) -> tuple[Array, Array]:
    """``(k, 2)`` px of points, camera frame, and by how much it moves per mm of depth."""
    pose = rig.projector_from_camera
    pixels, by_point, _ = project_jacobian(pose.apply(points), state.projector)
    rays = points / points[:, 2:]
    return pixels, np.einsum("kij,kj->ki", by_point, rays @ pose.rotation.T)


def _triangulate(state: RigState, rig: Rig, seen: tuple[Array, Array]) -> Array:
    """``(k, 3)`` points on the camera's rays whose projector px come nearest to those decoded."""
    points, projector_px = seen
    for _ in range(NEWTON_STEPS):
        pixels, slope = _in_projector(state, rig, points)
        step = np.sum((projector_px - pixels) * slope, axis=1) / np.sum(slope**2, axis=1)
        points = points * (1 + step / points[:, 2])[:, None]
    return points


def _placed(view: View, rig: Rig) -> RigState:
    """The rig with the board where the camera's corners have it, by Huber's loss."""
    kept = view.kept
    frame, board, pixels = BoardFrame.of([view.board_mm]), view.board_mm[kept], view.camera_px[kept]
    state = RigState(
        rig.camera.lens.vector,
        rig.projector.lens.vector,
        np.concatenate(
            [
                rotation_vector(rig.projector_from_camera.rotation),
                rig.projector_from_camera.translation_mm,
            ]
        ),
        _first_pose(view, rig)[None],
    )

    def model(pose: Array) -> Iterator[Block]:
        seen, jacobian = project_corners(state, pose, (board, frame))
        yield (pixels - seen).ravel(), -jacobian[..., SHARED:].reshape(-1, 6), np.arange(6)

    minimum = minimise(model, state.camera_from_board[0], huber=HUBER_PX)
    return replace(state, camera_from_board=minimum.parameters[None])


def _first_pose(view: View, rig: Rig) -> Array:
    """``(6,)`` pose of the plane from its homography."""
    kept = view.kept
    ideal = unproject(view.camera_px[kept], rig.camera.lens.vector)
    found = False
    if np.isfinite(ideal).all():
        found, turn, shift = cv2.solvePnP(
            view.board_mm[kept], ideal, np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_IPPE
        )
    if not found:
        raise CalibrationError(
            f"{view.name}: the camera's corners give no pose of the board: is this the rig that "
            "the capture was taken with?"
        )
    return np.concatenate([np.ravel(turn), np.ravel(shift)]).astype(np.float64)


def _rms(residuals: Array) -> float:
    """Root mean squared length of ``(k, 2)``."""
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))
