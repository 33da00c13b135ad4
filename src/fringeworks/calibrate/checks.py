"""What a calibration must not pass over: errors that name the view, and findings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from fringeworks.calibrate.bundle import Fit, refine, rms_px
from fringeworks.calibrate.observe import KEPT, View
from fringeworks.calibrate.settings import CalibrationSettings, ImageSize
from fringeworks.calibrate.start import (
    LARGEST_RMS_PX,
    PROJECTOR_CAUSES,
    largest_tilt_deg,
    start_state,
)
from fringeworks.errors import CalibrationError

LEAST_VIEWS = 3
GOOD_RMS_PX = 1.0
GOOD_TILT_DEG = 20.0

Failed: TypeAlias = Sequence[tuple[str, str]]
"""Captures that gave no view: name and reason."""


def enough_views(views: Sequence[View], failed: Failed) -> None:
    """Raise `CalibrationError` for fewer than three views, with the reason of each failure."""
    if len(views) >= LEAST_VIEWS:
        return
    causes = "".join(f"\n  {name}: {reason}" for name, reason in failed)
    names = ", ".join(view.name for view in views) or "none"
    raise CalibrationError(
        f"at least {LEAST_VIEWS} views of the board are needed, {len(views)} can be used "
        f"({names})" + (f"; {len(failed)} failed:{causes}" if failed else "")
    )


def refuse_nonsense(fit: Fit, views: Sequence[View]) -> None:
    """Raise where the solution cannot be a rig, whatever its residuals look like."""
    camera_rms, projector_rms, _ = rms_px(fit.residuals)
    finite = np.isfinite(fit.state.vector).all()
    if not finite or not np.isfinite(camera_rms + projector_rms) or not fit.converged:
        raise CalibrationError(
            "the refinement did not settle: the views contradict each other or say too little "
            f"(camera {camera_rms:.2f} px, projector {projector_rms:.2f} px); {PROJECTOR_CAUSES}"
        )
    per_view = [rms_px([part]) for part in fit.residuals]
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


def findings(fit: Fit, views: Sequence[View], failed: Failed) -> list[str]:
    """Sentences a user should read about a calibration that is none the less usable."""
    found = [f"{name} was not used: {reason}" for name, reason in failed]
    found += [
        f"{view.name}: {count} of {len(view.reasons)} corners left out: {reason}"
        for view in views
        for reason, count in view.left_out.items()
        if reason != KEPT
    ]
    per_view = [rms_px([part])[2] for part in fit.residuals]
    _, _, joint = rms_px(fit.residuals)
    if joint > GOOD_RMS_PX:
        worst = int(np.argmax(per_view))
        found.append(
            f"the residuals are large, {joint:.1f} px rms, most in {views[worst].name} "
            f"({per_view[worst]:.1f} px): look at the board's pitches and flatness, and for motion"
        )
    tilt = largest_tilt_deg(fit.state.camera_from_board)
    if tilt < GOOD_TILT_DEG:
        found.append(
            f"the board was tilted by at most {tilt:.0f} degrees between two views: focal lengths "
            "are weakly determined; add views tilted by 20 to 40 degrees about both axes"
        )
    return found


def first_fit(views: Sequence[View], camera_size: ImageSize, settings: CalibrationSettings) -> Fit:
    """A refined fit that is no nonsense, else `CalibrationError`."""
    fit = refine(start_state(views, camera_size), views, settings)
    refuse_nonsense(fit, views)
    return fit


def blame(views: Sequence[View], camera_size: ImageSize, settings: CalibrationSettings) -> str:
    """A sentence naming the one view without which all others fit, empty if there is none.

    For the message of a failure: it solves once per view.
    """
    if len(views) <= LEAST_VIEWS:
        return ""
    better = {}
    for index, view in enumerate(views):
        others = [*views[:index], *views[index + 1 :]]
        try:
            better[view.name] = rms_px(first_fit(others, camera_size, settings).residuals)[2]
        except CalibrationError:
            continue
    if not better:
        return ""
    name = min(better, key=lambda key: better[key])
    return f". Without {name} the others fit to {better[name]:.2f} px: look at that capture first"
