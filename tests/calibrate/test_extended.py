"""The fit of the paper's ten parameters: what it finds, what it cannot, and that it says so."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fringeworks.calibrate.extended.fit import (
    PAPER_FREE,
    PRIORS,
    Mode,
    fit_extended,
)
from fringeworks.calibrate.extended.planes import PlanePoints
from fringeworks.calibrate.extended.words import describe_fit, summarise_fit, tabulate_fit
from fringeworks.errors import ShapeError, UsageError
from fringeworks.model import Extended, Pose, Rig
from tests.calibrate.plane_points import DISTORTED, PINHOLE, PURE_Y, P, depths, points_of

Array = NDArray[np.float64]

SIGMA = np.array([PRIORS[name] for name in Extended.NAMES])


def _off(rig: Rig) -> Rig:
    """A calibration that errs within the priors, of things that the ten describe."""
    lens, pose = rig.projector.lens, rig.projector_from_camera
    return replace(
        rig,
        projector=replace(rig.projector, lens=replace(lens, fx=lens.fx + 4, cx=lens.cx - 1.2)),
        projector_from_camera=Pose(pose.rotation, pose.translation_mm + np.array([0.7, 0.0, -0.8])),
    )


@pytest.mark.parametrize("mode", ["map", "paper"])
def test_errors_of_a_pinhole_calibration_are_absorbed(mode: Mode) -> None:
    """All but Kfp are among the paper's six; MAP holds on to its priors by noise over sigma."""
    points, rig = points_of(PINHOLE), _off(PINHOLE)
    if mode == "paper":
        rig = replace(
            rig, projector=replace(rig.projector, lens=replace(rig.projector.lens, fx=1013.0))
        )
    fit = fit_extended(points, rig, axis="x", period_px=P, mode=mode, noise_mm=1e-4)
    assert fit.rms_before_mm > 0.5
    assert fit.rms_mm < 1e-6
    assert np.abs(depths(points, rig, fit.extended) - points.depth).max() < 1e-5


def test_a_plain_fit_would_drift_and_the_priors_hold() -> None:
    """Kv0 is told by nothing: its posterior is its prior, and it stays where that has it."""
    fit = fit_extended(points_of(PINHOLE, noise_px=0.07), _off(PINHOLE), axis="x", period_px=P)
    assert fit.sigma["Kv0"] == pytest.approx(PRIORS["Kv0"], rel=0.01)
    assert abs(fit.extended.Kv0) < 1
    assert all(fit.sigma[name] <= PRIORS[name] * (1 + 1e-9) for name in fit.free)


def _with_scipy(points: PlanePoints, rig: Rig, fit_mode: Mode, noise_mm: float) -> Array:
    """The same minimum by complex steps, whose Jacobian is exact to rounding."""
    free = [Extended.NAMES.index(n) for n in (Extended.NAMES if fit_mode == "map" else PAPER_FREE)]
    (r11, r12, r13), _, (r31, r32, r33) = rig.projector_from_camera.rotation
    tx, _, tz = -rig.projector_from_camera.translation_mm
    camera, lens = rig.camera.lens, rig.projector.lens

    def residuals(values: Array) -> Array:
        ten = np.zeros(10, values.dtype)
        ten[free] = values
        c1, c2, c3, c4, kfp, kphi, ku0, kv0, kfc, kz = ten
        d1 = (points.rays[0] * camera.fx + ku0) / (camera.fx + kfc)
        d2 = (points.rays[1] * camera.fy + kv0) / (camera.fy + kfc)
        w, f = 2 * np.pi * (points.coordinate - lens.cx) / P + kphi, 2 * np.pi * (lens.fx + kfp) / P
        down = f * (r11 * d1 + r12 * d2 + r13 + c3) - w * (r31 * d1 + r32 * d2 + r33 + c4)
        off = (points.depth - (f * (tx + c1) - w * (tz + c2)) / down - kz) / noise_mm
        return np.concatenate([off, ten / SIGMA]) if fit_mode == "map" else off

    tight = 1e-15
    found = least_squares(
        residuals,
        np.zeros(len(free)),
        jac="cs",
        x_scale=SIGMA[free],
        ftol=tight,
        xtol=tight,
        gtol=tight,
    )
    ten = np.zeros(10)
    ten[free] = found.x
    return ten


@pytest.mark.parametrize("mode", ["map", "paper"])
def test_scipy_finds_the_same(mode: Mode) -> None:
    """Without priors the weakest direction is known to 1 mm: rounding reaches its 1e-8."""
    points, rig = points_of(DISTORTED, noise_px=0.07), _off(DISTORTED)
    fit = fit_extended(points, rig, axis="x", period_px=P, mode=mode, noise_mm=0.2)
    expected = _with_scipy(points, rig, mode, 0.2)
    bar = 1e-8 if mode == "map" else 5e-8
    assert np.abs((fit.extended.vector - expected) / SIGMA).max() < bar


@pytest.mark.slow
def test_posterior_sigma_is_the_observed_one() -> None:
    """Of 200 fits to fresh noise: a standard deviation of 200 draws is known to 5 %, five of
    those 25 %."""
    clean, rig = points_of(PINHOLE), PINHOLE
    rng = np.random.default_rng(11)
    fits = []
    for _ in range(200):
        noise = 0.02 * rng.standard_normal(len(clean))
        points = replace(clean, coordinate=clean.coordinate + noise)
        fits.append(fit_extended(points, rig, axis="x", period_px=P, mode="paper", weighted=True))
    spread = np.std([fit.extended.vector for fit in fits], axis=0)
    for name in PAPER_FREE:
        predicted = np.mean([fit.sigma[name] for fit in fits])
        assert predicted == pytest.approx(spread[Extended.NAMES.index(name)], rel=0.25)


def test_weights_hold_bad_points_off() -> None:
    """Half the boards with ten times the noise: weighted, the fit errs less."""
    clean = points_of(PINHOLE)
    rng, bad = np.random.default_rng(2), clean.plane % 2 == 0
    sigma = np.where(bad, 0.5, 0.02)
    points = replace(
        clean, coordinate=clean.coordinate + sigma * rng.standard_normal(len(clean)), sigma=sigma
    )
    errors = [
        np.std(
            depths(
                clean,
                PINHOLE,
                fit_extended(points, PINHOLE, axis="x", period_px=P, weighted=weighted).extended,
            )
            - clean.depth
        )
        for weighted in (False, True)
    ]
    assert errors[1] < errors[0] / 3


def test_points_that_err_alike_count_for_less() -> None:
    """What distortion leaves is no noise: every point counts for many times its residual. Noise
    alone counts for what it is."""
    bent = fit_extended(points_of(DISTORTED), DISTORTED, axis="x", period_px=P)
    assert 0.1 < bent.rms_mm < 0.3
    assert bent.noise_mm > 2 * bent.rms_mm
    trusting, doubting = (
        fit_extended(points_of(DISTORTED), DISTORTED, axis="x", period_px=P, noise_mm=noise)
        for noise in (bent.rms_mm, bent.noise_mm)
    )
    assert doubting.effective_dof + 0.05 < bent.effective_dof < trusting.effective_dof - 0.05
    assert bent.sigma["Kfp"] == pytest.approx(doubting.sigma["Kfp"], rel=0.05)
    noisy = fit_extended(points_of(PINHOLE, noise_px=0.07), PINHOLE, axis="x", period_px=P)
    assert noisy.noise_mm == pytest.approx(noisy.rms_mm, rel=0.2)


def test_it_is_told_in_words() -> None:
    fit = fit_extended(points_of(PINHOLE, noise_px=0.07), _off(PINHOLE), axis="x", period_px=P)
    words = " ".join(describe_fit(fit))
    assert "5600 points on 14 planes, fringes of 32 px along x" in words
    assert re.search(r"rank 7 of 10, 7 of use, condition 1[67]\d\d: a standard dev", words)
    assert re.search(r"no plane tells Ku0 by itself: Ku0 \+5 with C3 -0.0024\d, C4 \+0.0006", words)
    assert "as before: Kv0" in words
    rows = {row[0]: row for row in tabulate_fit(fit)}
    assert list(rows) == list(Extended.NAMES)
    assert rows["Kv0"][4:] == ("5", "1")
    plain = summarise_fit(fit)
    assert plain["parameters"]["C1"] == fit.extended.C1
    assert plain["rank"] == 7
    pure = fit_extended(points_of(PURE_Y), PURE_Y, axis="x", period_px=P, noise_mm=0.1)
    assert "no plane tells Kv0: it moves no depth at all" in describe_fit(pure)
    paper = fit_extended(
        points_of(PINHOLE), PINHOLE, axis="x", period_px=P, mode="paper", noise_mm=0.1
    )
    assert {row[0]: row[3] for row in tabulate_fit(paper)}["C3"] == "-"
    assert summarise_fit(paper)["prior_sigma"] is None


def test_what_cannot_be_fitted_is_refused() -> None:
    points = points_of(PINHOLE)
    few = PlanePoints(
        points.rays[:, :29],
        *(getattr(points, k)[:29] for k in ("coordinate", "depth", "sigma", "plane")),
    )
    with pytest.raises(ShapeError, match="points must be at least 30, got 29"):
        fit_extended(few, PINHOLE, axis="x", period_px=P)
    points.depth[3] = np.nan
    with pytest.raises(ShapeError, match="points must be finite"):
        fit_extended(points, PINHOLE, axis="x", period_px=P)
    with pytest.raises(UsageError, match="mode must be map or paper, got 'least'"):
        fit_extended(points, PINHOLE, axis="x", period_px=P, mode="least")  # type: ignore[arg-type]
