"""From a solution to the rig that is given: its quality, its volume, what it keeps of itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit, rms_px
from fringeworks.calibrate.adjust.covariance import KEY as COVARIANCE_KEY
from fringeworks.calibrate.judge.checks import Failed
from fringeworks.calibrate.judge.cross_validate import Trial
from fringeworks.calibrate.judge.halves import Halves, compare_halves
from fringeworks.calibrate.judge.uncertainty import lay_field
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.record import KEY, make_record
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.errors import CalibrationError, UsageError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Camera, Finding, Lens, Pose, Projector, Quality, Rig, Target
from fringeworks.model.board import scale_sigma

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """What was solved from which views, which captures and views were not used, and findings."""

    fit: Fit
    views: Sequence[View]
    failed: Failed
    findings: Sequence[Finding]


def make_rig(
    solution: Solution,
    board: Target,
    *,
    sizes: tuple[ImageSize, ImageSize],
    settings: CalibrationSettings,
    k3: Sequence[Trial] = (),
) -> Rig:
    """The rig of a solution with its record; two halves of the views are compared for that.

    Parameters
    ----------
    sizes
        Of the camera's and the projector's image.
    settings
        That it was solved with.
    k3
        What came of trying it.
    """
    fit, views, state = solution.fit, solution.views, solution.fit.state
    missing = len(solution.failed) * board.corner_count
    rig = Rig(
        camera=Camera(sizes[0].width, sizes[0].height, Lens.from_vector(state.camera)),
        projector=Projector(sizes[1].width, sizes[1].height, Lens.from_vector(state.projector)),
        projector_from_camera=_pose(state.projector_from_camera),
        volume_mm=_depth_range(fit, views),
        quality=_quality(fit, sum(len(view.reasons) for view in views) + missing),
        scale_sigma=scale_sigma(board),
    )
    halves = _halves(rig, solution, settings)
    noticed = [trial.finding for trial in k3]
    noticed.append(halves.finding if isinstance(halves, Halves) else None)
    record = make_record(
        fit,
        views,
        board=board,
        settings=settings,
        failed=solution.failed,
        findings=[*solution.findings, *(finding for finding in noticed if finding is not None)],
        k3=k3,
        halves=halves,
    )
    covariance = {} if fit.covariance is None else {COVARIANCE_KEY: fit.covariance.as_plain()}
    return replace(rig, further={KEY: record, **covariance})


def _halves(rig: Rig, solution: Solution, settings: CalibrationSettings) -> Halves | str:
    """Two halves of the views compared, or why they cannot be."""
    try:
        field = lay_field(rig)
        return compare_halves(solution.fit.state, solution.views, settings, field=field)
    except (CalibrationError, UsageError) as error:
        return str(error)


def _pose(values: Array) -> Pose:
    return Pose(rotation_matrix(values[:3]), values[3:].copy())


def _depth_range(fit: Fit, views: Sequence[View]) -> tuple[float, float]:
    """Smallest and largest z, mm, of the kept corners in the camera's frame."""
    depths = np.concatenate(
        [
            view.kept_in_camera(pose)[:, 2]
            for view, pose in zip(views, fit.state.camera_from_board, strict=True)
        ]
    )
    return float(depths.min()), float(depths.max())


def _quality(fit: Fit, offered: int) -> Quality:
    """Root mean squares over all kept corners; one corner in one view is one observation."""
    camera, projector, joint = rms_px(fit.corners)
    return Quality(
        camera_rms_px=camera,
        projector_rms_px=projector,
        joint_rms_px=joint,
        views_used=len(fit.corners),
        observations_used=sum(len(part) for part in fit.corners),
        observations_offered=offered,
    )
