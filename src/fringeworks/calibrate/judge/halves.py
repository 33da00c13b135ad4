"""Whether two halves of the views tell the same: the error that no covariance knows.

The views are dealt into two halves, every other one. A rig is solved from each, and both
triangulate the same pixels of the field. What they differ by, after rigid alignment, is held
against what their covariances predict: where it is far more, the model is wrong by more than the
observations scatter (a board that is not flat, a lens beyond the model, a rig that moved), and the
covariance is too good to be true.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit, refine
from fringeworks.calibrate.adjust.covariance import Covariance
from fringeworks.calibrate.adjust.state import DECENTRING, RigState
from fringeworks.calibrate.judge.checks import LEAST_VIEWS
from fringeworks.calibrate.judge.uncertainty import (
    Field,
    points_by_parameters,
    rigid_motions,
    shared_covariance,
    triangulate_points,
    variances,
    without_motion,
)
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.errors import CalibrationError
from fringeworks.geometry.align import align_points
from fringeworks.model import Finding

Array = NDArray[np.float64]

LEAST_OF_BOTH = 2 * LEAST_VIEWS
LARGEST_RATIO = 2.0
"""Of the difference to the predicted one; by scatter alone it is beyond in one to three of a
hundred calibrations of 6 to 14 views, since a few combinations of parameters make most of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Halves:
    """What two rigs make of the same pixels.

    `difference_mm` is the distance of both points after rigid alignment, and `predicted_mm` its
    root mean square as both covariances have it; ``(3, rows, columns)``, NaN outside the field.
    """

    difference_mm: Array
    predicted_mm: Array

    @property
    def rms_mm(self) -> float:
        return _rms(self.difference_mm)

    @property
    def predicted_rms_mm(self) -> float:
        return _rms(self.predicted_mm)

    @property
    def ratio(self) -> float:
        return self.rms_mm / self.predicted_rms_mm

    @property
    def numbers(self) -> dict[str, float]:
        """What they come to, by name."""
        return {
            "rms_mm": self.rms_mm,
            "predicted_rms_mm": self.predicted_rms_mm,
            "ratio": self.ratio,
        }

    @property
    def finding(self) -> Finding | None:
        """A warning where the model's error exceeds that of sampling."""
        if self.ratio <= LARGEST_RATIO:
            return None
        return Finding(
            "warning",
            f"two halves of the views give points {1e3 * self.rms_mm:.1f} µm apart (rms), "
            f"{self.ratio:.1f} times what their scatter predicts: the model is wrong by more than "
            "the standard deviations say.",
            "Look at the board's flatness, and at what may have moved or changed meanwhile.",
            name="halves disagree",
            cost=float(self.rms_mm),
            unit="mm",
            where="rig",
        )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def compare_halves(
    state: RigState, views: Sequence[View], settings: CalibrationSettings, *, field: Field
) -> Halves:
    """Solve a rig from either half of the views, and compare them.

    Parameters
    ----------
    state
        The solution from all `views`, from which both halves start; what was left out for it
        stays out.
    field
        Of the rig that it is.

    Raises
    ------
    CalibrationError
        Fewer than six views, or a half that does not fix a rig.
    """
    if len(views) < LEAST_OF_BOTH:
        raise CalibrationError(
            f"two halves of the views need at least {LEAST_OF_BOTH} views, got {len(views)}"
        )
    parts = [_solve_half(state, views, (settings, first)) for first in (0, 1)]
    one, other = (
        triangulate_points(part.state, field.camera_px, field.projector_px) for part in parts
    )
    if not np.isfinite(one + other).all():
        raise CalibrationError("two halves of the views give no points in part of the field")
    turn, shift = align_points(one, other)
    away = np.linalg.norm(one @ turn.T + shift - other, axis=1)
    by = without_motion(points_by_parameters(state, field), rigid_motions(field.points))
    covariances = [part.covariance for part in parts if part.covariance is not None]
    apart = difference_covariance(*covariances, settings=settings)
    predicted = np.sqrt(variances(by, apart).sum(axis=1))
    return Halves(field.maps(away), field.maps(predicted))


def _solve_half(
    start: RigState, views: Sequence[View], choice: tuple[CalibrationSettings, int]
) -> Fit:
    settings, first = choice
    half = views[first::2]
    poses = start.camera_from_board[first::2]
    fit = refine(replace(start, camera_from_board=poses), half, settings, near=True)
    if not fit.converged or fit.covariance is None:
        names = ", ".join(view.name for view in half)
        raise CalibrationError(f"half of the views ({names}) fixes no rig: compare nothing with it")
    return fit


def difference_covariance(
    one: Covariance, other: Covariance, *, settings: CalibrationSettings
) -> Array:
    """``(SHARED, SHARED)`` covariance of what the halves' parameters differ by.

    They share no observation but the prior P of the decentring, which pulls both the same way:
    ``A + B - A P B - B P A`` of their covariances A and B.
    """
    a, b = shared_covariance(one), shared_covariance(other)
    prior = np.zeros(len(a))
    prior[DECENTRING] = 1 / settings.decentring_sigma**2
    common = (a * prior) @ b
    return np.asarray(a + b - common - common.T)
