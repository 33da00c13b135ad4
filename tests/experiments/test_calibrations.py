"""The study of calibrations: its rigs and poses, what it holds rigs against, what it keeps."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.calibrate.adjust.covariance import Covariance
from fringeworks.errors import CalibrationError, FormatError, UsageError
from fringeworks.experiments import calibrations
from fringeworks.experiments.calibration_figure import draw_trials
from fringeworks.experiments.calibration_table import HEAD, Results, make_notes, make_rows
from fringeworks.experiments.calibrations import (
    BOWED,
    FAR_WARPED,
    FLAT,
    WARPED,
    far_warped_rig,
    half_rig,
    study_calibrations,
)
from fringeworks.experiments.held_rig import Yardstick, hold_covariance, hold_rig
from fringeworks.experiments.studies import named_study
from fringeworks.experiments.trials import Kind, Trial, beyond_model, draw_poses, run_trial
from fringeworks.geometry.lens import project
from fringeworks.model import Lens, Pose
from fringeworks.patterns import make_sequence
from fringeworks.report.canvas import save_figure
from fringeworks.twin.scenes import BOARD, BOARD_POSES, paper_rig
from tests.experiments import canned

RADIUS_MM = 52.5
HALF = half_rig(paper_rig())


@pytest.fixture(scope="module")
def yardstick() -> Yardstick:
    """Half as many pixels each way: four times as fast."""
    width, height = HALF.projector.width, HALF.projector.height
    return Yardstick.of(HALF, make_sequence("paper", width=width, height=height))


@pytest.fixture(scope="module")
def four_poses(yardstick: Yardstick) -> Trial:
    return run_trial(FLAT, yardstick, seed=3, poses=4)


def test_half_the_pixels_see_the_same() -> None:
    """A pixel's edges, at -1/2 and 1/2 of its index, are what is halved."""
    points = np.array([[10.0, -20.0, 600.0], [-60.0, 30.0, 750.0]])
    whole = project(points, paper_rig().camera.lens.vector)
    np.testing.assert_allclose(project(points, HALF.camera.lens.vector), (whole + 0.5) / 2 - 0.5)


def test_a_lens_far_beyond_the_model(yardstick: Yardstick) -> None:
    """No rig of ours is true of it: the wall's scan with its first five terms is far off."""
    rig = far_warped_rig()
    assert rig.further["twin"]["projector"]["pupil_shift_mm"] == 10.0
    assert beyond_model(rig)
    assert not beyond_model(HALF)
    warped = Yardstick.of(half_rig(rig), yardstick.sequence)
    off, usual = (held.wall.bias(HALF).normal_p95_mm for held in (warped, yardstick))
    assert off > 10 * usual


def test_poses_are_drawn_anew_within_both_images() -> None:
    rig = paper_rig()
    first, again, other = (
        draw_poses(rig, 14, rng=np.random.default_rng(seed)) for seed in (0, 0, 1)
    )
    corners = np.array([[x, y, 0.0] for x in (-1, BOARD.columns) for y in (-1, BOARD.rows)]) * 13
    tilts = []
    for pose, same, another, (_, turn) in zip(first, again, other, BOARD_POSES, strict=True):
        np.testing.assert_array_equal(pose.translation_mm, same.translation_mm)
        assert np.abs(pose.translation_mm - another.translation_mm).max() > 0.5
        seen = project(pose.apply(corners), rig.camera.lens.vector)
        assert (seen > 0).all()
        assert (seen < [751, 479]).all()
        tilt = np.rad2deg(np.arccos(pose.rotation[2, 2]))
        tilts.append(tilt)
        assert tilt < np.hypot(*turn[:2]) + np.hypot(6, 6) + 1  # drawn about it
    assert max(tilts) > 25


def test_no_pose_is_found_outside_the_view() -> None:
    rig = replace(HALF, camera=replace(HALF.camera, width=60))
    with pytest.raises(CalibrationError, match="shows the whole board"):
        draw_poses(rig, 1, rng=np.random.default_rng(0))


def test_a_rig_of_another_scale(yardstick: Yardstick) -> None:
    """A baseline too long by 1e-3 makes everything larger by that, exactly."""
    pose = HALF.projector_from_camera
    longer = replace(HALF, projector_from_camera=Pose(pose.rotation, 1.001 * pose.translation_mm))
    true, found = hold_rig(HALF, yardstick), hold_rig(longer, yardstick)
    # single precision holds a cloud to 3e-5 mm a point; the fit averages over thousands
    grown = found.radius_error_mm - 1.001 * true.radius_error_mm
    assert grown == pytest.approx(1e-3 * RADIUS_MM, abs=1e-4)
    assert found.radius_all_error_mm - true.radius_all_error_mm > 0.05
    assert found.parameter_errors["baseline_mm"] == pytest.approx(1e-3 * HALF.baseline_mm)
    assert found.parameter_errors["angle_rad"] == 0
    assert true.parameter_errors == dict.fromkeys(true.parameter_errors, 0.0)
    assert not any(name.startswith("board") or "k3" in name for name in true.parameter_errors)
    assert abs(true.radius_error_mm) < abs(true.radius_all_error_mm)


@pytest.mark.parametrize(("name", "step"), [("camera.k1", 1e-3), ("projector.fx", 0.5)])
def test_the_predicted_error_is_that_of_a_changed_rig(
    yardstick: Yardstick, name: str, step: float
) -> None:
    """One standard deviation of the only uncertain parameter: first order, so within a few %."""
    device, parameter = name.split(".")
    changed = getattr(HALF, device)
    lens: Lens = changed.lens
    lens = replace(lens, **{parameter: getattr(lens, parameter) + step})
    rig = replace(HALF, **{device: replace(changed, lens=lens)})
    alone = Covariance((name,), np.array([[step**2]]), 1, 1.0)
    found = hold_covariance(rig, alone, yardstick)
    assert found.scores == pytest.approx({name: 1.0})
    # the wall's outermost pixels, where a lens errs most, are not on the coarse grid
    assert found.wall_rms_mm == pytest.approx(found.wall_predicted_mm, rel=0.1)


def test_a_trial_beats_the_plain_chain(four_poses: Trial) -> None:
    """Four poses of half the pixels: many times better, not just by chance."""
    ours, plain = four_poses.ours["flat"], four_poses.plain
    assert ours.held.wall_p95_mm < 0.5 * plain.held.wall_p95_mm
    assert ours.camera_rms_px < 0.5 * plain.camera_rms_px
    assert 0.98 * ours.offered <= ours.kept <= ours.offered == plain.offered == 4 * 88
    assert plain.kept >= 0.98 * plain.offered
    assert ours.halves_ratio is None  # six views at least
    assert ours.predicted is not None
    assert set(ours.predicted.scores) < set(ours.held.parameter_errors)
    assert ours.structure is not None
    assert ours.structure.finding is None


def test_trials_are_kept_and_used_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, yardstick: Yardstick
) -> None:
    run: list[tuple[str, int, int]] = []

    def fake(kind: Kind, _: Yardstick, *, seed: int, poses: int) -> Trial:
        run.append((kind.name, seed, poses))
        return canned.trial(kind, seed)

    monkeypatch.setattr(calibrations, "run_trial", fake)
    monkeypatch.setattr(calibrations, "_yardstick", lambda _: yardstick)
    study_calibrations(tmp_path, seeds=2)
    names = ("flat", "bowed", "warped", "far_warped")
    assert run == [(name, seed, 14) for name in names for seed in (0, 1)]
    assert len(list((tmp_path / "seeds").iterdir())) == 8
    run.clear()
    study = study_calibrations(tmp_path, seeds=3)
    assert run == [(name, 2, 14) for name in names]
    assert len(study.numbers["trials"]) == 12
    json.dumps(study.numbers, allow_nan=False)
    run.clear()
    study_calibrations(tmp_path, quick=True)
    assert run == [(name, 0, 7) for name in names]
    path = tmp_path / "seeds" / "flat-01.json"
    path.write_text('{"kind": "flat"}')
    with pytest.raises(FormatError, match=r"flat-01\.json: not this trial \(seed: .*remove it"):
        study_calibrations(tmp_path, seeds=2)
    path.write_text("{")
    with pytest.raises(FormatError, match=r"flat-01\.json: not this trial \(Invalid JSON"):
        study_calibrations(tmp_path, seeds=2)
    path.write_text((tmp_path / "seeds" / "flat-00.json").read_text())
    with pytest.raises(FormatError, match=r"\(it holds seed 0 of kind 'flat'\)"):
        study_calibrations(tmp_path, seeds=2)
    path.unlink()
    path.mkdir()
    with pytest.raises(FormatError, match=r"flat-01\.json: cannot be read"):
        study_calibrations(tmp_path, seeds=2)


def results() -> Results:
    """Ours err by 1, 2 and 6 µm with flat boards, plain by 4; everything else by 2 and 30."""
    flat = [canned.trial(FLAT, s, 1e-3 * e, 0.004) for s, e in enumerate((1.0, 2.0, 6.0))]
    further = [canned.trial(kind, 0) for kind in (BOWED, WARPED, FAR_WARPED)]
    return Results([*flat, *further], canned.held(0.0015))


def test_the_table_adds_up() -> None:
    rows = {row[0]: row[1:] for row in make_rows(results())}
    assert all(len(cells) == len(HEAD) - 1 for cells in rows.values())
    assert rows["wall, p95, median, mm"] == ("0.0020", "0.0040", "0.0015", "<= 0.012")
    assert rows["wall, p95, largest, mm"][0] == "0.0060"
    assert rows["radius error, median, mm"][0] == "0.0020"
    assert rows["radius error, 90 % below, mm"][0] == "0.0052"  # 2 + 0.8 (6 - 2)
    assert rows["cylinder, more than the true rig, mm"][:2] == ("0.0005", "0.0025")
    assert rows["better than plain, wall"][0] == "67%"
    assert rows["corners kept"][:2] == ("100.00%", "99.84%")
    assert rows["error of camera focal lengths, px, rms"][0] == "0.100"
    assert rows["error of angle between the devices, mdeg, rms"][0] == "0.573"
    assert rows["wall error over predicted, rms"][0] == "2.00"
    # 1.5, 0.5 and -0.5: the root of 2.75 / 3
    assert rows["parameter error over sigma, rms"][0] == "0.50 to 0.96"
    assert rows["  the latter over the flat board's"][0] == "2.00"  # seed 0 alone: 2 over 1 µm
    assert rows["halves apart over predicted: flat board"][0] == "2.00 (1.00 to 3.00)"


def test_the_notes_count_findings() -> None:
    """The sites of seeds 1 and 2 err together by 2 and 3."""
    notes = " ".join(make_notes(results()))
    assert "flat board 2 of 3, bowed, taken as flat 0 of 1" in notes
    assert "camera.cx has 0.50, camera.fx 0.96" in notes


def test_the_picture_shows_every_trial(tmp_path: Path) -> None:
    figure = draw_trials(results())
    left, right = figure.axes
    dots = [
        np.shape(part.get_offsets())[0] for part in left.collections if hasattr(part, "get_offsets")
    ]
    assert dots.count(3) == 6  # three quantities, ours and plain
    assert next(text.get_text() for text in right.get_xticklabels()) == "flat board"
    assert save_figure(figure, tmp_path / "trials.png").stat().st_size > 10_000


def test_an_unknown_study() -> None:
    with pytest.raises(UsageError, match=r"study must be one of calibration.*, got 'tea'"):
        named_study("tea")
