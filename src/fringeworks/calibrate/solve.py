"""From views, or from captures one at a time, to a rig that has been looked at before it is given.

Order: start, refine by the corners, leave out the worst corners, then views (few, counted, each
with its reason), refine with the dense sites, leave out the worst of those, refine again. What
cannot be right is refused at every step.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.bundle import Fit, refine, rms_px
from fringeworks.calibrate.checks import (
    GOOD_RMS_PX,
    LEAST_VIEWS,
    Failed,
    dense_misfit,
    enough_views,
    findings,
    refuse_nonsense,
)
from fringeworks.calibrate.covariance import KEY as COVARIANCE_KEY
from fringeworks.calibrate.observe import View, observe_board
from fringeworks.calibrate.record import KEY, make_record
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.calibrate.start import start_state
from fringeworks.calibrate.state import RigState
from fringeworks.calibrate.trim import (
    LARGEST_SHARE_OF_VIEWS,
    leave_out_corners,
    leave_out_sites,
    worst_view,
)
from fringeworks.errors import CalibrationError, DecodeError, FormatError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import (
    Camera,
    Capture,
    Finding,
    Lens,
    Pose,
    Projector,
    Quality,
    Rig,
    Target,
)
from fringeworks.phase.decode import decode_capture

Array = NDArray[np.float64]


def calibrate_captures(
    captures: Iterable[Capture],
    board: Target,
    *,
    settings: CalibrationSettings | None = None,
) -> Rig:
    """Calibrate from captures of a board in different poses.

    Parameters
    ----------
    captures
        One at a time is enough: a generator that reads them holds one in memory.
    board
        With its measured pitch: every length of the rig scales with it.

    Returns
    -------
    rig
        As `calibrate_rig` makes it. A capture that gives no view is named with its reason in
        ``rig.further["calibration"]["failed_captures"]`` and its corners count as offered.

    Raises
    ------
    CalibrationError
        Fewer than three captures give a view (each failure is listed), their image sizes differ,
        or as `calibrate_rig`.
    """
    settings = settings or CalibrationSettings()
    views: list[View] = []
    failed: list[tuple[str, str]] = []
    sizes: tuple[ImageSize, ImageSize] | None = None
    for capture in captures:
        sizes = _same_sizes(capture, sizes)
        try:
            views.append(_observe(capture, board, settings))
        except (CalibrationError, DecodeError, FormatError) as error:
            failed.append((capture.name, str(error).removeprefix(f"{capture.name}: ")))
        del capture  # the next one is read before the loop's name is bound anew
    if sizes is None:
        raise CalibrationError(f"no captures: at least {LEAST_VIEWS} poses of the board are needed")
    return calibrate_rig(
        views,
        board,
        camera_size=sizes[0],
        projector_size=sizes[1],
        settings=settings,
        failed=failed,
    )


def calibrate_rig(
    views: Sequence[View],
    board: Target,
    *,
    camera_size: ImageSize,
    projector_size: ImageSize,
    settings: CalibrationSettings | None = None,
    failed: Failed = (),
) -> Rig:
    """Solve for both lenses and their pose from views of a board.

    Parameters
    ----------
    failed
        Captures that gave no view, as (name, reason): counted and recorded.

    Returns
    -------
    rig
        With `quality` over all kept corners, `volume_mm` from their depths, and
        ``further["calibration"]``, see `record.make_record`.

    Raises
    ------
    CalibrationError
        Fewer than three views; views all of one orientation; no projector explains the
        coordinates; the refinement does not settle, or leaves more than 5 px rms in a device
        (naming the worst view and what to look for).
    """
    settings = settings or CalibrationSettings()
    enough_views(views, failed)
    try:
        fit = _first_fit(_corners_only(views), camera_size, settings)
    except CalibrationError as error:
        raise CalibrationError(f"{error}{_blame(views, camera_size, settings)}") from error
    fit, views, failed = _without_contradictions(fit, views, (settings, failed))
    fit, views, found = _with_dense_sites(fit, views, settings)
    record = make_record(
        fit,
        views,
        board=board,
        settings=settings,
        failed=failed,
        findings=[*findings(fit, views, failed), *found],
    )
    offered = sum(len(view.reasons) for view in views) + len(failed) * board.corner_count
    state = fit.state
    return Rig(
        camera=Camera(camera_size.width, camera_size.height, Lens.from_vector(state.camera)),
        projector=Projector(
            projector_size.width, projector_size.height, Lens.from_vector(state.projector)
        ),
        projector_from_camera=_pose(state.projector_from_camera),
        volume_mm=_depth_range(state, views),
        quality=_quality(fit, offered),
        further=_further(fit, record),
    )


def _corners_only(views: Sequence[View]) -> list[View]:
    return [replace(view, dense=None) for view in views]


def _without_contradictions(
    fit: Fit, views: Sequence[View], choices: tuple[CalibrationSettings, Failed]
) -> tuple[Fit, Sequence[View], Failed]:
    """Solved again without the worst corners, then without each view that still contradicts."""
    settings, failed = choices
    trimmed = leave_out_corners(fit, views, settings)
    if trimmed is not views:
        views, fit = trimmed, _again(fit.state, _corners_only(trimmed), settings)
    for _ in range(int(LARGEST_SHARE_OF_VIEWS * len(views))):
        found = worst_view(fit, views)
        if found is None or len(views) == LEAST_VIEWS:
            break
        index, reason = found
        failed = [*failed, (views[index].name, reason)]
        views = [*views[:index], *views[index + 1 :]]
        poses = np.delete(fit.state.camera_from_board, index, axis=0)
        start = replace(fit.state, camera_from_board=poses)
        fit = _again(start, _corners_only(views), settings)
    return fit, views, failed


def _with_dense_sites(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings
) -> tuple[Fit, Sequence[View], list[Finding]]:
    """Solved again with the dense sites, where there are any, and without the worst of those.

    With the corners' own alone, and a finding, where the board is not flat enough for them.
    """
    if all(view.dense is None for view in views):
        return fit, views, []
    dense = _again(fit.state, views, settings)
    trimmed = leave_out_sites(dense, views)
    dense = _again(dense.state, trimmed, settings)
    misfit = dense_misfit(dense)
    if misfit is None:
        return dense, trimmed, []
    return fit, _corners_only(views), [misfit]


def _again(start: RigState, views: Sequence[View], settings: CalibrationSettings) -> Fit:
    fit = refine(start, views, settings)
    refuse_nonsense(fit, views)
    return fit


def _further(fit: Fit, record: dict[str, Any]) -> dict[str, Any]:
    if fit.covariance is None:
        return {KEY: record}
    return {KEY: record, COVARIANCE_KEY: fit.covariance.as_plain()}


def _first_fit(views: Sequence[View], camera_size: ImageSize, settings: CalibrationSettings) -> Fit:
    """A refined fit that is no nonsense, else `CalibrationError`."""
    return _again(start_state(views, camera_size), views, settings)


def _blame(views: Sequence[View], camera_size: ImageSize, settings: CalibrationSettings) -> str:
    """A sentence naming the one view without which all others fit, empty if there is none.

    For the message of a failure: it solves once per view.
    """
    if len(views) <= LEAST_VIEWS:
        return ""
    better = {}
    for index, view in enumerate(views):
        others = _corners_only([*views[:index], *views[index + 1 :]])
        try:
            better[view.name] = rms_px(_first_fit(others, camera_size, settings).corners)[2]
        except CalibrationError:
            continue
    name = min(better, key=lambda key: better[key], default="")
    if not name or better[name] > GOOD_RMS_PX:
        return ""
    return f". Without {name} the others fit to {better[name]:.2f} px: look at that capture first"


def _observe(capture: Capture, board: Target, settings: CalibrationSettings) -> View:
    capture = capture.select()
    return observe_board(capture, decode_capture(capture), board, settings=settings)


def _same_sizes(
    capture: Capture, before: tuple[ImageSize, ImageSize] | None
) -> tuple[ImageSize, ImageSize]:
    """Camera and projector size of the capture, which must be those of the captures before."""
    height, width = capture.shape
    projector = ImageSize(capture.sequence.width, capture.sequence.height)
    sizes = (ImageSize(width, height), projector)
    for device, now, then in zip(("camera", "projector"), sizes, before or sizes, strict=True):
        if now != then:
            raise CalibrationError(
                f"{capture.name}: the {device}'s image is {now.width} x {now.height}, in the "
                f"captures before {then.width} x {then.height}: all captures must share one rig"
            )
    return sizes


def _pose(values: Array) -> Pose:
    return Pose(rotation_matrix(values[:3]), values[3:].copy())


def _depth_range(state: RigState, views: Sequence[View]) -> tuple[float, float]:
    """Smallest and largest z, mm, of the kept corners in the camera's frame."""
    depths = np.concatenate(
        [
            view.kept_in_camera(pose)[:, 2]
            for view, pose in zip(views, state.camera_from_board, strict=True)
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
