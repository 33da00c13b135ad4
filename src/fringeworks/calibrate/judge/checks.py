"""What a calibration must not pass over: errors that name the view, and findings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit, rms_px
from fringeworks.calibrate.adjust.start import (
    LARGEST_RMS_PX,
    PROJECTOR_CAUSES,
    largest_tilt_deg,
)
from fringeworks.calibrate.observe import View
from fringeworks.errors import CalibrationError
from fringeworks.model import AXES, Capture, Finding
from fringeworks.phase.bit_order import find_bit_order

LEAST_VIEWS = 3
GOOD_RMS_PX = 1.0
GOOD_TILT_DEG = 20.0
GOOD_OBLONG = 0.02
LARGEST_OBLONG = 0.2
LEAST_MOVE_PX = 0.5

LARGEST_TOGETHER = 5.0
"""Beyond it a board is not as flat as dense sites need. A flat one has 1.2 on the twin; the paper
of procam-graycode 17 (half size 9), where dense sites make squares no better and planes worse:
the corners of the worst pose left out lie 0.8 mm off one, with the corners' own sites 0.6."""

Array: TypeAlias = NDArray[np.float64]
Failed: TypeAlias = Sequence[tuple[str, str]]
"""Captures that gave no view: name and reason."""


def enough_views(views: Sequence[View], failed: Failed) -> None:
    """Raise `CalibrationError` for fewer than three views, with the reason of each failure.

    A view of the board where another view has it already is none.
    """
    for index, view in enumerate(views):
        for other in views[:index]:
            moved = view.camera_px - other.camera_px
            if np.sqrt(np.mean(np.sum(moved**2, axis=-1))) < LEAST_MOVE_PX:
                raise CalibrationError(
                    f"{other.name} and {view.name} show the board in the same place: leave one "
                    "out; every view must be a pose of its own"
                )
    if len(views) >= LEAST_VIEWS:
        return
    causes = "".join(f"\n  {names}: {reason}" for names, reason in _by_reason(failed))
    names = ", ".join(view.name for view in views) or "none"
    raise CalibrationError(
        f"at least {LEAST_VIEWS} views of the board are needed, {len(views)} can be used "
        f"({names})" + (f"; {len(failed)} failed:{causes}" if failed else "")
    )


def _by_reason(failed: Failed) -> list[tuple[str, str]]:
    """Names and reason, captures that failed for one reason together."""
    names: dict[str, list[str]] = {}
    for name, reason in failed:
        names.setdefault(reason, []).append(name)
    return [(", ".join(some), reason) for reason, some in names.items()]


def refuse_bit_order(capture: Capture) -> None:
    """Raise where the bits of a Gray code fit together in another order than they are listed in."""
    orders = {axis: find_bit_order(capture, axis) for axis in AXES}
    wrong = [
        f"along {axis} as {' '.join(str(place + 1) for place in order)}"
        for axis, order in orders.items()
        if order is not None
    ]
    if wrong:
        raise CalibrationError(
            "the Gray bits are out of order: of the images listed they fit together "
            f"{' and '.join(wrong)}, most significant first; list them so in capture.toml"
        )


def refuse_nonsense(fit: Fit, views: Sequence[View]) -> None:
    """Raise where the solution cannot be a rig, whatever its residuals look like."""
    camera_rms, projector_rms, _ = rms_px(fit.corners)
    finite = np.isfinite(fit.state.vector).all()
    if not finite or not np.isfinite(camera_rms + projector_rms) or not fit.converged:
        raise CalibrationError(
            "the refinement did not settle: the views contradict each other or say too little "
            f"(camera {camera_rms:.2f} px, projector {projector_rms:.2f} px); {PROJECTOR_CAUSES}"
        )
    per_view = [rms_px([part]) for part in fit.corners]
    if camera_rms > LARGEST_RMS_PX:
        worst = int(np.argmax([camera for camera, _, _ in per_view]))
        raise CalibrationError(
            f"camera and projector contradict each other: {camera_rms:.1f} px rms in the camera, "
            f"worst in {views[worst].name} ({per_view[worst][0]:.1f} px); {PROJECTOR_CAUSES}"
        )
    if projector_rms > LARGEST_RMS_PX:
        worst = int(np.argmax([projector for _, projector, _ in per_view]))
        raise CalibrationError(
            f"the projector's coordinates do not fit a lens: {projector_rms:.1f} px rms, worst in "
            f"{views[worst].name} ({per_view[worst][1]:.1f} px) though the camera has "
            f"{camera_rms:.2f} px; {PROJECTOR_CAUSES}"
        )
    if min(fit.state.camera[:2].min(), fit.state.projector[:2].min()) <= 0:
        raise CalibrationError(f"a focal length came out negative; {PROJECTOR_CAUSES}")
    if _oblong(fit) > LARGEST_OBLONG:
        fx, fy = fit.state.camera[:2]
        raise CalibrationError(
            f"the camera's focal lengths come out as {fx:.0f} and {fy:.0f} px: cameras have square "
            "pixels; check the board's pitches in x and y"
        )


def _oblong(fit: Fit) -> float:
    """How far the camera's pixels come out from square, 0 for square ones."""
    fx, fy = fit.state.camera[:2]
    return float(max(fx, fy) / min(fx, fy) - 1)


def sites_agree(fit: Fit) -> bool:
    """Whether what the dense sites leave is mostly their own noise."""
    return fit.spread.together <= LARGEST_TOGETHER


def dense_misfit(fit: Fit) -> Finding | None:
    """Why the dense sites of a fit had better not be used; None where they had."""
    if sites_agree(fit):
        return None
    return Finding(
        "warning",
        f"the decoded coordinates all over the board contradict its shape by {fit.spread.sites:.2f}"
        " px of the projector, whole regions alike: those about its corners alone were used.",
        "A board that is not flat is the commonest cause: mount it on something stiff, or solve "
        "for its shape (--board-shape paraboloid).",
        name="board not flat",
        cost=float(fit.spread.sites),
        unit="px",
        where="board",
    )


def findings(fit: Fit, views: Sequence[View], failed: Failed) -> list[Finding]:
    """What a user should read about a calibration that is none the less usable.

    Corners left out are told view by view instead, see `View.left_out`.
    """
    found = list(not_used(failed))
    per_view = [rms_px([part])[2] for part in fit.corners]
    _, _, joint = rms_px(fit.corners)
    if joint > GOOD_RMS_PX:
        worst = int(np.argmax(per_view))
        message = (
            f"the residuals are large, {joint:.1f} px rms, most in {views[worst].name} "
            f"({per_view[worst]:.1f} px)."
        )
        remedy = "Look at the board's pitches and flatness, and for motion."
        where = views[worst].name
        found.append(Finding("warning", message, remedy, name="large residuals", where=where))
    if _oblong(fit) > GOOD_OBLONG:
        message = f"the camera's focal lengths differ by {_oblong(fit):.1%} between x and y."
        remedy = "Measure the board's pitches in x and y."
        found.append(Finding("warning", message, remedy, name="unequal pitches", where="board"))
    return [*found, *alike_views(fit.state.camera_from_board)]


def not_used(failed: Failed) -> Iterator[Finding]:
    """That captures gave no view, and why."""
    for name, reason in failed:
        yield Finding(
            "warning", f"{name} was not used: {reason}", name="capture not used", where=name
        )


def alike_views(camera_from_board: Array) -> Iterator[Finding]:
    """That boards, ``(v, 6)`` poses, are all but parallel."""
    tilt = largest_tilt_deg(camera_from_board)
    if tilt < GOOD_TILT_DEG:
        yield Finding(
            "warning",
            f"the board was tilted by at most {tilt:.0f} degrees between two views: focal lengths "
            "are weakly determined.",
            "Add views tilted by 20 to 40 degrees about both axes.",
            name="views too alike",
            where="views",
        )
