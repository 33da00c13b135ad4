"""Which part of a rig moved: what one view misses, explained by one cause at a time.

Causes are directions in the rig's parameters: the projector turned about its centre, shifted,
zoomed, or the camera zoomed. They are small, so that one linear step from the rig as it was is the
whole fit; the board's pose is free in all of them. From one flat board two causes may look alike:
then both are named.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.board_shape import BoardFrame
from fringeworks.calibrate.adjust.projection import project_corners, project_sites
from fringeworks.calibrate.adjust.state import CAMERA, PROJECTOR, RELATION, SHARED, RigState
from fringeworks.calibrate.held.misfit import Seen
from fringeworks.geometry.pose import left_jacobian, skew

Array = NDArray[np.float64]

CLEARLY = 0.8
"""Share of the squared misses that a cause has to explain to be named."""

ALIKE = 2.0
"""A cause that leaves less than so many times what the best one leaves is named beside it."""

TURNED = "the projector turned"
SHIFTED = "the projector shifted"
CAMERA_ZOOM = "the camera's focal length changed"
PROJECTOR_ZOOM = "the projector's focal length changed"


@dataclass(frozen=True, slots=True)
class Cause:
    """One cause fitted alone.

    Attributes
    ----------
    name
        In words.
    explained
        Share of the squared misses, beyond what the board's pose takes up, that it explains.
    size
        Of a turn in rad, of a shift in mm, of a change of focal length its share, signed.
    unit
        ``rad``, ``mm`` or empty for a share.
    """

    name: str
    explained: float
    size: float
    unit: str


@dataclass(frozen=True, slots=True)
class Explanation:
    """All causes, best first, and those of them that explain the misses clearly."""

    causes: tuple[Cause, ...]
    named: tuple[Cause, ...]

    @property
    def sentence(self) -> str:
        """What to tell a person; relative to the camera, since nothing else is seen."""
        if not self.named:
            return "which part moved cannot be told from this view: no single cause explains it"
        if len(self.named) == 1:
            return f"{self.named[0].name} ({_told(self.named[0])})"
        listed = " or ".join(f"{cause.name} ({_told(cause)})" for cause in self.named)
        return f"{listed}: this view cannot tell them apart"


def explain(seen: Seen, sigmas: tuple[float, float]) -> Explanation:
    """Fit each cause alone to what a view misses.

    Parameters
    ----------
    sigmas
        Of camera and projector coordinates, px: they weigh the two against each other.
    """
    misses, jacobian = _linear(seen, sigmas)
    pose = jacobian[:, SHARED:]
    unexplained, _ = _solve(pose, misses)
    causes = []
    for name, (moves, unit) in directions(seen.state).items():
        rest, values = _solve(np.hstack([jacobian[:, :SHARED] @ moves, pose]), misses)
        steps = values[: moves.shape[1]]
        size = float(steps[0]) if len(steps) == 1 else float(np.linalg.norm(steps))
        causes.append((rest, Cause(name, float(1 - rest / unexplained), size, unit)))
    causes.sort(key=lambda pair: pair[0])
    most = ALIKE * causes[0][0]
    named = [cause for rest, cause in causes if cause.explained >= CLEARLY and rest <= most]
    return Explanation(tuple(cause for _, cause in causes), tuple(named))


def _linear(seen: Seen, sigmas: tuple[float, float]) -> tuple[Array, Array]:
    """Misses ``(m,)`` and their derivatives ``(m, SHARED + 6)``, over the standard deviations."""
    view, pose = seen.view, seen.state.camera_from_board[0]
    frame = BoardFrame.of([view.board_mm])
    _, corners = project_corners(seen.state, pose, (view.board_mm[view.kept], frame))
    _, sites = project_sites(seen.state, pose, (view.camera_px[view.kept], frame))
    misses = np.concatenate([seen.camera.ravel() / sigmas[0], seen.projector.ravel() / sigmas[1]])
    width = corners.shape[-1]
    derivatives = [corners.reshape(-1, width) / sigmas[0], sites.reshape(-1, width) / sigmas[1]]
    return misses, np.concatenate(derivatives)


def directions(state: RigState) -> Mapping[str, tuple[Array, str]]:
    """By name, how each cause moves the shared parameters, ``(SHARED, k)``, and its unit."""
    relation = state.projector_from_camera
    turned, shifted = np.zeros((SHARED, 3)), np.zeros((SHARED, 3))
    turn, shift = np.arange(RELATION.start, RELATION.stop).reshape(2, 3)
    turned[turn] = np.linalg.inv(left_jacobian(relation[:3]))
    turned[shift] = -skew(relation[3:])
    shifted[shift] = np.eye(3)
    return {
        TURNED: (turned, "rad"),
        SHIFTED: (shifted, "mm"),
        CAMERA_ZOOM: (_zoomed(CAMERA, state.camera), ""),
        PROJECTOR_ZOOM: (_zoomed(PROJECTOR, state.projector), ""),
    }


def _zoomed(place: slice, lens: Array) -> Array:
    direction = np.zeros((SHARED, 1))
    direction[place.start : place.start + 2, 0] = lens[:2]
    return direction


def _solve(design: Array, misses: Array) -> tuple[float, Array]:
    """Sum of squares that is left, and the parameters; columns scaled, since units differ."""
    scale = np.linalg.norm(design, axis=0)
    values, *_ = np.linalg.lstsq(design / scale, misses, rcond=None)
    return float(np.sum((misses - design / scale @ values) ** 2)), values / scale


def _told(cause: Cause) -> str:
    if cause.unit == "rad":
        return f"{np.degrees(cause.size):.3f} degrees"
    return f"{cause.size:.2f} mm" if cause.unit == "mm" else f"{cause.size:+.2%}"
