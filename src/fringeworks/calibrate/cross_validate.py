"""Whether a richer lens predicts views that it has not seen better.

Views are dealt into folds. For each fold the rig is solved from the other views; then nothing but
the board's pose is fitted to each view left out, and what remains is the prediction error. A
richer model always fits the views that it is solved from better, these only where it is nearer
the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.bundle import Fit, refine
from fringeworks.calibrate.checks import LEAST_VIEWS
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.errors import CalibrationError

Array = NDArray[np.float64]

FOLDS = 5
CERTAIN = 2.0
"""Standard errors by which the richer model must be better."""


def prediction_errors(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings, *, folds: int = FOLDS
) -> Array:
    """``(views,)`` mean squared whitened residual of each view, predicted from other folds.

    Whitened by the spread of `fit`, the solution from all views, and bounded at three standard
    deviations, so that errors of different settings can be compared. View i is in fold i mod
    `folds`.

    Raises
    ------
    CalibrationError
        Fewer than three views would be left to solve from.
    """
    count = len(views)
    if count - -(-count // min(folds, count)) < LEAST_VIEWS:
        raise CalibrationError(
            f"cross-validation needs at least {LEAST_VIEWS} views beside those left out, got "
            f"{count} views in {folds} folds"
        )
    errors = np.empty(count)
    for fold in range(min(folds, count)):
        out = [index for index in range(count) if index % folds == fold]
        kept = [index for index in range(count) if index % folds != fold]
        start = replace(fit.state, camera_from_board=fit.state.camera_from_board[kept])
        state = refine(start, [views[index] for index in kept], settings).state
        for index in out:
            alone = replace(state, camera_from_board=fit.state.camera_from_board[[index]])
            posed = refine(alone, [views[index]], settings, poses_only=True)
            errors[index] = _error(posed, fit)
    return errors


def _error(posed: Fit, whole: Fit) -> float:
    (part,) = posed.residuals
    corners = part.corners[:, :2].ravel() / whole.spread.camera
    sites = part.sites.ravel() / whole.spread.sites
    return float(np.mean(np.clip(corners, -3, 3) ** 2) + np.mean(np.clip(sites, -3, 3) ** 2))


def wants_k3(fit: Fit, views: Sequence[View], settings: CalibrationSettings) -> dict[str, bool]:
    """For camera and projector, whether k3 predicts unseen views better, by two standard errors.

    `fit` is the solution with `settings`; it is solved once per fold and device. k3 set free for
    nothing costs much: 0.45 mm against 0.06 on a wall.
    """
    plain = prediction_errors(fit, views, settings)
    richer = {
        "camera": replace(settings, camera_free=(*settings.camera_free, "k3")),
        "projector": replace(settings, projector_free=(*settings.projector_free, "k3")),
    }
    wanted = {}
    for device, choice in richer.items():
        gain = plain - prediction_errors(fit, views, choice)
        standard_error = float(gain.std(ddof=1)) / np.sqrt(len(gain))
        wanted[device] = bool(gain.mean() > CERTAIN * standard_error)
    return wanted
