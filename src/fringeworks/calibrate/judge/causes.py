"""What is wrong where views do not fit: one assumption is changed and all is solved again.

The assumption under which everything fits is the cause that is named: a view left out, an image
flipped, the frames of the two axes exchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit, refine, rms_px
from fringeworks.calibrate.adjust.start import start_state
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.held.misfit import Seen, hold_against
from fringeworks.calibrate.judge.checks import (
    GOOD_RMS_PX,
    LEAST_VIEWS,
    refuse_nonsense,
    sites_agree,
)
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.errors import CalibrationError
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Camera, Finding, Lens, Pose, Projector, Rig

Array = NDArray[np.float64]
Sizes: TypeAlias = tuple[ImageSize, ImageSize]
"""Of the camera's and the projector's image."""

TIMES_THE_OTHERS = 5.0
"""A view fits where it leaves less than so many times what the others leave."""

LEAST_FIT_PX = 0.3
BEYOND_OWN, MENDED = 3.0, 0.5
"""Corners that scatter by so many times their own standard deviation want an explanation; one
that leaves less than half is one. procam-graycode's curled corner is none: 0.073 px either way."""

APART = 4.0
"""One axis alone is off where it misses by so many times more than the other."""


def first_fit(views: Sequence[View], camera_size: ImageSize, settings: CalibrationSettings) -> Fit:
    """A refined fit that is no nonsense, else `CalibrationError`."""
    fit = refine(start_state(views, camera_size), views, settings)
    refuse_nonsense(fit, views)
    return fit


def _flip_camera(view: View, sizes: Sizes) -> View:
    """Left to right; the board is then seen with its x reversed."""
    x = view.board_mm[:, 0]
    board = np.column_stack([x.max() + x.min() - x, view.board_mm[:, 1:]])
    camera = view.camera_px * [-1, 1] + [sizes[0].width - 1, 0]
    return replace(view, board_mm=board, camera_px=camera)


def _flip_columns(view: View, sizes: Sizes) -> View:
    return replace(view, projector_px=view.projector_px * [-1, 1] + [sizes[1].width - 1, 0])


def _flip_rows(view: View, sizes: Sizes) -> View:
    return replace(view, projector_px=view.projector_px * [1, -1] + [0, sizes[1].height - 1])


def _exchange_axes(view: View, sizes: Sizes) -> View:
    return replace(
        view,
        projector_px=view.projector_px[:, ::-1],
        projector_sigma_px=view.projector_sigma_px[:, ::-1],
    )


MIRRORED = "its projector coordinates are mirrored against the camera's"
CAMERA_FLIPPED = "the camera's image flipped left to right"
LEFT_TO_RIGHT = "the projector's image flipped left to right (rear projection?)"
TOP_TO_BOTTOM = "the projector's image flipped top to bottom"
AXES_SWAPPED = "the frames of the two axes swapped in capture.toml"

ASSUMPTIONS: Mapping[str, Callable[[View, Sizes], View]] = MappingProxyType(
    {
        CAMERA_FLIPPED: _flip_camera,
        LEFT_TO_RIGHT: _flip_columns,
        TOP_TO_BOTTOM: _flip_rows,
        AXES_SWAPPED: _exchange_axes,
    }
)
"""Of one capture; dense sites do not follow them."""

REMEDIES: Mapping[str, str] = MappingProxyType(
    {
        LEFT_TO_RIGHT: "switch off rear projection or mirroring in the projector's or the "
        "graphics driver's settings; a mirrored camera image looks the same",
        TOP_TO_BOTTOM: "switch off ceiling mode or mirroring in the projector's or the graphics "
        "driver's settings; a mirrored camera image looks the same",
        AXES_SWAPPED: "exchange axis x and y of its sets",
    }
)


def part_mirrored(
    views: Sequence[View], sizes: Sizes, settings: CalibrationSettings
) -> tuple[Sequence[View], Sequence[View]]:
    """The views that are not mirrored, and the fewer that are.

    Raises
    ------
    CalibrationError
        Half of them or more are, with what they fit under.
    """
    mirrored = [view for view in views if view.mirrored]
    if not mirrored or 2 * len(mirrored) < len(views):
        return [view for view in views if not view.mirrored], mirrored
    share = "all" if len(mirrored) == len(views) else f"{len(mirrored)} of"
    message = (
        f"the projector's coordinates are mirrored against the camera's in {share} {len(views)} "
        "views"
    )
    raise CalibrationError(message + _why_mirrored(mirrored, sizes, settings))


def _why_mirrored(views: Sequence[View], sizes: Sizes, settings: CalibrationSettings) -> str:
    """They fit equally well however they are mirrored back: the upright projector is the likely."""
    flipped = [replace(_flip_columns(view, sizes), dense=None) for view in views]
    try:
        fit = first_fit(flipped, sizes[0], settings)
    except CalibrationError:
        return (
            ": one of the two images is flipped, or capture.toml has the frames of the two axes "
            "swapped; and there is more that does not fit"
        )
    turn = rotation_matrix(fit.state.projector_from_camera[:3])
    quarters = round(np.arctan2(turn[1, 0], turn[0, 0]) / (np.pi / 2)) % 4
    cause = (LEFT_TO_RIGHT, AXES_SWAPPED, TOP_TO_BOTTOM, AXES_SWAPPED)[quarters]
    _, _, joint = rms_px(fit.corners)
    return (
        f". They fit to {joint:.2f} px with {cause}: {REMEDIES[cause]} (that is for an upright "
        "projector; on its side or head, left to right, top to bottom and axes change places)"
    )


def name_bad_view(views: Sequence[View], sizes: Sizes, settings: CalibrationSettings) -> str:
    """A sentence naming the one view without which all others fit, empty if there is none.

    For the message of a failure: it solves once per view.
    """
    if len(views) <= LEAST_VIEWS:
        return ""
    fits: dict[int, Fit] = {}
    for index in range(len(views)):
        others = [replace(view, dense=None) for view in (*views[:index], *views[index + 1 :])]
        try:
            fits[index] = first_fit(others, sizes[0], settings)
        except CalibrationError:
            continue
    better = {index: rms_px(fit.corners)[2] for index, fit in fits.items()}
    best = min(better, key=lambda index: better[index], default=None)
    if best is None or better[best] > GOOD_RMS_PX:
        return ""
    why = explain_view(views[best], fits[best], sizes)
    return (
        f". Without {views[best].name} the others fit to {better[best]:.2f} px: look at that "
        f"capture first; {why}"
    )


def bowed_board(flat: Fit, views: Sequence[View], settings: CalibrationSettings) -> Finding | None:
    """What is told where corners or sites that contradict a flat board agree with a bent one.

    It is solved for only where there is something to explain.
    """
    own = float(np.median(np.concatenate([view.camera_sigma_px[view.kept] for view in views])))
    scattered = flat.spread.camera > BEYOND_OWN * own
    if settings.board_shape != "flat" or (sites_agree(flat) and not scattered):
        return None
    bent = refine(flat.state, views, replace(settings, board_shape="paraboloid"))
    halved = bent.spread.camera < MENDED * flat.spread.camera
    mended = halved or (sites_agree(bent) and not sites_agree(flat))
    if not (bent.converged and mended):
        return None
    heights = " and ".join(f"{abs(height):.2f}" for height in bent.state.board_shape)
    return Finding(
        "warning",
        f"the board is bowed: solved for, its middle stands {heights} mm off its edges (x and y), "
        f"and what is left then is {bent.spread.camera:.3f} px at the corners and "
        f"{bent.spread.sites:.3f} px of the projector elsewhere (flat {flat.spread.camera:.3f} "
        f"and {flat.spread.sites:.3f} px). It was taken as flat all the same: the focal lengths "
        "are wrong with it.",
        "Solve for its shape (--board-shape paraboloid), or mount it on something stiff.",
        name="bowed board",
        where="board",
    )


def odd_view(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings
) -> tuple[int, Fit, str] | None:
    """The one view without which the sites agree, the fit without it, and the reason."""
    if len(views) <= LEAST_VIEWS:
        return None
    best: tuple[int, Fit] | None = None
    for index in range(len(views)):
        poses = np.delete(fit.state.camera_from_board, index, axis=0)
        start = replace(fit.state, camera_from_board=poses)
        others = refine(start, [*views[:index], *views[index + 1 :]], settings, near=True)
        if best is None or others.spread.sites < best[1].spread.sites:
            best = index, others
    if best is None or not (best[1].converged and sites_agree(best[1])):
        return None
    reason = (
        f"with it the decoded coordinates all over the boards contradict each other by "
        f"{fit.spread.sites:.3f} px, without it by {best[1].spread.sites:.3f} px"
    )
    return *best, reason


def explain_view(view: View, fit: Fit, sizes: Sizes) -> str:
    """What is wrong with a view that is no part of a fit, as far as that can be told."""
    rig = _rig_of(fit.state, sizes)
    camera, projector, _ = rms_px(fit.corners)
    least = max(TIMES_THE_OTHERS * max(camera, projector), LEAST_FIT_PX)
    for cause, change in ASSUMPTIONS.items():
        seen = _held(change(view, sizes), rig)
        if (
            seen is not None
            and max(seen.misfit.camera_rms_px, seen.misfit.projector_rms_px) < least
        ):
            missed = seen.misfit.projector_rms_px
            return f"it fits them to {missed:.2f} px with {cause}: undo that in this capture"
    return _which_part(_held(view, rig), least)


def _held(view: View, rig: Rig) -> Seen | None:
    try:
        return hold_against(view, rig)
    except CalibrationError:
        return None


def _which_part(seen: Seen | None, least: float) -> str:
    if seen is None:
        return "its corners give no pose of the board"
    if seen.misfit.camera_rms_px > least:
        return (
            f"its corners lie {seen.misfit.camera_rms_px:.1f} px off a board in the camera: is it "
            "the same board, at the same focus?"
        )
    columns, rows = np.sqrt(np.mean(seen.projector**2, axis=0))
    for off, right, axis in ((columns, rows, "x"), (rows, columns, "y")):
        if off > APART * right:
            return (
                f"its coordinates along {axis} are {off:.2g} px off and the others fit: board or "
                f"rig moved while the set of that axis was taken, or that set is of another pose"
            )
    return (
        f"its coordinates are {columns:.2g} px (x) and {rows:.2g} px (y) off: board or rig moved "
        "during the capture, or its frames are of another pose"
    )


def _rig_of(state: RigState, sizes: Sizes) -> Rig:
    camera, projector = sizes
    relation = state.projector_from_camera
    return Rig(
        Camera(camera.width, camera.height, Lens.from_vector(state.camera)),
        Projector(projector.width, projector.height, Lens.from_vector(state.projector)),
        Pose(rotation_matrix(relation[:3]), relation[3:].copy()),
    )
