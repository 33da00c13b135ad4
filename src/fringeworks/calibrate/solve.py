"""From views, or from captures one at a time, to a rig that has been looked at before it is given.

Order: start, refine by the corners, leave out the worst corners, then views (few, counted, each
with its reason), refine with the dense sites, leave out the worst of those, refine again. What
cannot be right is refused at every step.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit, refine
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.judge.causes import (
    MIRRORED,
    Sizes,
    bowed_board,
    explain_view,
    first_fit,
    name_bad_view,
    odd_view,
    part_mirrored,
)
from fringeworks.calibrate.judge.checks import (
    LEAST_VIEWS,
    Failed,
    dense_misfit,
    enough_views,
    findings,
    refuse_bit_order,
    refuse_nonsense,
)
from fringeworks.calibrate.judge.cross_validate import Trial, choose_lenses
from fringeworks.calibrate.judge.noticed import notice, odd_regions
from fringeworks.calibrate.judge.trim import (
    LARGEST_SHARE_OF_VIEWS,
    leave_out_corners,
    leave_out_sites,
    worst_view,
)
from fringeworks.calibrate.observe import View, observe_board
from fringeworks.calibrate.outcome import Solution, make_rig
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.errors import CalibrationError, DecodeError, FormatError
from fringeworks.model import (
    Capture,
    Finding,
    Rig,
    Target,
)
from fringeworks.phase.decode import decode_capture

Array = NDArray[np.float64]
Left: TypeAlias = list[tuple[View, str]]
"""Views that were left out, each with the reason."""


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
        sizes = same_sizes(capture, sizes)
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
    settings, sizes = settings or CalibrationSettings(), (camera_size, projector_size)
    solved = _solve(views, sizes, (settings, failed))
    k3: Sequence[Trial] = ()
    if settings.try_k3:
        richer, k3 = choose_lenses(solved.fit, solved.views, settings)
        if richer != settings:  # from the start: what a poor lens had left out may fit now
            settings, solved = richer, _solve(views, sizes, (richer, failed))
    return make_rig(solved, board, sizes=sizes, settings=settings, k3=k3)


def _solve(
    views: Sequence[View], sizes: Sizes, choices: tuple[CalibrationSettings, Failed]
) -> Solution:
    settings, failed = choices
    views, mirrored = part_mirrored(views, sizes, settings)
    enough_views(views, [*failed, *((view.name, MIRRORED) for view in mirrored)])
    try:
        fit = first_fit(_corners_only(views), sizes[0], settings)
    except CalibrationError as error:
        raise CalibrationError(f"{error}{name_bad_view(views, sizes, settings)}") from error
    fit, views, left = _without_contradictions(fit, views, settings)
    fit, views, odd, found = _with_dense_sites(fit, views, settings)
    left += [*odd, *((view, MIRRORED) for view in mirrored)]
    reasons = ((v.name, f"{reason}; {explain_view(v, fit, sizes)}") for v, reason in left)
    failed = [*failed, *reasons]
    found = [*findings(fit, views, failed), *notice(fit, views, sizes), *found]
    return Solution(fit, views, failed, found)


def _corners_only(views: Sequence[View]) -> list[View]:
    return [replace(view, dense=None) for view in views]


def _without_contradictions(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings
) -> tuple[Fit, Sequence[View], Left]:
    """Solved again without the worst corners, then without each view that still contradicts.

    These are given too, each with its reason.
    """
    left: Left = []
    trimmed = leave_out_corners(fit, views, settings)
    if trimmed is not views:
        views, fit = trimmed, _again(fit.state, _corners_only(trimmed), settings)
    for _ in range(int(LARGEST_SHARE_OF_VIEWS * len(views))):
        found = worst_view(fit, views)
        if found is None or len(views) == LEAST_VIEWS:
            break
        index, reason = found
        left.append((views[index], reason))
        views = [*views[:index], *views[index + 1 :]]
        poses = np.delete(fit.state.camera_from_board, index, axis=0)
        start = replace(fit.state, camera_from_board=poses)
        fit = _again(start, _corners_only(views), settings)
    return fit, views, left


def _with_dense_sites(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings
) -> tuple[Fit, Sequence[View], Left, list[Finding]]:
    """Solved again with the dense sites, where there are any, and without the worst of those.

    Without one view, given with the reason, where all others then agree; with the corners' own
    alone, and a finding, where the board is not flat enough for them.
    """
    if all(view.dense is None for view in views):
        return fit, views, [], _as_list(bowed_board(fit, views, settings))
    dense = _again(fit.state, views, settings)
    trimmed = leave_out_sites(dense, views)
    dense = _again(dense.state, trimmed, settings)
    misfit, bowed = dense_misfit(dense), bowed_board(dense, trimmed, settings)
    if misfit is None:
        return dense, trimmed, [], _as_list(bowed or odd_regions(dense, trimmed))
    odd = None if bowed else odd_view(dense, trimmed, settings)
    if odd is None:
        return fit, _corners_only(views), [], [bowed or misfit]
    index, better, reason = odd
    return better, [*trimmed[:index], *trimmed[index + 1 :]], [(trimmed[index], reason)], []


def _as_list(finding: Finding | None) -> list[Finding]:
    return [] if finding is None else [finding]


def _again(start: RigState, views: Sequence[View], settings: CalibrationSettings) -> Fit:
    fit = refine(start, views, settings, near=True)
    refuse_nonsense(fit, views)
    return fit


def _observe(capture: Capture, board: Target, settings: CalibrationSettings) -> View:
    capture = capture.select()
    refuse_bit_order(capture)
    return observe_board(capture, decode_capture(capture), board, settings=settings, mirrored=True)


def same_sizes(
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
