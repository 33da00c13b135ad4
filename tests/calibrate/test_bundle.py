from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import CalibrationSettings, ImageSize, View
from fringeworks.calibrate.adjust.bundle import (
    all_residuals,
    refine,
    rms_px,
)
from fringeworks.calibrate.adjust.start import start_state
from fringeworks.calibrate.adjust.state import SHAPE, SHAPE_NAMES, RigState, free_indices
from fringeworks.calibrate.judge.checks import LARGEST_TOGETHER
from fringeworks.errors import UsageError
from tests.calibrate.synthetic import (
    board_poses,
    dense_sites,
    read_maps,
    residuals_and_jacobian,
    rig_state,
    views_of,
)

CAMERA_SIZE = ImageSize(752, 480)


def test_jacobian_against_finite_differences() -> None:
    rng = np.random.default_rng(5)
    state = rig_state(board_poses(3, rng=rng))
    views = views_of(state, sigma=0.3, rng=rng)
    # every parameter away from zero, so that no term of the derivative is hidden
    vector = state.vector.copy()
    vector[4:9] += [0.01, -0.02, 1e-3, -2e-3, 0.03]
    vector[13:18] += [-0.01, 0.02, 2e-3, 1e-3, -0.02]
    vector[SHAPE] = [0.7, -1.2]
    _, jacobian = residuals_and_jacobian(RigState.from_vector(vector), views)

    def flat(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return residuals_and_jacobian(RigState.from_vector(values), views)[0]

    lens, pose = [1e-2] * 4 + [1e-3] * 5, [1e-5] * 3 + [1e-3] * 3
    steps = np.array([*lens, *lens, *pose, 1e-2, 1e-2, *(pose * 3)])
    for column, size in enumerate(steps):
        step = np.zeros_like(vector)
        step[column] = size
        numeric = (flat(vector + step) - flat(vector - step)) / (2 * size)
        scale = np.abs(jacobian[:, column]).max()
        assert np.abs(jacobian[:, column] - numeric).max() <= 1e-6 * scale, column


def test_vector_round_trip() -> None:
    state = rig_state(board_poses(4, rng=np.random.default_rng(1)))
    again = RigState.from_vector(state.vector)
    np.testing.assert_array_equal(again.vector, state.vector)
    assert again.camera_from_board.shape == (4, 6)


def test_free_indices_leave_out_what_is_not_named() -> None:
    settings = CalibrationSettings(camera_free=("fx", "k1"), projector_free=("cy",))
    expected = [0, 4, 12, *range(18, 24), *range(26, 32)]
    np.testing.assert_array_equal(free_indices(settings, 1), expected)
    bent = CalibrationSettings(camera_free=(), projector_free=(), board_shape="paraboloid")
    np.testing.assert_array_equal(free_indices(bent, 1), range(18, 32))


def test_unknown_parameter_is_refused() -> None:
    with pytest.raises(UsageError, match="k9"):
        CalibrationSettings(camera_free=("fx", "k9"))


@pytest.mark.parametrize("count", [3, 6])
def test_recovers_the_rig_from_clean_observations(count: int) -> None:
    truth = rig_state(board_poses(count, rng=np.random.default_rng(count)))
    views = views_of(truth)
    fit = refine(start_state(views, CAMERA_SIZE), views, CalibrationSettings())
    assert fit.converged
    # px for lenses, rad and mm for poses; relative where the value is large
    scale = np.maximum(np.abs(truth.vector), 1.0)
    np.testing.assert_allclose(fit.state.vector / scale, truth.vector / scale, atol=1e-6)
    assert max(rms_px(fit.corners)) < 1e-6


def test_every_noise_free_rig_settles() -> None:
    """Twenty: where the last step stops is a matter of rounding, and so of the rig."""
    for seed in range(20):
        truth = rig_state(board_poses(3 + seed % 4, rng=np.random.default_rng(seed)))
        views = views_of(truth)
        fit = refine(start_state(views, CAMERA_SIZE), views, CalibrationSettings())
        assert fit.converged, seed
        assert max(rms_px(fit.corners)) < 1e-6


def test_all_five_distortion_terms_when_asked_for() -> None:
    truth = rig_state(board_poses(5, rng=np.random.default_rng(2)))
    camera, projector = truth.camera.copy(), truth.projector.copy()
    camera[6:], projector[6:] = [1e-3, -5e-4, 0.02], [-4e-4, 2e-3, 0.01]
    truth = replace(truth, camera=camera, projector=projector)
    views = views_of(truth)
    every = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    settings = CalibrationSettings(camera_free=every, projector_free=every)
    fit = refine(start_state(views, CAMERA_SIZE), views, settings)
    np.testing.assert_allclose(fit.state.camera, truth.camera, atol=1e-4)
    np.testing.assert_allclose(fit.state.projector, truth.projector, atol=1e-4)


def test_errors_are_those_that_the_noise_predicts() -> None:
    """Squared errors over the Cramer-Rao covariance average one per parameter."""
    sigma, draws = 0.05, 8
    rng = np.random.default_rng(7)
    truth = rig_state(board_poses(6, rng=rng))
    clean = views_of(truth)
    free = free_indices(CalibrationSettings(), len(clean))
    _, jacobian = residuals_and_jacobian(truth, clean)
    covariance = np.linalg.inv(jacobian[:, free].T @ jacobian[:, free]) * sigma**2
    shared = slice(0, 22)  # sixteen lens parameters and the relative pose
    information = np.linalg.inv(covariance[shared, shared])
    ratios, noise = [], []
    for _ in range(draws):
        fit = refine(truth, views_of(truth, sigma=sigma, rng=rng), CalibrationSettings())
        error = (fit.state.vector - truth.vector)[free][shared]
        ratios.append(error @ information @ error / 18)
        parts = [(part.corners[:, :2].ravel(), part.sites.ravel()) for part in fit.residuals]
        noise.append(np.sqrt(np.mean(np.concatenate([*sum(parts, ())]) ** 2)))
        assert fit.spread.camera == pytest.approx(sigma, rel=0.2)
    # chi squared of 8 x 18: sd of the mean is sqrt(2 / 144) = 0.12; five of them
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.6)
    # 2112 residuals per draw, 54 parameters
    expected = sigma * np.sqrt(1 - 54 / 2112)
    assert np.mean(noise) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("stated", [1, 30])
def test_a_wrong_corner_does_not_pull(stated: float) -> None:
    """Whatever the observations say of themselves: here a fifth of the truth, or six times it."""
    rng = np.random.default_rng(9)
    truth = rig_state(board_poses(6, rng=rng))
    views = [
        replace(
            view,
            camera_sigma_px=view.camera_sigma_px * stated,
            projector_sigma_px=view.projector_sigma_px * stated,
        )
        for view in views_of(truth, sigma=0.05, rng=rng)
    ]
    clean = refine(truth, views, CalibrationSettings()).state.vector
    spoilt = [replace(view, camera_px=view.camera_px.copy()) for view in views]
    spoilt[0].camera_px[0] += [5.0, -3.0]
    spoilt[0].projector_px[0] = read_maps(truth, 0, spoilt[0].camera_px)[0]
    robust = refine(truth, spoilt, CalibrationSettings()).state.vector
    squares = refine(truth, spoilt, CalibrationSettings(huber=1e6)).state.vector
    focal = 0
    assert abs(robust[focal] - clean[focal]) < 0.1 * abs(squares[focal] - clean[focal])


def test_a_poor_start_does_not_pull() -> None:
    """20 px off, the start's residuals weigh the projector down; those of the first round do not.

    One corner is wrong in the projector: what it moves the lens by stays below a tenth of what
    it moves plain least squares by (0.06; in a single round as much, 1.03).
    """
    rng = np.random.default_rng(9)
    truth = rig_state(board_poses(6, rng=rng))
    views = views_of(truth, sigma=0.05, rng=rng)
    poor = replace(truth, projector=truth.projector + np.array([30, -30, 20, 10, 0, 0, 0, 0, 0]))
    spoilt = [replace(view, projector_px=view.projector_px.copy()) for view in views]
    spoilt[0].projector_px[0] += [5.0, -3.0]
    clean = refine(truth, views, CalibrationSettings()).state.projector[:4]
    robust = refine(poor, spoilt, CalibrationSettings()).state.projector[:4]
    squares = refine(truth, spoilt, CalibrationSettings(huber=1e6)).state.projector[:4]
    assert np.all(np.abs(robust - clean) < 0.1 * np.abs(squares - clean))


def test_residuals_of_corners_left_out_are_still_told() -> None:
    truth = rig_state(board_poses(3, rng=np.random.default_rng(4)))
    views = views_of(truth)
    reasons = ("left out", *views[0].reasons[1:])
    projector = views[0].projector_px.copy()
    projector[1] = np.nan
    views[0] = replace(views[0], reasons=reasons, projector_px=projector)
    parts = all_residuals(truth, views)
    assert parts[0].shape == (88, 4)
    assert np.isfinite(parts[0][0]).all()
    assert np.isnan(parts[0][1, 2:]).all()
    assert rms_px(parts)[2] == pytest.approx(0.0, abs=1e-9)


def bowed_views(bow: tuple[float, float], *, noise: float = 0.0) -> tuple[RigState, list[View]]:
    """A board bowed by so many mm, with sites all over it."""
    rng = np.random.default_rng(12)
    truth = replace(rig_state(board_poses(5, rng=rng)), board_shape=np.array(bow))
    views = views_of(truth, sigma=noise, site_sigma=noise / 4, rng=rng)
    sites = dense_sites(truth, sigma=max(noise / 4, 1e-3), rng=rng)
    return truth, [replace(view, dense=part) for view, part in zip(views, sites, strict=True)]


def test_a_bowed_board_is_found() -> None:
    truth, views = bowed_views((0.12, -0.3), noise=0.04)
    start = replace(truth, board_shape=np.zeros(2))
    fit = refine(start, views, CalibrationSettings(board_shape="paraboloid"))
    assert fit.covariance is not None
    sigma = [fit.covariance.sigma[f"board.{name}"] for name in SHAPE_NAMES]
    assert max(sigma) < 0.02
    assert np.all(np.abs(fit.state.board_shape - truth.board_shape) < 5 * np.array(sigma))


def test_a_bowed_board_taken_for_flat_errs_together() -> None:
    truth, views = bowed_views((0.12, -0.3), noise=0.04)
    flat = refine(replace(truth, board_shape=np.zeros(2)), views, CalibrationSettings())
    bent = refine(truth, views, CalibrationSettings(board_shape="paraboloid"))
    assert not flat.state.board_shape.any()
    assert flat.spread.together > LARGEST_TOGETHER > 2 * bent.spread.together


def test_dense_sites_stand_in_for_those_of_the_corners() -> None:
    _, views = bowed_views((0.0, 0.0))
    assert views[0].sites is views[0].dense
    assert len(replace(views[0], dense=None).sites) == 88
    assert views[0].dense is not None
    rows = len(
        residuals_and_jacobian(rig_state(board_poses(1, rng=np.random.default_rng(1))), views[:1])[
            0
        ]
    )
    assert rows == 2 * 88 + 2 * len(views[0].dense)


TIMED = """
import time
import numpy as np
from fringeworks.calibrate import CalibrationSettings, ImageSize
from fringeworks.calibrate.adjust.bundle import refine
from fringeworks.calibrate.adjust.start import start_state
from tests.calibrate.synthetic import board_poses, rig_state, views_of

rng = np.random.default_rng(6)
views = views_of(rig_state(board_poses(25, rng=rng)), sigma=0.05, rng=rng)
start = start_state(views, ImageSize(752, 480))
before = time.process_time()
assert refine(start, views, CalibrationSettings()).converged
print(time.process_time() - before)
"""


@pytest.mark.slow
def test_25_views_in_three_seconds() -> None:
    """With one BLAS thread: several wait for each other by spinning, which counts as work."""
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", TIMED],
        cwd=root,
        env={**os.environ, **one},
        capture_output=True,
        text=True,
        check=True,
    )
    assert float(done.stdout) < 3.0
