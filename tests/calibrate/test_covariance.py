from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fringeworks.calibrate import CalibrationSettings
from fringeworks.calibrate.adjust.bundle import Fit, refine
from fringeworks.calibrate.adjust.covariance import KEY, Covariance, read_covariance
from fringeworks.calibrate.adjust.state import DECENTRING, RigState, free_indices
from fringeworks.errors import FormatError
from tests.calibrate.synthetic import (
    board_poses,
    dense_sites,
    residuals_and_jacobian,
    rig_state,
    views_of,
)

CORNER_SIGMA, SITE_SIGMA = 0.04, 0.012
SETTINGS = CalibrationSettings()
POSES = 3
"""Of the sampled sigmas: every parameter has its own, and each pose adds but its six."""


def solved(seed: int, *, dense: bool, poses: int = 6) -> tuple[RigState, Fit]:
    """The truth, its decentring drawn from the prior, and the solution from noisy views.

    One dense site per square: as many as corners, so that both weigh in.
    """
    rng = np.random.default_rng(seed)
    vector = rig_state(board_poses(poses, rng=np.random.default_rng(1))).vector
    vector[DECENTRING] = rng.normal(0, SETTINGS.decentring_sigma, 4)
    truth = RigState.from_vector(vector)
    views = views_of(truth, sigma=CORNER_SIGMA, site_sigma=SITE_SIGMA, rng=rng)
    if dense:
        sites = dense_sites(truth, sigma=SITE_SIGMA, rng=rng, across=1)
        views = [replace(view, dense=part) for view, part in zip(views, sites, strict=True)]
    return truth, refine(truth, views, SETTINGS)


@pytest.fixture(scope="module")
def covariance() -> Covariance:
    _, fit = solved(0, dense=False)
    assert fit.covariance is not None
    return fit.covariance


@pytest.mark.slow
@pytest.mark.parametrize("dense", [False, True])
def test_predicted_and_sampled_sigma_of_every_parameter(dense: bool) -> None:
    """100 seeds: the sampled ones are known to 7 %, and of 40 parameters none is 3 of those off."""
    free = free_indices(SETTINGS, POSES)
    errors, predicted = [], []
    names: tuple[str, ...] = ()
    for seed in range(100):
        truth, fit = solved(seed, dense=dense, poses=POSES)
        assert fit.covariance is not None
        errors.append((fit.state.vector - truth.vector)[free])
        predicted.append(list(fit.covariance.sigma.values()))
        names = fit.covariance.names
    ratio = np.sqrt(np.mean(np.square(predicted), axis=0) / np.mean(np.square(errors), axis=0))
    wrong = {n: float(r) for n, r in zip(names, ratio, strict=True) if not 0.8 <= r <= 1.25}
    assert not wrong


def test_it_is_the_inverse_of_the_weighted_normal_matrix(covariance: Covariance) -> None:
    """With the noise as it was drawn; what the residuals show of it is good to some per cent."""
    truth, _ = solved(0, dense=False)
    views = views_of(truth, sigma=CORNER_SIGMA, site_sigma=SITE_SIGMA)
    _, jacobian = residuals_and_jacobian(truth, views)
    free = free_indices(SETTINGS, len(views))
    sigma = np.tile(np.repeat([CORNER_SIGMA, SITE_SIGMA], 2 * 88), len(views))
    normal = (jacobian[:, free] / sigma[:, None] ** 2).T @ jacobian[:, free]
    held = np.flatnonzero(np.isin(free, DECENTRING))
    normal[held, held] += 1 / SETTINGS.decentring_sigma**2
    expected = np.sqrt(np.diag(np.linalg.inv(normal)))
    np.testing.assert_allclose(list(covariance.sigma.values()), expected, rtol=0.15)
    assert covariance.degrees_of_freedom == len(jacobian) - len(free)
    assert covariance.sigma0 == pytest.approx(1.0, abs=0.1)


def test_names_and_parts(covariance: Covariance) -> None:
    assert covariance.names[:3] == ("camera.fx", "camera.fy", "camera.cx")
    assert covariance.names[-1] == "pose_5.tz_mm"
    rig = covariance.only("camera", "projector_from_camera")
    assert len(rig.names) == 8 + 6
    assert rig.names[8] == "projector_from_camera.rx_rad"
    assert rig.sigma["camera.cx"] == covariance.sigma["camera.cx"]
    assert rig.matrix[0, 8] == covariance.matrix[0, 16]


def test_strongest_correlations() -> None:
    matrix = np.array([[4.0, -3.8, 0.1], [-3.8, 4.0, 0.0], [0.1, 0.0, 1.0]])
    strongest = Covariance(("a.x", "a.y", "b.z"), matrix, 10, 1.0).correlations(2)
    assert [pair[:2] for pair in strongest] == [("a.x", "a.y"), ("a.x", "b.z")]
    assert [pair[2] for pair in strongest] == pytest.approx([-0.95, 0.05])


def test_round_trip_through_the_rig(covariance: Covariance) -> None:
    further = json.loads(json.dumps({KEY: covariance.as_plain()}, allow_nan=False))
    again = read_covariance(further)
    assert again is not None
    assert again.names == covariance.names
    np.testing.assert_allclose(again.matrix, covariance.matrix, rtol=1e-12)
    assert again.degrees_of_freedom == covariance.degrees_of_freedom
    assert read_covariance({}) is None


DAMAGES: dict[str, Callable[[Any], object]] = {
    "covariance.names": lambda table: table.update(names=[]),
    "covariance.sigma0": lambda table: table.pop("sigma0"),
    "covariance.upper must have rows of 58": lambda table: table["upper"].pop(),
    "covariance.upper must have variances": lambda table: table["upper"][3].__setitem__(0, -1.0),
}


@pytest.mark.parametrize("told", DAMAGES)
def test_a_damaged_one_is_refused_by_its_key(covariance: Covariance, told: str) -> None:
    table = json.loads(json.dumps(covariance.as_plain()))
    DAMAGES[told](table)
    with pytest.raises(FormatError, match=f"damaged: {told}"):
        read_covariance({KEY: table})
