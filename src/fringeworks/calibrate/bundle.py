"""Joint refinement of both lenses, their relative pose and the board poses.

Residuals are measured minus projected pixels of every kept corner in both devices, whitened by
their standard deviations, with Huber's loss and an analytic Jacobian. The standard deviations
are taken from the residuals themselves, per device, since what a board leaves is more its print
than the corners' noise: once from the start's, which may be poor, and once from those of that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.local_fit import MAD_TO_SIGMA
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.geometry.lens import LENS_NAMES, project_jacobian
from fringeworks.geometry.minimise import Block, minimise
from fringeworks.geometry.pose import rotate_jacobian, rotation_matrix

Array = NDArray[np.float64]

ROUNDS = 3
"""From a poor start the first round has the residuals weighed down against `_decentring_prior`."""

SMALLEST_SIGMA_PX = 1e-4
_LENS = len(LENS_NAMES)
_POSE = 6
_SHARED = 2 * _LENS + _POSE
_DECENTRING = [start + LENS_NAMES.index(name) for start in (0, _LENS) for name in ("p1", "p2")]


@dataclass(frozen=True, slots=True, eq=False)
class RigState:
    """Everything the refinement can move.

    Lenses are ``(9,)`` as in `geometry.lens`. Poses are ``(6,)``: rotation vector, rad, and
    translation, mm; `camera_from_board` is ``(views, 6)``.
    """

    camera: Array
    projector: Array
    projector_from_camera: Array
    camera_from_board: Array

    @property
    def vector(self) -> Array:
        """``(24 + 6 views,)``: camera, projector, relative pose, board poses."""
        parts = (self.camera, self.projector, self.projector_from_camera)
        return np.concatenate([*parts, self.camera_from_board.ravel()])

    @classmethod
    def from_vector(cls, vector: Array) -> RigState:
        return cls(
            camera=vector[:_LENS],
            projector=vector[_LENS : 2 * _LENS],
            projector_from_camera=vector[2 * _LENS : _SHARED],
            camera_from_board=vector[_SHARED:].reshape(-1, _POSE),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A refined state with its residuals.

    `residuals` holds per view ``(n, 4)`` measured minus projected px of all kept corners: camera
    x, y and projector x, y. `sigma_px` is the standard deviation of a coordinate that the
    residuals showed, camera and projector.
    """

    state: RigState
    residuals: tuple[Array, ...]
    sigma_px: tuple[float, float]
    converged: bool


def free_indices(settings: CalibrationSettings, views: int) -> NDArray[np.intp]:
    """Indices into `RigState.vector` of the parameters that move."""
    camera = [LENS_NAMES.index(name) for name in LENS_NAMES if name in settings.camera_free]
    projector = [
        _LENS + LENS_NAMES.index(name) for name in LENS_NAMES if name in settings.projector_free
    ]
    poses = range(2 * _LENS, _SHARED + _POSE * views)
    return np.array([*camera, *projector, *poses], dtype=np.intp)


def refine(state: RigState, views: Sequence[View], settings: CalibrationSettings) -> Fit:
    """Refine a start with all kept corners of all views.

    Parameters
    ----------
    state
        The start; what `settings` does not free keeps its value.
    views
        In the order of `state.camera_from_board`.
    """
    free = free_indices(settings, len(views))
    fit = _fit_of(state, views, converged=False)
    for _ in range(ROUNDS):
        fit = _solve(fit, views, (free, settings))
    return fit


def residuals_and_jacobian(state: RigState, views: Sequence[View]) -> tuple[Array, Array]:
    """``(m,)`` residuals, px, of all kept corners and ``(m, parameters)`` their derivatives.

    Rows: view by view, corner by corner, camera x, y and projector x, y. Columns follow
    `RigState.vector`.
    """
    parts = [_view_block(state, index, view) for index, view in enumerate(views)]
    jacobian = np.zeros((sum(len(part[0]) for part in parts), len(state.vector)))
    row = 0
    for residuals, derivative, columns in parts:
        jacobian[row : row + len(residuals), columns] = derivative
        row += len(residuals)
    return np.concatenate([residuals for residuals, _, _ in parts]), jacobian


def _view_block(state: RigState, index: int, view: View) -> Block:
    """Residuals of a view, px, with their derivatives by shared parameters and its own pose."""
    projected, jacobian = _project_view(state, index, view.board_mm[view.kept])
    residuals = view.pixels[view.kept] - projected
    own = np.arange(_SHARED + _POSE * index, _SHARED + _POSE * (index + 1))
    columns = np.concatenate([np.arange(_SHARED), own]).astype(np.intp)
    return residuals.ravel(), -jacobian.reshape(-1, jacobian.shape[-1]), columns


def all_residuals(state: RigState, views: Sequence[View]) -> list[Array]:
    """Per view ``(n, 4)`` residuals, px, of all its corners, left out or not; NaN where void."""
    return [
        view.pixels - _project_view(state, index, view.board_mm)[0]
        for index, view in enumerate(views)
    ]


def rms_px(residuals: Sequence[Array]) -> tuple[float, float, float]:
    """Root mean squared distance per point, px: camera, projector, and both together.

    Takes ``(n, 4)`` residuals per view; rows with NaN do not count.
    """
    stacked = np.concatenate(residuals)
    squares = stacked[np.isfinite(stacked).all(axis=1)] ** 2
    camera, projector = squares[:, :2].sum(axis=1), squares[:, 2:].sum(axis=1)
    camera_rms, projector_rms, joint_rms = np.sqrt(
        [camera.mean(), projector.mean(), (camera + projector).mean() / 2]
    )
    return float(camera_rms), float(projector_rms), float(joint_rms)


def _project_view(state: RigState, index: int, board: Array) -> tuple[Array, Array]:
    """``(n, 4)`` px of board points in camera and projector, and ``(n, 4, 24 + 6)``.

    The derivative's columns are the shared parameters and the view's own pose.
    """
    in_camera, by_board = _move(state.camera_from_board[index], board)
    in_projector, by_relation = _move(state.projector_from_camera, in_camera)
    camera, camera_by_point, camera_by_lens = project_jacobian(in_camera, state.camera)
    projector, projector_by_point, projector_by_lens = project_jacobian(
        in_projector, state.projector
    )
    turn = rotation_matrix(state.projector_from_camera[:3])
    jacobian = np.zeros((len(board), 4, _SHARED + _POSE))
    jacobian[:, :2, :_LENS] = camera_by_lens
    jacobian[:, :2, _SHARED:] = camera_by_point @ by_board
    jacobian[:, 2:, _LENS : 2 * _LENS] = projector_by_lens
    jacobian[:, 2:, 2 * _LENS : _SHARED] = projector_by_point @ by_relation
    jacobian[:, 2:, _SHARED:] = projector_by_point @ turn @ by_board
    return np.concatenate([camera, projector], axis=1), jacobian


def _move(pose: Array, points: Array) -> tuple[Array, Array]:
    """Points ``(n, 3)`` moved by a pose, and ``(n, 3, 6)`` by its parameters."""
    rotated, by_rotation = rotate_jacobian(pose[:3], points)
    by_translation = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return rotated + pose[3:], np.concatenate([by_rotation, by_translation], axis=2)


def _solve(
    fit: Fit, views: Sequence[View], choices: tuple[NDArray[np.intp], CalibrationSettings]
) -> Fit:
    """One round: whiten by the residuals of `fit`, solve, and measure the residuals anew."""
    free, settings = choices
    weights = _weights(fit.sigma_px, views)
    full = fit.state.vector
    place = np.full(len(full), -1, dtype=np.intp)  # of each parameter among the free ones
    place[free] = np.arange(len(free))

    def state_at(values: Array) -> RigState:
        vector = full.copy()
        vector[free] = values
        return RigState.from_vector(vector)

    def model(values: Array) -> Iterator[Block]:
        state = state_at(values)
        for index, (view, weight) in enumerate(zip(views, weights, strict=True)):
            residuals, jacobian, columns = _view_block(state, index, view)
            moving = place[columns] >= 0
            yield (
                residuals * weight,
                jacobian[:, moving] * weight[:, None],
                place[columns[moving]],
            )
        yield _decentring_prior(values, place, settings)

    minimum = minimise(model, full[free], huber=settings.huber)
    return _fit_of(state_at(minimum.parameters), views, converged=minimum.converged)


def _decentring_prior(
    values: Array, place: NDArray[np.intp], settings: CalibrationSettings
) -> Block:
    """p1 and p2 of both lenses are zero to within `settings.decentring_sigma`."""
    free, sigma = place[_DECENTRING], settings.decentring_sigma
    free = free[free >= 0]
    return values[free] / sigma, np.eye(len(free)) / sigma, free


def _fit_of(state: RigState, views: Sequence[View], *, converged: bool) -> Fit:
    residuals = [
        part[view.kept] for part, view in zip(all_residuals(state, views), views, strict=True)
    ]
    stacked = np.concatenate(residuals)
    sigma = (_robust_sigma(stacked[:, :2]), _robust_sigma(stacked[:, 2:]))
    return Fit(state, tuple(residuals), sigma, converged)


def _robust_sigma(residuals: Array) -> float:
    """Standard deviation of a coordinate by its median absolute residual, px."""
    return max(MAD_TO_SIGMA * float(np.median(np.abs(residuals))), SMALLEST_SIGMA_PX)


def _weights(sigma_px: tuple[float, float], views: Sequence[View]) -> list[Array]:
    """Per view ``(4 n,)``: 1 / standard deviation of its residuals, flattened like them.

    The variance is the observation's own plus what the device's residuals show beyond the median
    of those: where the print of the board dominates, all corners of a device weigh the same. Where
    they show less, the observations' own are scaled down: else Huber's bound would be too far.
    """
    own = [
        np.concatenate([view.camera_sigma_px, view.projector_sigma_px], axis=1)[view.kept]
        for view in views
    ]
    typical = np.median(np.concatenate(own), axis=0)
    shown = np.repeat(np.asarray(sigma_px), 2)
    scale = np.minimum(shown / typical, 1.0)
    excess = np.maximum(shown**2 - typical**2, 0)
    return [1 / np.sqrt((part * scale) ** 2 + excess).ravel() for part in own]
