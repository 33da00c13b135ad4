"""Whether two halves of the views tell the same: the error that no covariance knows.

The views are dealt into two halves, every other one. A rig is solved from each, and both
triangulate the same pixels of the field. What they differ by, after rigid alignment, is held
against what their covariances predict: where it is far more, the model is wrong by more than the
observations scatter (a board that is not flat, a lens beyond the model, a rig that moved), and the
covariance is too good to be true.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from fringeworks.calibrate.bundle import Fit, refine
from fringeworks.calibrate.checks import LEAST_VIEWS
from fringeworks.calibrate.covariance import Covariance
from fringeworks.calibrate.record import KEY, CalibrationRecord
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.calibrate.state import DECENTRING, SHAPE_NAMES, RigState
from fringeworks.calibrate.uncertainty import (
    Field,
    points_by_parameters,
    rigid_motions,
    shared_covariance,
    state_of,
    triangulate_points,
    variances,
    without_motion,
)
from fringeworks.errors import CalibrationError, FormatError
from fringeworks.geometry.align import align_points
from fringeworks.geometry.pose import rotation_vector
from fringeworks.model import Finding, Rig

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
        )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


class _Solved(BaseModel):
    """What else the record keeps of how it was solved."""

    model_config = ConfigDict(strict=False, allow_inf_nan=False)

    settings: CalibrationSettings
    board_shape: dict[str, float]


def compare_halves(rig: Rig, record: CalibrationRecord, field: Field) -> Halves:
    """Solve a rig from either half of the views in its record, and compare them.

    Corners and sites that the calibration left out stay out; both halves start from its solution.

    Raises
    ------
    CalibrationError
        Fewer than six views, or a half that does not fix a rig.
    FormatError
        The record does not say how the rig was solved.
    """
    count = len(record.views)
    if count < LEAST_OF_BOTH:
        raise CalibrationError(
            f"two halves of the views need at least {LEAST_OF_BOTH} views, got {count}"
        )
    start, settings = _start(rig, record)
    fits = [_solve_half(start, record, (settings, first)) for first in (0, 1)]
    one, other = (
        triangulate_points(fit.state, field.camera_px, field.projector_px) for fit in fits
    )
    turn, shift = align_points(one, other)
    away = np.linalg.norm(one @ turn.T + shift - other, axis=1)
    by = without_motion(points_by_parameters(start, field), rigid_motions(field.points))
    covariances = [fit.covariance for fit in fits if fit.covariance is not None]
    apart = difference_covariance(*covariances, settings=settings)
    predicted = np.sqrt(variances(by, apart).sum(axis=1))
    return Halves(field.maps(away), field.maps(predicted))


def _start(rig: Rig, record: CalibrationRecord) -> tuple[RigState, CalibrationSettings]:
    solved = read_solved(rig.further)
    poses = [
        np.concatenate([rotation_vector(pose.rotation), pose.translation_mm])
        for pose in (view.camera_from_board for view in record.views)
    ]
    shape = np.array([solved.board_shape[name] for name in SHAPE_NAMES])
    state = replace(state_of(rig), camera_from_board=np.array(poses), board_shape=shape)
    return state, solved.settings


def read_solved(further: Mapping[str, Any]) -> _Solved:
    """Settings and the board's shape in `Rig.further`, as `make_record` wrote them."""
    try:
        solved = _Solved.model_validate(further[KEY])
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        key = ".".join(str(part) for part in (KEY, *first["loc"]))
        raise FormatError(
            f"the rig's record of its calibration is damaged: {key}: {first['msg']}"
        ) from error
    missing = set(SHAPE_NAMES) - set(solved.board_shape)
    if missing:
        raise FormatError(
            f"the rig's record of its calibration is damaged: {KEY}.board_shape must have "
            f"{', '.join(SHAPE_NAMES)}, got {', '.join(solved.board_shape) or 'none'}"
        )
    return solved


def _solve_half(
    start: RigState, record: CalibrationRecord, choice: tuple[CalibrationSettings, int]
) -> Fit:
    settings, first = choice
    views = [item.view for item in record.views[first::2]]
    poses = start.camera_from_board[first::2]
    fit = refine(replace(start, camera_from_board=poses), views, settings)
    if not fit.converged or fit.covariance is None:
        names = ", ".join(view.name for view in views)
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
