"""What each source makes of the depth of a wall, by first derivatives.

With p' the derivatives of column and row by the depth along a ray and w the weights of the axes, an
error e of the coordinates moves the depth by ``sum w p' e / sum w p'^2``, what `reconstruct` does
to first order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.covariance import Covariance, read_covariance
from fringeworks.calibrate.adjust.state import SHARED
from fringeworks.calibrate.judge.uncertainty import (
    points_by_parameters,
    shared_covariance,
    state_of,
    variances,
)
from fringeworks.errors import UsageError
from fringeworks.geometry.lens import project_jacobian
from fringeworks.model import AXES, Fringe, Rig
from fringeworks.twin.effects import Effects
from fringeworks.uncertainty.phase_noise import (
    FringesSeen,
    pattern_errors,
    phase_variances,
    see_fringes,
)
from fringeworks.uncertainty.seen import Seen, wall_at

Array = NDArray[np.float64]
Kind: TypeAlias = Literal["model", "parameters", "phase"]
Name: TypeAlias = tuple[Kind, str]

GROUPS: Mapping[str, tuple[int, ...]] = {
    "camera: focal lengths": (0, 1),
    "camera: principal point": (2, 3),
    "camera: distortion": (4, 5, 6, 7, 8),
    "projector: focal lengths": (9, 10),
    "projector: principal point, origin of phase": (11, 12),
    "projector: distortion": (13, 14, 15, 16, 17),
    "rotation R": (18, 19, 20),
    "translation T": (21, 22, 23),
}
"""Places in `RigState.vector`: the paper's sigma of f, (u0, v0), phi_0, R and T, and distortion."""

DISTORTION: Name = ("model", "lens distortion, which equation 1 leaves out")


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What a budget is made for.

    Attributes
    ----------
    rig
        With its covariance, if parameters are to be in it.
    fringes
        The finest fringes of each coded axis.
    effects
        Light, projector, camera.
    geometric
        Whether equation 1 is used, which leaves distortion out.
    """

    rig: Rig
    fringes: tuple[Fringe, ...]
    effects: Effects
    geometric: bool = False

    @property
    def covariance(self) -> Covariance | None:
        """The rig's own; FormatError where it is damaged."""
        return read_covariance(self.rig.further)


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """A wall across the camera's axis as a setting sees it.

    Attributes
    ----------
    seen, lit_share
        The lit ones of a grid of pixels, and their share.
    fringes
        Of each axis.
    weights
        Of column and row, zero where not coded.
    slopes
        ``(2, n)`` derivatives of column and row by the depth, px per mm.
    """

    seen: Seen
    lit_share: float
    fringes: tuple[FringesSeen, ...]
    weights: tuple[float, float]
    slopes: Array

    @classmethod
    def at(cls, setting: Setting, depth_mm: float) -> Wall:
        """The wall at this depth, mm; UsageError where nothing of it is lit."""
        seen, share = wall_at(setting.rig, depth_mm)
        if not len(seen.points):
            raise UsageError(
                f"the projector must light the wall at z = {depth_mm:g} mm, got no lit point: "
                "choose another --z-range"
            )
        effects = setting.effects
        fringes = [see_fringes(setting.rig, seen, one, effects) for one in setting.fringes]
        weights = [0.0, 0.0]
        for one in fringes:
            variance = sum(phase_variances(one, effects).values()) * _px_per_rad(one) ** 2
            weights[AXES.index(one.fringe.axis)] = float(np.median(1 / variance))
        return cls(
            seen, share, tuple(fringes), (weights[0], weights[1]), _slopes(setting.rig, seen)
        )

    def gain_mm(self, axis: int) -> Array:
        """``(n,)`` mm of depth per px of error of this axis."""
        weights = np.array(self.weights)[:, None]
        return np.asarray(
            weights[axis] * self.slopes[axis] / np.sum(weights * self.slopes**2, axis=0)
        )

    @property
    def fringe_mm(self) -> float:
        """Depth of one fringe of the first coded axis, which a wrong order is wrong by."""
        first = self.fringes[0].fringe
        return float(np.median(first.period_px / np.abs(self.slopes[AXES.index(first.axis)])))

    def depth_by_parameters(self, setting: Setting) -> Array:
        """``(n, 3, SHARED)`` as `points_by_parameters`, with the wall's weights."""
        return points_by_parameters(state_of(setting.rig), self.seen, weights=self.weights)


def contributions(setting: Setting, wall: Wall) -> dict[Name, float]:
    """Standard deviation of the wall's depth, mm, by each source alone: root mean squares."""
    out = {DISTORTION: _left_out_mm(setting, wall)}
    if setting.covariance is not None:
        out |= _by_parameters(setting, wall, setting.covariance)
    return out | _by_phase(setting, wall)


def _left_out_mm(setting: Setting, wall: Wall) -> float:
    """What equation 1 makes of the true pixels, less the true depth: no distortion at all.

    Equation 1 takes one axis, the first that is coded.
    """
    camera, projector = setting.rig.camera.lens.vector, setting.rig.projector.lens.vector
    pose = setting.rig.projector_from_camera
    axis = AXES.index(setting.fringes[0].axis)
    ideal = (wall.seen.camera_px - camera[2:4]) / camera[:2]
    a = np.column_stack([ideal, np.ones(len(ideal))]) @ pose.rotation.T
    t = pose.translation_mm
    target = (wall.seen.projector_px[:, axis] - projector[2 + axis]) / projector[axis]
    depth = (target * t[2] - t[axis]) / (a[:, axis] - target * a[:, 2])
    return float(np.sqrt(np.mean((depth - wall.seen.points[:, 2]) ** 2)))


def _by_parameters(setting: Setting, wall: Wall, covariance: Covariance) -> dict[Name, float]:
    by = wall.depth_by_parameters(setting)[:, 2:]
    shared = shared_covariance(covariance)
    out: dict[Name, float] = {}
    for name, places in GROUPS.items():
        alone = np.zeros((SHARED, SHARED))
        alone[np.ix_(places, places)] = shared[np.ix_(places, places)]
        out["parameters", name] = float(np.sqrt(variances(by, alone).mean()))
    return out


def _by_phase(setting: Setting, wall: Wall) -> dict[Name, float]:
    sums: dict[Name, Array] = {}
    for one in wall.fringes:
        axis = AXES.index(one.fringe.axis)
        gain = (wall.gain_mm(axis) * _px_per_rad(one)) ** 2
        errors = pattern_errors(one, setting.effects)
        found = phase_variances(one, setting.effects)
        found |= {name: np.full_like(gain, error**2) for name, error in errors.items()}
        for name, variance in found.items():
            sums["phase", name] = sums.get(("phase", name), np.zeros_like(gain)) + variance * gain
    return {name: float(np.sqrt(total.mean())) for name, total in sums.items()}


def _slopes(rig: Rig, wall: Seen) -> Array:
    """``(2, n)`` derivatives of column and row by the depth along each ray, px per mm."""
    pose = rig.projector_from_camera
    _, by_point, _ = project_jacobian(pose.apply(wall.points), rig.projector.lens.vector)
    rays = (wall.points / wall.points[:, 2:]) @ pose.rotation.T
    return np.asarray(np.einsum("nij,nj->in", by_point, rays))


def _px_per_rad(seen: FringesSeen) -> float:
    return seen.fringe.period_px / (2 * np.pi)
