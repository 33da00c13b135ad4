"""Joint refinement of both lenses, their relative pose, the board's poses and its shape.

The cost is the sum over the corners of (measured minus projected camera px)^2 and over the sites
of (decoded minus projected projector px)^2, see `projection`, whitened by standard deviations,
with Huber's loss, an analytic Jacobian, and a prior that holds the decentring near zero. The
corners fix scale and the boards' poses; what a corner's place errs by does not enter the
projector's. How well the corners fit in the projector is told, as everybody tells it, but not
minimised.

The standard deviations are taken from the residuals, per class (corners, sites), since what a
board leaves is more its print and its flatness than noise: once from the start's, which may be
poor, and again from those of each solution.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.board_shape import BoardFrame
from fringeworks.calibrate.adjust.covariance import Covariance
from fringeworks.calibrate.adjust.projection import (
    corners_in_projector,
    project_corners,
    project_sites,
)
from fringeworks.calibrate.adjust.spread import Spread, robust_sigma, total_sigma
from fringeworks.calibrate.adjust.state import (
    DECENTRING,
    SHARED,
    RigState,
    free_indices,
    parameter_names,
    pose_columns,
)
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.calibrate.sites import together
from fringeworks.geometry.minimise import FIRST_DAMPING, NEAR_DAMPING, Block, Minimum, minimise

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

ROUNDS = 3
"""From a poor start the first round has the residuals weighed down against `_decentring_prior`."""

BOUND = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """What a state leaves of a view, measured minus computed px, of kept corners and sites.

    `corners` is ``(n, 4)``: camera x, y and projector x, y. `sites` is ``(m, 2)``.
    """

    corners: Array
    sites: Array


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A refined state with what it leaves, view by view, and how well it is known."""

    state: RigState
    residuals: tuple[Residuals, ...]
    spread: Spread
    converged: bool
    covariance: Covariance | None = None

    @property
    def corners(self) -> list[Array]:
        """Per view ``(n, 4)`` residuals of its kept corners, px."""
        return [part.corners for part in self.residuals]


def refine(
    state: RigState,
    views: Sequence[View],
    settings: CalibrationSettings,
    *,
    poses_only: bool = False,
    rounds: int = ROUNDS,
    near: bool = False,
) -> Fit:
    """Refine a start with all kept corners and the sites of all views.

    Parameters
    ----------
    state
        The start; what `settings` does not free keeps its value.
    views
        In the order of `state.camera_from_board`.
    poses_only
        Whether the rig is known, and only the boards move.
    rounds
        How often at most it is solved, each time with the weights that the last solution shows.
    near
        Whether the start is a solution of all but the same: fewer steps, the same minimum.
    """
    free = free_indices(settings, len(views))
    free = free[free >= SHARED] if poses_only else free
    fit = _fit_of(state, views, converged=False)
    damping = NEAR_DAMPING if near else FIRST_DAMPING
    for _ in range(rounds):
        problem = _Problem.of(fit, views, (free, settings))
        minimum = minimise(problem.blocks, problem.start, huber=settings.huber, damping=damping)
        damping = NEAR_DAMPING  # the next round starts where this one ended
        before = fit.spread
        fit = _fit_of(problem.state_at(minimum.parameters), views, converged=minimum.converged)
        if fit.spread.near(before):
            break
    return replace(fit, covariance=_covariance(problem, minimum, settings.huber))


def all_residuals(state: RigState, views: Sequence[View]) -> list[Array]:
    """Per view ``(n, 4)`` residuals, px, of all its corners, left out or not; NaN where void."""
    frame = _frame(views)
    out = []
    for view, pose in zip(views, state.camera_from_board, strict=True):
        corners = (view.board_mm, frame)
        seen = (
            project_corners(state, pose, corners)[0],
            corners_in_projector(state, pose, corners),
        )
        out.append(view.pixels - np.concatenate(seen, axis=1))
    return out


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


def _frame(views: Sequence[View]) -> BoardFrame:
    return BoardFrame.of(view.board_mm for view in views)


def _view_block(state: RigState, index: int, seen: tuple[View, BoardFrame]) -> Block:
    """Residuals of a view, px, with their derivatives by shared parameters and its own pose."""
    view, frame = seen
    pose, kept, sites = state.camera_from_board[index], view.kept, view.sites
    corners, corner_jacobian = project_corners(state, pose, (view.board_mm[kept], frame))
    decoded, site_jacobian = project_sites(state, pose, (sites.camera_px, frame))
    residuals = np.concatenate([view.camera_px[kept] - corners, sites.projector_px - decoded])
    jacobian = np.concatenate([corner_jacobian, site_jacobian])
    columns = np.concatenate([np.arange(SHARED), pose_columns(index)]).astype(np.intp)
    return residuals.ravel(), -jacobian.reshape(-1, jacobian.shape[-1]), columns


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """One round: what is whitened by which weights, and which parameters move."""

    full: Array
    free: Indices
    views: Sequence[View]
    weights: Sequence[Array]
    decentring_sigma: float

    @classmethod
    def of(
        cls, fit: Fit, views: Sequence[View], choices: tuple[Indices, CalibrationSettings]
    ) -> _Problem:
        free, settings = choices
        return cls(
            full=fit.state.vector,
            free=free,
            views=views,
            weights=_weights(fit.spread, views),
            decentring_sigma=settings.decentring_sigma,
        )

    @property
    def start(self) -> Array:
        return self.full[self.free]

    def state_at(self, values: Array) -> RigState:
        vector = self.full.copy()
        vector[self.free] = values
        return RigState.from_vector(vector)

    def blocks(self, values: Array) -> Iterator[Block]:
        place = np.full(len(self.full), -1, dtype=np.intp)  # of each parameter among the free
        place[self.free] = np.arange(len(self.free))
        state = self.state_at(values)
        frame = _frame(self.views)
        for index, (view, weight) in enumerate(zip(self.views, self.weights, strict=True)):
            residuals, jacobian, columns = _view_block(state, index, (view, frame))
            moving = place[columns] >= 0
            yield (
                residuals * weight,
                jacobian[:, moving] * weight[:, None],
                place[columns[moving]],
            )
        held = place[DECENTRING]
        held = held[held >= 0]
        yield (
            values[held] / self.decentring_sigma,
            np.eye(len(held)) / self.decentring_sigma,
            held,
        )


def _fit_of(state: RigState, views: Sequence[View], *, converged: bool) -> Fit:
    frame = _frame(views)
    residuals = []
    for index, (view, corners) in enumerate(zip(views, all_residuals(state, views), strict=True)):
        sites = view.sites
        seen = project_sites(state, state.camera_from_board[index], (sites.camera_px, frame))[0]
        residuals.append(Residuals(corners[view.kept], sites.projector_px - seen))
    return Fit(state, tuple(residuals), _spread(residuals, views), converged)


def _spread(residuals: Sequence[Residuals], views: Sequence[View]) -> Spread:
    corners = np.concatenate([part.corners for part in residuals])
    sites = robust_sigma(np.concatenate([part.sites for part in residuals]))
    # clipped, so that wrong codes and folds, which Huber holds back, do not speak for all
    alike = [
        together(np.clip(part.sites / sites, -BOUND, BOUND), view.sites.camera_px)
        for part, view in zip(residuals, views, strict=True)
    ]
    return Spread(
        camera=robust_sigma(corners[:, :2]),
        projector=robust_sigma(corners[:, 2:]),
        sites=sites,
        together=max(float(np.mean(alike)), 1.0),
    )


def _weights(spread: Spread, views: Sequence[View]) -> list[Array]:
    """Per view one over the standard deviation of each residual, ordered like them."""
    corners = total_sigma([view.camera_sigma_px[view.kept] for view in views], spread.camera)
    sites = total_sigma([view.sites.sigma_px for view in views], spread.sites)
    alike = np.sqrt(spread.together)
    return [
        1 / np.concatenate([corner, site * alike]).ravel()
        for corner, site in zip(corners, sites, strict=True)
    ]


def _covariance(problem: _Problem, minimum: Minimum, huber: float) -> Covariance | None:
    """None where the normal matrix has no inverse: the observations leave something open."""
    try:
        inverse = np.linalg.inv(minimum.normal)
    except np.linalg.LinAlgError:
        return None
    blocks = list(problem.blocks(minimum.parameters))[:-1]
    whitened = np.minimum(np.abs(np.concatenate([residuals for residuals, _, _ in blocks])), huber)
    freedom = len(whitened) - len(inverse)
    names = np.array(parameter_names([view.name for view in problem.views]), dtype=object)
    return Covariance(
        names=tuple(names[problem.free]),
        matrix=np.asarray((inverse + inverse.T) / 2, dtype=np.float64),
        degrees_of_freedom=freedom,
        sigma0=float(np.sqrt(np.sum(whitened**2) / max(freedom, 1))),
    )
