"""Systematic uncertainty of points and pixels against sampling, and two halves of the views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.calibrate import CalibrationSettings, ImageSize, View, calibrate_rig
from fringeworks.calibrate.adjust.covariance import Covariance, read_covariance
from fringeworks.calibrate.adjust.state import RELATION, SHARED, RigState, parameter_names
from fringeworks.calibrate.judge.halves import Halves, compare_halves, difference_covariance
from fringeworks.calibrate.judge.uncertainty import (
    COLUMNS,
    MIDDLE,
    ROWS,
    Field,
    lay_field,
    pixel_sigma,
    point_sigma,
    points_by_parameters,
    shared_covariance,
    state_of,
    triangulate_points,
)
from fringeworks.calibrate.record import KEY, read_record
from fringeworks.errors import FormatError, UsageError
from fringeworks.geometry.align import align_points
from fringeworks.geometry.lens import project
from fringeworks.geometry.pose import rotation_matrix, rotation_vector
from fringeworks.model import Rig
from fringeworks.model.board import scale_sigma
from tests.calibrate.synthetic import (
    BOARD,
    board_poses,
    dense_sites,
    rig_state,
    triangulate_corners,
    views_of,
)

Array = NDArray[np.float64]

CAMERA_SIZE, PROJECTOR_SIZE = ImageSize(752, 480), ImageSize(608, 684)
CORNER_SIGMA, SITE_SIGMA = 0.03, 0.012
SAMPLES = 300


def noisy_views(truth: RigState, *, seed: int) -> list[View]:
    rng = np.random.default_rng(seed)
    views = views_of(truth, sigma=CORNER_SIGMA, site_sigma=SITE_SIGMA, rng=rng)
    dense = dense_sites(truth, sigma=SITE_SIGMA, rng=rng, across=2)
    return [replace(view, dense=sites) for view, sites in zip(views, dense, strict=True)]


def calibrated(count: int, *, seed: int = 0, zoomed: float = 1.0) -> Rig:
    """From noisy views; in every other one the projector's lens is zoomed."""
    poses = board_poses(count, rng=np.random.default_rng(100 + seed))
    truth = rig_state(poses)
    zoom = np.array([zoomed, zoomed, *np.ones(7)])
    other = replace(truth, projector=truth.projector * zoom)
    pair = noisy_views(truth, seed=seed), noisy_views(other, seed=seed)
    return calibrate_rig(
        [pair[index % 2][index] for index in range(count)],
        BOARD,
        camera_size=CAMERA_SIZE,
        projector_size=PROJECTOR_SIZE,
        settings=CalibrationSettings(try_k3=False),
    )


@pytest.fixture(scope="module")
def rig() -> Rig:
    return calibrated(6)


@pytest.fixture(scope="module")
def field(rig: Rig) -> Field:
    return lay_field(rig)


@pytest.fixture(scope="module")
def covariance(rig: Rig) -> Covariance:
    found = read_covariance(rig.further)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def samples(rig: Rig, covariance: Covariance) -> list[RigState]:
    """Rigs as the covariance has them about the one that was found."""
    values, vectors = np.linalg.eigh(shared_covariance(covariance))
    spread = vectors * np.sqrt(np.maximum(values, 0))
    drawn = np.random.default_rng(7).normal(size=(SAMPLES, SHARED)) @ spread.T
    middle = state_of(rig).vector
    return [RigState.from_vector(middle + one) for one in drawn]


def assert_alike(predicted: Array, sampled: Array) -> None:
    """Within 5 sigma of a standard deviation from so many samples, one part in sqrt(2 n)."""
    known = np.isfinite(predicted)
    ratio = predicted[known] / sampled[known]
    assert np.abs(ratio - 1).max() < 5 / np.sqrt(2 * SAMPLES)


def test_the_field_is_a_grid_of_what_both_devices_see(rig: Rig, field: Field) -> None:
    assert rig.volume_mm is not None
    near, far = rig.volume_mm
    assert field.depths_mm.tolist() == [near, (near + far) / 2, far]
    assert field.valid.shape == (3, ROWS, COLUMNS)
    # cells of 752 / 24 and 480 / 16 px: the first centre is half of them from the image's edge
    assert field.camera_px[0] == pytest.approx([31 + 1 / 3, 30.0] / np.array(2) - 0.5)
    assert project(field.points, rig.camera.lens.vector) == pytest.approx(field.camera_px)
    pose = rig.projector_from_camera
    seen = project(field.points @ pose.rotation.T + pose.translation_mm, rig.projector.lens.vector)
    assert seen == pytest.approx(field.projector_px)
    assert (field.projector_px >= -0.5).all()
    assert (field.projector_px <= [607.5, 683.5]).all()


def test_where_the_projector_does_not_reach_is_void(rig: Rig) -> None:
    narrow = replace(rig, projector=replace(rig.projector, width=rig.projector.width // 2))
    part = lay_field(narrow)
    assert 0 < part.valid.mean() < 0.9
    covariance = read_covariance(rig.further)
    assert covariance is not None
    sigma = point_sigma(narrow, covariance, part).depth_mm
    assert np.array_equal(np.isfinite(sigma), part.valid)


def test_triangulation_is_the_rays_midpoint_where_they_meet(rig: Rig, field: Field) -> None:
    found = triangulate_points(state_of(rig), field.camera_px, field.projector_px)
    np.testing.assert_allclose(found, field.points, rtol=0, atol=1e-7)
    some = slice(None, None, 40)
    independent = triangulate_corners(rig, field.camera_px[some], field.projector_px[some])
    np.testing.assert_allclose(found[some], independent, rtol=0, atol=1e-6)


def test_derivatives_of_points_are_those_of_the_triangulation(rig: Rig, field: Field) -> None:
    """Central differences of the depth's own iteration, with a step of 1e-5 of each parameter."""
    by = points_by_parameters(state_of(rig), field)[::25]
    pixels = field.camera_px[::25], field.projector_px[::25]
    vector = state_of(rig).vector
    for place in range(RELATION.stop):
        step = np.zeros(SHARED)
        step[place] = 1e-5 * max(abs(vector[place]), 0.1)
        ends = [
            triangulate_points(RigState.from_vector(vector + sign * step), *pixels)
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2 * step[place])
        # the iteration stops at 1e-7 mm
        bound = 1e-7 / step[place] + 1e-6 * np.abs(slope).max()
        assert np.abs(by[..., place] - slope).max() < bound, parameter_names(())[place]


def test_sigma_of_points_is_what_sampled_rigs_give(
    rig: Rig, covariance: Covariance, field: Field, samples: list[RigState]
) -> None:
    clouds = [triangulate_points(state, field.camera_px, field.projector_px) for state in samples]
    moved = []
    for cloud in clouds:
        turn, shift = align_points(cloud, field.points)
        moved.append(cloud @ turn.T + shift)
    for aligned, sampled in ((False, clouds), (True, moved)):
        x, y, z = np.std(sampled, axis=0).T
        sigma = point_sigma(rig, covariance, field, aligned=aligned)
        assert_alike(sigma.depth_mm, field.maps(z))
        assert_alike(sigma.lateral_mm, field.maps(np.hypot(x, y)))


def test_alignment_takes_out_what_is_no_error(
    rig: Rig, covariance: Covariance, field: Field
) -> None:
    as_it_stands = point_sigma(rig, covariance, field, aligned=False)
    aligned = point_sigma(rig, covariance, field)
    assert np.nanmedian(aligned.depth_mm) < np.nanmedian(as_it_stands.depth_mm) / 2
    assert np.nanmedian(aligned.lateral_mm) < np.nanmedian(as_it_stands.lateral_mm) / 5


def test_sigma_of_pixels_is_what_sampled_rigs_give(
    rig: Rig, covariance: Covariance, field: Field, samples: list[RigState]
) -> None:
    camera, projector = [], []
    for state in samples:
        pose = state.projector_from_camera
        moved = field.points @ rotation_matrix(pose[:3]).T + pose[3:]
        camera.append(project(field.points, state.camera))
        projector.append(project(moved, state.projector))
    sigma = pixel_sigma(rig, covariance, field, aligned=False)
    for found, sampled in ((sigma.camera_px, camera), (sigma.projector_px, projector)):
        assert_alike(found, field.maps(np.hypot(*np.std(sampled, axis=0).T)))
    aligned = pixel_sigma(rig, covariance, field)
    assert np.nanmax(aligned.camera_px / sigma.camera_px) < 1
    assert np.nanmedian(aligned.projector_px) < np.nanmedian(sigma.projector_px) / 5


def test_a_focal_length_alone_by_hand(rig: Rig, field: Field) -> None:
    """A camera's fx known to 1 px moves the pixel of a point at x / z by x / z px."""
    lens = replace(rig.camera.lens, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0)
    straight = replace(rig, camera=replace(rig.camera, lens=lens))
    flat = lay_field(straight)
    alone = Covariance(("camera.fx", "pose_0.tz_mm"), np.diag([1.0, 9.0]), 1, 1.0)
    sigma = pixel_sigma(straight, alone, flat, aligned=False)
    expected = flat.maps(np.abs(flat.points[:, 0] / flat.points[:, 2]))
    np.testing.assert_allclose(sigma.camera_px, expected, atol=1e-12)
    assert np.nanmax(sigma.projector_px) == 0.0


def test_a_rig_without_a_depth_range_has_no_field(rig: Rig) -> None:
    with pytest.raises(UsageError, match="depth range"):
        lay_field(replace(rig, volume_mm=None))


def test_a_projector_that_looks_away_has_no_field(rig: Rig) -> None:
    pose = rig.projector_from_camera
    away = replace(pose, translation_mm=pose.translation_mm + np.array([1e4, 0, 0]))
    with pytest.raises(UsageError, match="must light what its camera sees"):
        lay_field(replace(rig, projector_from_camera=away))


def test_a_prior_that_both_halves_share_is_no_difference() -> None:
    """Solved from n readings of sigma s and the prior: apart by the readings' part alone.

    With f = 2 of information and p = 1 of the prior's, in units of it, each half is known to
    1 / 3, and moves by f / (f + p) of its readings' mean: 2 (2 / 3)^2 / 2 = 4 / 9.
    """
    unit = CalibrationSettings().decentring_sigma ** 2
    half = Covariance(("camera.p1", "camera.fx"), np.diag([unit / 3, 4.0]), 1, 1.0)
    apart = difference_covariance(half, half, settings=CalibrationSettings())
    names = parameter_names(())
    p1, fx = names.index("camera.p1"), names.index("camera.fx")
    assert apart[p1, p1] == pytest.approx(4 / 9 * unit)
    assert apart[fx, fx] == pytest.approx(8.0)


def halves_of(rig: Rig) -> Halves:
    """As the rig's file keeps it."""
    record = read_record(rig.further)
    assert record is not None
    assert record.halves is not None
    return record.halves


@pytest.mark.slow
def test_halves_of_good_views_differ_by_what_they_predict() -> None:
    """Of the square of one ratio, expected to be 1, two thirds are the square of one normal number.

    So it scatters by 0.95, the mean of five by 0.43, and three of these leave a ratio below 1.5.
    """
    found = [halves_of(calibrated(8, seed=seed)) for seed in range(5)]
    together = np.sqrt(np.mean([halves.ratio**2 for halves in found]))
    assert 0.5 < together < 1.5
    assert all(halves.finding is None for halves in found)
    assert found[0].difference_mm.shape == found[0].predicted_mm.shape == (3, ROWS, COLUMNS)
    assert np.nanmax(found[0].predicted_mm[MIDDLE]) < 0.1


def test_a_rig_that_changed_is_seen() -> None:
    """A projector zoomed by 2 in 1000 in every other view, 0.6 px at the edge of its image."""
    rig = calibrated(6, zoomed=1.002)
    finding = halves_of(rig).finding
    assert finding is not None
    assert "times what their scatter predicts" in finding.message
    assert "flatness" in finding.remedy
    record = read_record(rig.further)
    assert record is not None
    kept = record.findings[-1]
    assert kept.cost == pytest.approx(finding.cost, rel=1e-4)  # of sites kept to 1e-5 px
    assert replace(kept, cost=finding.cost) == finding


def test_the_file_keeps_what_was_compared(rig: Rig, field: Field) -> None:
    """To the four digits that it is written with, and what sites kept to 1e-5 px change."""
    record, found = read_record(rig.further), halves_of(rig)
    assert record is not None
    views = [entry.view for entry in record.views]
    poses = [
        np.concatenate([rotation_vector(pose.rotation), pose.translation_mm])
        for pose in (entry.camera_from_board for entry in record.views)
    ]
    state = replace(state_of(rig), camera_from_board=np.array(poses))
    again = compare_halves(state, views, CalibrationSettings(), field=field)
    np.testing.assert_allclose(found.difference_mm, again.difference_mm, rtol=2e-3, atol=1e-5)
    np.testing.assert_allclose(found.predicted_mm, again.predicted_mm, rtol=2e-3, atol=1e-5)
    assert rig.further[KEY]["halves"]["ratio"] == pytest.approx(found.ratio, rel=1e-3)
    assert record.left_out == ()


def test_halves_need_six_views() -> None:
    record = read_record(calibrated(5).further)
    assert record is not None
    assert record.halves is None
    assert record.left_out == ("two halves of the views need at least 6 views, got 5",)


def test_halves_solve_with_the_settings_of_the_rig() -> None:
    """k3 of both lenses free: the halves scatter far more, and predict it."""
    truth = rig_state(board_poses(6, rng=np.random.default_rng(100)))
    views = noisy_views(truth, seed=0)
    names = (*CalibrationSettings().camera_free, "k3")
    free = CalibrationSettings(camera_free=names, projector_free=names)
    rigs = [
        calibrate_rig(
            views,
            BOARD,
            camera_size=CAMERA_SIZE,
            projector_size=PROJECTOR_SIZE,
            settings=settings,
        )
        for settings in (CalibrationSettings(), free)
    ]
    plain, richer = (halves_of(rig).predicted_rms_mm for rig in rigs)
    assert richer > 1.5 * plain


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("halves", {"difference_mm": []}, r"calibration\.halves\.predicted_mm"),
        ("halves", {"difference_mm": [[[1]]], "predicted_mm": [[[1]]]}, "at 3 depths"),
        ("halves", dict.fromkeys(("difference_mm", "predicted_mm"), [[[None]]] * 3), "are known"),
        ("halves", dict.fromkeys(("difference_mm", "predicted_mm"), [[[0.0]]] * 3), "above 0"),
        (
            "halves",
            {"difference_mm": [[[-1]]] * 3, "predicted_mm": [[[1]]] * 3},
            r"difference_mm\.0",
        ),
        ("k3", [{"device": "camera"}], r"calibration\.k3\.0\.k3"),
    ],
)
def test_a_damaged_record_is_refused_by_its_key(
    rig: Rig, key: str, value: object, told: str
) -> None:
    table = {**rig.further[KEY], key: value}
    with pytest.raises(FormatError, match=told):
        read_record({KEY: table})


def test_the_boards_pitch_is_the_scales_uncertainty(rig: Rig) -> None:
    assert rig.scale_sigma is None
    board = replace(BOARD, pitch_y_mm=12.5, pitch_sigma_mm=0.0025)
    assert scale_sigma(board) == pytest.approx(2e-4)
