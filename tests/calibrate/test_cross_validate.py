"""k3 is solved for where it predicts unseen views better, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import CalibrationSettings, ImageSize, View, calibrate_rig
from fringeworks.calibrate.adjust.bundle import refine
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.judge.cross_validate import choose_lenses, prediction_errors
from fringeworks.calibrate.judge.uncertainty import lay_field, state_of, triangulate_points
from fringeworks.calibrate.record import read_record
from fringeworks.errors import CalibrationError
from fringeworks.geometry.align import align_points
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Rig
from tests.calibrate.synthetic import BOARD, board_poses, dense_sites, rig_state, views_of

Array = NDArray[np.float64]

SETTINGS = CalibrationSettings()
CAMERA = np.array([600.0, 600.0, 376.0, 240.0, -0.1, 0.05, 0.0, 0.0, 0.0])
PROJECTOR = np.array([500.0, 1000.0, 303.0, 400.0, -0.05, 0.03, 0.0, 0.0, 0.0])
RELATION = np.array([0.02, 0.25, -0.01, -60.0, 5.0, 8.0])


def wide_rig(k3_of: str | None, count: int = 8) -> RigState:
    """Lenses of 64 and 63 degrees, a board 190 to 260 mm away all over the view; k3 of 0.05."""
    rng = np.random.default_rng(3)
    middle = BOARD.corners_mm().mean(axis=0)
    poses = []
    for _ in range(count):
        turn, depth = rng.uniform(-0.55, 0.55, 3), rng.uniform(190, 260)
        centre = depth * np.array([rng.uniform(-0.28, 0.28), rng.uniform(-0.15, 0.15), 1.0])
        poses.append(np.concatenate([turn, centre - rotation_matrix(turn) @ middle]))
    lenses = {"camera": CAMERA.copy(), "projector": PROJECTOR.copy()}
    if k3_of is not None:
        lenses[k3_of][-1] = 0.05
    return RigState(lenses["camera"], lenses["projector"], RELATION, np.array(poses))


def observe(truth: RigState, *, seed: int = 31) -> list[View]:
    rng = np.random.default_rng(seed)
    views = views_of(truth, sigma=0.03, site_sigma=0.012, rng=rng)
    every = dense_sites(truth, sigma=0.012, rng=rng)
    third = [sites.only(np.arange(len(sites)) % 3 == 0) for sites in every]
    return [replace(view, dense=part) for view, part in zip(views, third, strict=True)]


def calibrated(views: list[View], *, try_k3: bool = True) -> Rig:
    return calibrate_rig(
        views,
        BOARD,
        camera_size=ImageSize(752, 480),
        projector_size=ImageSize(608, 684),
        settings=replace(SETTINGS, try_k3=try_k3),
    )


def error_mm(rig: Rig, truth: RigState) -> float:
    """95 % of the true points of the rig's field, aligned, are nearer than this."""
    field = lay_field(rig)
    pixels = field.camera_px, field.projector_px
    found, true = (triangulate_points(state, *pixels) for state in (state_of(rig), truth))
    turn, shift = align_points(found, true)
    away = np.linalg.norm(found @ turn.T + shift - true, axis=1)
    return float(np.percentile(away, 95))


def test_k3_is_solved_for_where_it_is_there() -> None:
    truth = wide_rig("camera")
    views = observe(truth)
    rig, poorer = calibrated(views), calibrated(views, try_k3=False)
    record = read_record(rig.further)
    assert record is not None
    assert {trial.device: trial.wanted for trial in record.k3} == {
        "camera": True,
        "projector": False,
    }
    assert rig.camera.lens.k3 == pytest.approx(0.05, abs=0.015)
    (finding,) = record.findings
    assert finding.severity == "note"
    assert finding.message.startswith("k3 of the camera was solved for")
    assert rig.further["calibration"]["settings"]["camera_free"][-1] == "k3"
    assert error_mm(rig, truth) < 0.25 * error_mm(poorer, truth)


def test_each_device_has_its_own() -> None:
    views = observe(wide_rig("projector"))
    fit = refine(wide_rig(None), views, SETTINGS)
    settings, trials = choose_lenses(fit, views, SETTINGS)
    assert settings == replace(SETTINGS, projector_free=(*SETTINGS.projector_free, "k3"))
    assert [trial.wanted for trial in trials] == [False, True]


def test_noise_alone_asks_for_none() -> None:
    """On the narrow rig; k3 stands out of 3 sigma in 1 of 370, and then folds are asked still."""
    truth = rig_state(board_poses(8, rng=np.random.default_rng(30)))
    for seed in range(2):
        views = observe(truth, seed=seed)
        settings, trials = choose_lenses(refine(truth, views, SETTINGS), views, SETTINGS)
        assert settings == SETTINGS
        assert [trial.device for trial in trials] == ["camera", "projector"]
        assert all(trial.finding is None for trial in trials)
        assert all(abs(trial.k3) < 4 * (trial.sigma or 0.0) for trial in trials)
        for trial in trials:
            assert trial.sigma is not None
            assert trial.gain is None or abs(trial.k3) > 3 * trial.sigma


def test_too_few_views_are_not_asked() -> None:
    truth = wide_rig("camera", count=7)
    views = observe(truth)
    fit = refine(truth, views, SETTINGS)
    assert choose_lenses(fit, views, SETTINGS) == (SETTINGS, ())


def test_too_few_views_to_leave_any_out() -> None:
    truth = wide_rig(None, count=3)
    views = observe(truth)
    with pytest.raises(CalibrationError, match="at least 3 views beside"):
        prediction_errors(refine(truth, views, SETTINGS), views, SETTINGS)
