"""Whether a richer lens predicts views that it has not seen better.

Views are dealt into folds. For each fold the rig is solved from the other views; then nothing but
the board's pose is fitted to each view left out, and what remains is the prediction error. A
richer model always fits the views that it is solved from better, these only where it is nearer
the truth.

k3 is the one term that is tried. Solved for with the others, from all views, it costs a second;
only where it then stands out of its own standard deviation are the folds asked, which cost more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.bundle import Fit, refine
from fringeworks.calibrate.judge.checks import LEAST_VIEWS
from fringeworks.calibrate.observe import View
from fringeworks.calibrate.settings import CalibrationSettings
from fringeworks.errors import CalibrationError
from fringeworks.model import Finding

Array = NDArray[np.float64]

FOLDS = 5
CERTAIN = 2.0
"""Standard errors by which the richer model must be better."""

STANDS_OUT = 3.0
"""Standard deviations from zero at which k3 is asked about; noise alone is beyond in 1 of 370."""

LEAST_TO_TRY = 8
"""Views: with fewer, some folds are solved from so few that a richer lens runs wild in them."""

MOST_SITES = 200
"""Of a view, in the folds."""

DEVICES = ("camera", "projector")


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of setting k3 of one device free.

    Attributes
    ----------
    device
        ``camera`` or ``projector``.
    k3, sigma
        What all views say, and its standard deviation; None where they leave it open.
    gain, gain_sigma
        Share by which views that were not seen are predicted better (mean squares), and its
        standard error; None where the folds were not asked, or fixed no rig.
    wanted
        Whether it was set free.
    """

    device: str
    k3: float
    sigma: float | None
    gain: float | None = None
    gain_sigma: float | None = None
    wanted: bool = False

    @property
    def stands_out(self) -> bool:
        """Whether k3 is further from zero than noise has it."""
        return self.sigma is not None and abs(self.k3) > STANDS_OUT * self.sigma

    @property
    def helps(self) -> bool:
        """Whether unseen views are predicted better, by two standard errors."""
        if self.gain is None or self.gain_sigma is None:
            return False
        return self.gain > CERTAIN * self.gain_sigma

    @property
    def finding(self) -> Finding | None:
        """A note where k3 was set free."""
        if not self.wanted or self.gain is None or self.gain_sigma is None:
            return None
        return Finding(
            "note",
            f"k3 of the {self.device} was solved for: views that the solution has not seen are "
            f"predicted {self.gain:.1%} better with it (1 sd {self.gain_sigma:.1%}).",
            name="k3 solved for",
            where=self.device,
        )


def prediction_errors(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings, *, folds: int = FOLDS
) -> Array:
    """``(views,)`` mean squared whitened residual of each view, predicted from other folds.

    Whitened by the spread of `fit`, the solution from all views, and bounded at three standard
    deviations, so that errors of different settings can be compared. View i is in fold i mod
    `folds`. NaN for the views of a fold without which the others fix no rig.

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
    errors = np.full(count, np.nan)
    for fold in range(min(folds, count)):
        out = [index for index in range(count) if index % folds == fold]
        kept = [index for index in range(count) if index % folds != fold]
        start = replace(fit.state, camera_from_board=fit.state.camera_from_board[kept])
        # one round: the start's weights are those of the whole solution already
        solved = refine(start, [views[index] for index in kept], settings, rounds=1, near=True)
        for index in out if solved.converged else ():
            alone = replace(solved.state, camera_from_board=fit.state.camera_from_board[[index]])
            posed = refine(alone, [views[index]], settings, poses_only=True, rounds=1, near=True)
            errors[index] = _error(posed, fit)
    return errors


def _error(posed: Fit, whole: Fit) -> float:
    (part,) = posed.residuals
    corners = part.corners[:, :2].ravel() / whole.spread.camera
    sites = part.sites.ravel() / whole.spread.sites
    return float(np.mean(np.clip(corners, -3, 3) ** 2) + np.mean(np.clip(sites, -3, 3) ** 2))


def choose_lenses(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings
) -> tuple[CalibrationSettings, tuple[Trial, ...]]:
    """The settings with k3 free where unseen views are predicted better for it, and why.

    One device at a time, the one that gains most first: what the k3 of one can do, that of the
    other often can as well. Below eight views nothing is tried.

    Parameters
    ----------
    fit
        The solution with `settings`.
    """
    tried: dict[str, Trial] = {}
    if len(views) < LEAST_TO_TRY:
        return settings, ()
    for _ in DEVICES:
        trials = _try_held(fit, views, settings)
        best = max(trials, key=lambda trial: trial.gain or 0.0, default=None)
        wanted = best is not None and best.helps
        tried |= {t.device: replace(t, wanted=wanted and t is best) for t in trials}
        if best is None or not wanted:
            break
        settings = _with_k3(settings, best.device)
        fit = refine(fit.state, views, settings, near=True)
    return settings, tuple(tried.values())


def _try_held(fit: Fit, views: Sequence[View], settings: CalibrationSettings) -> list[Trial]:
    """What comes of setting k3 free in either device that holds it."""
    held = [device for device in DEVICES if "k3" not in _free(settings, device)]
    trials = [_free_k3(fit, views, settings, device=device) for device in held]
    if not any(trial.stands_out for trial in trials):
        return trials
    few = [_thinned(view) for view in views]
    plain = prediction_errors(fit, few, settings)
    for place, trial in enumerate(trials):
        if trial.stands_out:
            richer = prediction_errors(fit, few, _with_k3(settings, trial.device))
            trials[place] = _with_gains(trial, (plain - richer) / plain.mean())
    return trials


def _free_k3(
    fit: Fit, views: Sequence[View], settings: CalibrationSettings, *, device: str
) -> Trial:
    freed = refine(fit.state, views, _with_k3(settings, device), rounds=1, near=True)
    value = float(getattr(freed.state, device)[-1])
    if not freed.converged or freed.covariance is None:
        return Trial(device, value, None)
    return Trial(device, value, freed.covariance.sigma[f"{device}.k3"])


def _with_gains(trial: Trial, gains: Array) -> Trial:
    if not np.isfinite(gains).all():
        return trial
    gain_sigma = float(gains.std(ddof=1) / np.sqrt(len(gains)))
    return replace(trial, gain=float(gains.mean()), gain_sigma=gain_sigma)


def _thinned(view: View) -> View:
    """With a part of its sites, evenly taken: the folds are many, and cost what these cost."""
    if view.dense is None:
        return view
    step = -(-len(view.dense) // MOST_SITES)
    return replace(view, dense=view.dense.only(np.arange(len(view.dense)) % step == 0))


def _free(settings: CalibrationSettings, device: str) -> tuple[str, ...]:
    return settings.camera_free if device == "camera" else settings.projector_free


def _with_k3(settings: CalibrationSettings, device: str) -> CalibrationSettings:
    free = (*_free(settings, device), "k3")
    if device == "camera":
        return replace(settings, camera_free=free)
    return replace(settings, projector_free=free)
