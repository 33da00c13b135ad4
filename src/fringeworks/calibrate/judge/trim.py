"""What is left out because it contradicts the rest: corners first, then sites, then views.

All of it is deterministic, is counted, and has a reason. Little is: Huber's loss holds the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import CalibrationSettings

SITE_SIGMAS = 4.0
"""Sites on a fold or a curled edge are beyond it; of sites that only scatter 1 in 8000 is."""

VIEW_RATIO = 5.0
"""Of a view's median residual to that of the others, where it is left out."""

LARGEST_SHARE_OF_VIEWS = 0.25
SMALLEST_MEDIAN_PX = 0.02
"""Where the others leave less, this stands in: what they leave without noise is rounding."""

DOES_NOT_FIT = "does not fit the other corners"


def leave_out_corners(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings
) -> Sequence[View]:
    """The views with their worst corners left out: see `CalibrationSettings.trim_share`.

    A corner's badness is its distance in either device over that device's standard deviation.
    The same views are returned if there is nothing to leave out.
    """
    badness = [
        np.maximum(
            np.hypot(part[:, 0], part[:, 1]) / fit.spread.camera,
            np.hypot(part[:, 2], part[:, 3]) / fit.spread.projector,
        )
        for part in fit.corners
    ]
    ranked = np.sort(np.concatenate(badness))[::-1]
    allowed = int(settings.trim_share * sum(len(view.reasons) for view in views))
    worst = ranked[:allowed][ranked[:allowed] > settings.trim_sigmas]
    if not len(worst):
        return views
    return [_without(view, part >= worst[-1]) for view, part in zip(views, badness, strict=True)]


def _without(view: View, bad: NDArray[np.bool_]) -> View:
    """The view without those of its kept corners that are bad."""
    reasons = np.array(view.reasons, dtype=object)
    reasons[np.flatnonzero(view.kept)[bad]] = DOES_NOT_FIT
    return replace(view, reasons=tuple(str(reason) for reason in reasons))


def leave_out_sites(fit: Fit, views: Sequence[View]) -> list[View]:
    """The views without the dense sites beyond four standard deviations in either axis."""
    bound = SITE_SIGMAS * fit.spread.sites
    out = []
    for view, part in zip(views, fit.residuals, strict=True):
        good = np.logical_and(*(np.abs(part.sites.T) <= bound))
        out.append(view if view.dense is None else replace(view, dense=view.dense.only(good)))
    return out


def worst_view(fit: Fit, views: Sequence[View]) -> tuple[int, str] | None:
    """The view that contradicts the others most, with the reason; None where none does.

    Its median distance, in the camera or in the projector, is five times that of the median view.
    """
    found = (0.0, 0, "")
    for device, columns in (("camera", slice(0, 2)), ("projector", slice(2, 4))):
        medians = np.array(
            [np.median(np.hypot(*part[:, columns].T)) for part in fit.corners], dtype=np.float64
        )
        others = max(float(np.median(medians)), SMALLEST_MEDIAN_PX)
        index = int(np.argmax(medians))
        reason = (
            f"its corners lie {medians[index]:.2f} px off in the {device}, those of the other "
            f"views {np.median(medians):.2f} px: look for motion, blur and bad light there"
        )
        found = max(found, (float(medians[index]) / others, index, reason))
    ratio, index, reason = found
    return (index, reason) if ratio > VIEW_RATIO else None
