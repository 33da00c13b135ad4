from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks.calibrate import CalibrationSettings, ImageSize, View, calibrate_rig
from fringeworks.calibrate.adjust.bundle import refine
from fringeworks.calibrate.adjust.state import RigState
from fringeworks.calibrate.judge.trim import leave_out_sites, worst_view
from fringeworks.calibrate.record import read_record
from tests.calibrate.synthetic import BOARD, board_poses, dense_sites, rig_state, views_of

POSES = board_poses(8, rng=np.random.default_rng(30))
SETTINGS = CalibrationSettings()


def observe(truth: RigState) -> list[View]:
    rng = np.random.default_rng(31)
    views = views_of(truth, sigma=0.04, site_sigma=0.012, rng=rng)
    sites = dense_sites(truth, sigma=0.012, rng=rng)
    return [replace(view, dense=part) for view, part in zip(views, sites, strict=True)]


@pytest.fixture(scope="module")
def views() -> list[View]:
    return observe(rig_state(POSES))


def test_sites_on_a_curled_edge_are_left_out(views: list[View]) -> None:
    dense = views[0].dense
    assert dense is not None
    curled = dense.projector_px.copy()
    curled[:40] += 0.3
    bent = [replace(views[0], dense=replace(dense, projector_px=curled)), *views[1:]]
    left = leave_out_sites(refine(rig_state(POSES), bent, SETTINGS), bent)[0].dense
    assert left is not None
    assert not np.isin(left.projector_px[:, 0], curled[:40, 0]).any()
    # one in 8000 of the others, and what the curled ones pull
    assert len(dense) - len(left) <= 40 + 8


def test_a_view_that_contradicts_is_left_out_and_named(views: list[View]) -> None:
    rng = np.random.default_rng(2)
    shaken = views[3].camera_px + rng.normal(0, 1.0, views[3].camera_px.shape)
    spoilt = [*views[:3], replace(views[3], camera_px=shaken), *views[4:]]
    rig = calibrate_rig(
        spoilt, BOARD, camera_size=ImageSize(752, 480), projector_size=ImageSize(608, 684)
    )
    record = read_record(rig.further)
    assert record is not None
    ((name, reason),) = record.failed_captures
    assert name == "pose_3"
    assert "px off in the" in reason
    assert "motion, blur and bad light" in reason
    assert rig.quality is not None
    assert rig.quality.views_used == 7
    assert rig.quality.observations_offered == 8 * 88


def test_views_that_agree_are_kept(views: list[View]) -> None:
    assert worst_view(refine(rig_state(POSES), views, SETTINGS), views) is None
