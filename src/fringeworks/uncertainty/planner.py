"""Which baseline, period and number of steps reach a wanted sigma over a wanted depth range.

For a point straight ahead, ``sigma_z = z z_p / (f_p b) sigma_x``: z and z_p its depth in camera and
projector, f_p the projector's focal length, px, b the part of the baseline across the fringes, and
``sigma_x = (P / 2 pi) sqrt(2 / N) sigma_I / B`` the projector coordinate's sigma. A wider baseline
wins until the two fields of view part at an end of the range; a shorter period wins until the blur
takes its modulation. Neither is guessed: each choice is a rig of its own, its projector aimed at
the middle of the range, and is judged as `budget` judges a rig.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, UsageError
from fringeworks.geometry.lens import unproject
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import AXES, Axis, Fringe, Pose, Rig
from fringeworks.patterns.presets import equal_shifts
from fringeworks.twin.effects import Effects
from fringeworks.uncertainty.contributions import Setting, Wall
from fringeworks.uncertainty.phase_noise import phase_variances
from fringeworks.uncertainty.seen import WORKING_SHARE, wall_at

Array = NDArray[np.float64]

BASELINES_OF_DEPTH = (0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5)
"""Baselines that are tried, shares of the middle depth: 6 to 28 degrees between the axes."""

PERIODS_PX = (8.0, 12.0, 16.0, 24.0, 32.0)
STEPS = (3, 4, 6, 8, 12, 16)
BLUR_KEPT = 0.2
"""Least share of the modulation that must be left: below it orders and masks suffer."""


@dataclass(frozen=True, slots=True)
class Choice:
    """One way to build and use a rig.

    Attributes
    ----------
    baseline_mm, period_px, steps
        What is chosen.
    sigma_mm
        Median random part of the depth at the near and the far end, 1 sd.
    lit_share
        Of the camera's image, there.
    """

    baseline_mm: float
    period_px: float
    steps: int
    sigma_mm: tuple[float, float]
    lit_share: tuple[float, float]

    @property
    def worst_mm(self) -> float:
        return max(self.sigma_mm)


def plan(
    rig: Rig,
    z_range_mm: tuple[float, float],
    sigma_mm: float,
    *,
    effects: Effects | None = None,
    axis: Axis = "x",
) -> list[Choice]:
    """What reaches `sigma_mm` over the range: fewest frames first, then the shortest baseline.

    Of each baseline and period, the fewest steps that do.

    Parameters
    ----------
    rig
        Its camera, its projector, and the direction from one to the other.
    z_range_mm
        Depths, mm.
    sigma_mm
        Largest median of the random part, 1 sd, mm, at both ends.
    axis
        Along which the phase varies.

    Raises
    ------
    UsageError
        The range does not rise from above zero, or sigma is not above zero.
    MeasurementError
        Nothing reaches it: the message says what comes nearest.
    """
    near, far = z_range_mm
    if not 0 < near < far < np.inf:
        raise UsageError(f"the range must rise from above 0, MIN:MAX in mm, got {near:g}:{far:g}")
    if not 0 < sigma_mm < np.inf:
        raise UsageError(f"sigma must be above 0 mm, got {sigma_mm:g}")
    tried = _try_all(rig, z_range_mm, effects or Effects(), axis)
    if not tried:
        raise MeasurementError(
            f"no baseline lights {WORKING_SHARE:.0%} of the camera's image at both z = {near:g} "
            f"and {far:g} mm with this camera and projector: narrow the range, or take a projector "
            "of a wider throw"
        )
    good = [choice for choice in tried if choice.worst_mm <= sigma_mm]
    if not good:
        best = min(tried, key=lambda choice: choice.worst_mm)
        raise MeasurementError(
            f"no choice reaches {sigma_mm:g} mm from {near:g} to {far:g} mm; the nearest is "
            f"{best.worst_mm:.3g} mm with a baseline of {best.baseline_mm:.0f} mm, fringes of "
            f"{best.period_px:g} px and {best.steps} steps: more "
            "light or averaging helps by the root"
        )
    fewest: dict[tuple[float, float], Choice] = {}
    for choice in sorted(good, key=lambda choice: choice.steps):
        fewest.setdefault((choice.baseline_mm, choice.period_px), choice)
    return sorted(fewest.values(), key=lambda c: (c.steps, c.baseline_mm, c.worst_mm))


def move_projector(rig: Rig, baseline_mm: float, aim_mm: float) -> Rig:
    """The rig with its projector moved along the baseline, and turned towards a point ahead.

    The middle of its image then meets the camera's axis at depth `aim_mm`; the turn is the
    smallest that does it.
    """
    back = rig.projector_from_camera.inverse()
    centre = back.translation_mm * (baseline_mm / np.linalg.norm(back.translation_mm))
    middle = np.array([[(rig.projector.width - 1) / 2, (rig.projector.height - 1) / 2]])
    ahead = back.rotation @ np.append(unproject(middle, rig.projector.lens.vector)[0], 1.0)
    wanted = np.array([0.0, 0.0, aim_mm]) - centre
    turned = _turn(ahead / np.linalg.norm(ahead), wanted / np.linalg.norm(wanted)) @ back.rotation
    return replace(rig, projector_from_camera=Pose(turned, centre).inverse(), further={})


def _turn(one: Array, other: Array) -> Array:
    """Smallest rotation that takes a unit vector to another."""
    axis = np.cross(one, other)
    sine = float(np.linalg.norm(axis))
    angle = np.arctan2(sine, float(one @ other))
    return rotation_matrix(axis / sine * angle if sine > 0 else np.zeros(3))


def _try_all(rig: Rig, z_range: tuple[float, float], effects: Effects, axis: Axis) -> list[Choice]:
    """Every choice whose fields of view overlap at both ends, the projector focused in between."""
    near, far = z_range
    middle = 2 * near * far / (near + far)
    light = effects.projector.light_per_ms * (effects.projector.focus_mm / middle) ** 2
    focused = replace(effects.projector, focus_mm=middle, light_per_ms=light)
    effects = replace(effects, projector=focused)
    out: list[Choice] = []
    for share in BASELINES_OF_DEPTH:
        moved = move_projector(rig, share * middle, middle)
        lit = (wall_at(moved, near)[1], wall_at(moved, far)[1])
        if min(lit) >= WORKING_SHARE:
            out += _try_fringes(moved, z_range, effects, (axis, lit))
    return out


def _try_fringes(
    rig: Rig,
    z_range: tuple[float, float],
    effects: Effects,
    seen: tuple[Axis, tuple[float, float]],
) -> list[Choice]:
    axis, lit = seen
    out = []
    for period in PERIODS_PX:
        setting = Setting(rig, (Fringe(axis, period, equal_shifts(STEPS[0])),), effects)
        walls = [Wall.at(setting, depth) for depth in z_range]
        if min(float(np.median(wall.fringes[0].transfer)) for wall in walls) < BLUR_KEPT:
            continue
        three = [_sigma(wall, effects, period) for wall in walls]
        for steps in STEPS:
            near, far = (sigma * np.sqrt(STEPS[0] / steps) for sigma in three)
            out.append(Choice(rig.baseline_mm, period, steps, (float(near), float(far)), lit))
    return out


def _sigma(wall: Wall, effects: Effects, period_px: float) -> float:
    variance: Sequence[Array] = list(phase_variances(wall.fringes[0], effects).values())
    px = np.sqrt(np.sum(variance, axis=0)) * period_px / (2 * np.pi)
    gain = wall.gain_mm(AXES.index(wall.fringes[0].fringe.axis))
    return float(np.median(np.abs(gain) * px))
