"""The studies of the paper's models: forms in closed form, drawn rigs, the twin's walls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fringeworks.calibrate.extended.fit import PRIORS
from fringeworks.experiments.calibrations import half_rig
from fringeworks.experiments.extended import HEAD as TWIN_HEAD
from fringeworks.experiments.extended import HeldOut, score_models, tabulate_scores
from fringeworks.experiments.extended_rigs import KINDS, MODELS, Kind, draw_rig, run_rig
from fringeworks.experiments.extended_study import (
    HEAD,
    QUANTITIES,
    ratios_of,
    sizes_of,
    study_extended,
)
from fringeworks.experiments.ray_forms import (
    BALL_RADIUS_MM,
    BALLS_MM,
    CYLINDER_MM,
    CYLINDER_RADIUS_MM,
    FormErrors,
    Forms,
    judge_scan,
)
from fringeworks.experiments.studies import named_study
from fringeworks.geometry.lens import project
from fringeworks.model import Extended, no_progress
from fringeworks.patterns import make_sequence
from fringeworks.twin.scenes import paper_rig

PINHOLE, DISTORTED, POOR, NEAR, FAR, *_ = KINDS


@pytest.fixture(scope="module")
def forms() -> Forms:
    return Forms.of(paper_rig())


def test_forms_are_what_they_say(forms: Forms) -> None:
    """Rounding of lengths of 700 mm."""
    across = forms.cylinder.points - CYLINDER_MM
    np.testing.assert_allclose(np.hypot(across[:, 0], across[:, 2]), CYLINDER_RADIUS_MM, rtol=1e-11)
    for ball, middle in zip(forms.balls, BALLS_MM, strict=True):
        away = np.linalg.norm(ball.points - middle, axis=1)
        np.testing.assert_allclose(away, BALL_RADIUS_MM, rtol=1e-11)
        assert (ball.points[:, 2] < middle[2]).all()
    assert len({len(plane.points) for plane in forms.planes}) == 1
    seen = project(forms.cylinder.points, paper_rig().camera.lens.vector)
    np.testing.assert_allclose(forms.cylinder.camera_px, seen)


def test_a_perfect_scan_has_no_error_and_a_scaled_one_has(forms: Forms) -> None:
    planes = tuple(plane.points for plane in forms.planes)
    balls = tuple(ball.points for ball in forms.balls)
    none = judge_scan(forms, (planes, forms.cylinder.points, balls))
    assert max(abs(getattr(none, key)) for key in QUANTITIES) < 1e-6
    grown = judge_scan(
        forms,
        (
            tuple(1.001 * plane for plane in planes),
            1.001 * forms.cylinder.points,
            tuple(1.001 * ball for ball in balls),
        ),
    )
    assert grown.plane_form_mm < 1e-6
    assert grown.cylinder_radius_mm == pytest.approx(0.001 * CYLINDER_RADIUS_MM, rel=1e-4)
    assert grown.ball_radius_mm == pytest.approx(0.001 * BALL_RADIUS_MM, rel=1e-4)
    distance = np.linalg.norm(np.subtract(*BALLS_MM))
    assert grown.ball_distance_mm == pytest.approx(0.001 * distance, rel=1e-4)
    assert 0.01 < grown.planes_rms_mm < 0.2


def test_forms_nearer_by_scale_keep_their_place_in_the_image(forms: Forms) -> None:
    """What the projector does not light is left out, and its share told."""
    assert forms.lit == 1
    near = Forms.of(paper_rig(), 364 / 660)
    assert near.balls[1].lit == 1
    np.testing.assert_allclose(near.balls[1].points * 660 / 364, forms.balls[1].points)
    np.testing.assert_allclose(near.balls[1].camera_px, forms.balls[1].camera_px)
    assert 0.5 < near.planes[1].lit < 0.9
    assert near.lit <= near.planes[1].lit
    assert near.planes[1].projector_px.min() > -0.5
    same = (tuple(p.points for p in near.planes), near.cylinder.points)
    none = judge_scan(near, (*same, tuple(ball.points for ball in near.balls)))
    assert max(abs(getattr(none, key)) for key in QUANTITIES) < 1e-6


@pytest.mark.parametrize("kind", [NEAR, FAR])
def test_rigs_at_the_ends_light_the_forms_and_the_boards_are_there(kind: Kind) -> None:
    drawn = draw_rig(kind, np.random.default_rng(1))
    assert Forms.of(drawn.true, kind.forms_mm / 660).lit >= 0.5
    middle = np.median(drawn.points.depth)
    assert middle == pytest.approx(kind.boards_mm, rel=0.05)
    assert kind.view_mm == pytest.approx(752 / 1974 * kind.forms_mm)


def test_rigs_are_drawn_as_stated() -> None:
    """Errors of twenty rigs: their root mean square is known to 16 %, so within 50 % of sigma."""
    drawn = [draw_rig(PINHOLE, np.random.default_rng(seed)) for seed in range(20)]
    longer = [d.found.projector.lens.fx - d.true.projector.lens.fx for d in drawn]
    moved = [
        d.found.projector_from_camera.translation_mm - d.true.projector_from_camera.translation_mm
        for d in drawn
    ]
    assert np.sqrt(np.mean(np.square(longer))) == pytest.approx(PRIORS["Kfp"], rel=0.5)
    assert np.sqrt(np.mean(np.square(moved))) == pytest.approx(PRIORS["C1"], rel=0.3)
    baselines = [d.true.baseline_mm for d in drawn]
    assert 100 < min(baselines) < 160 < 220 < max(baselines) < 300
    assert all(d.true.camera.lens.k1 == 0 for d in drawn)
    bent = draw_rig(DISTORTED, np.random.default_rng(0)).true
    assert bent.camera.lens.k1 != 0
    assert bent.projector.lens.p1 != 0


def test_the_same_seed_is_the_same_rig() -> None:
    """To what the threads of OpenCV's camera calibration sum in any order."""
    one, again = run_rig(POOR, 3), run_rig(POOR, 3)
    for model in MODELS:
        for key in QUANTITIES:
            assert getattr(one[model], key) == pytest.approx(getattr(again[model], key), abs=1e-5)
    assert run_rig(POOR, 4)["map"].planes_rms_mm != pytest.approx(
        one["map"].planes_rms_mm, abs=1e-5
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", [PINHOLE, DISTORTED])
def test_map_is_hardly_ever_worse_than_geometric(kind: Kind) -> None:
    """Ten rigs: at a true share of 95 % fewer than eight would be one case in 90."""
    rigs = [run_rig(kind, seed) for seed in range(10)]
    for key in ("planes_rms_mm", "cylinder_radius_mm", "ball_radius_mm", "ball_distance_mm"):
        assert np.count_nonzero(ratios_of(rigs, key) <= 1.02) >= 8
    assert np.median(ratios_of(rigs, "ball_distance_mm")) < 0.2
    assert np.median(ratios_of(rigs, "planes_rms_mm")) < 0.3


def test_ratios_are_of_sizes() -> None:
    trial = {
        "geometric": FormErrors(0.1, 0.2, -0.3, 0.4, -0.5),
        "paper": FormErrors(0.1, 0.2, 0.6, 0.4, -0.5),
        "map": FormErrors(0.1, 0.1, 0.15, -0.4, 0.05),
    }
    assert sizes_of([trial], "cylinder_radius_mm", "geometric").tolist() == [0.3]
    assert ratios_of([trial], "cylinder_radius_mm").tolist() == [0.5]
    assert ratios_of([trial], "cylinder_radius_mm", "paper").tolist() == [2.0]
    assert ratios_of([trial], "ball_distance_mm")[0] == pytest.approx(0.1)


def test_the_study_tells_all_of_it(tmp_path: Path) -> None:
    study = named_study("extended")(tmp_path, seeds=None, quick=True, progress=no_progress)
    assert named_study("extended") is study_extended
    assert len(study.rows) == len(KINDS) * len(QUANTITIES)
    assert {len(row) for row in study.rows} == {len(HEAD)}
    assert [row[0] for row in study.rows[:2]] == ["pinhole, planes rms", "pinhole, plane form"]
    trials = study.numbers["trials"]
    assert list(trials) == [kind.name for kind in KINDS]
    assert list(trials["pinhole"][0]) == list(MODELS)
    assert len(trials["pinhole"]) == 3
    assert study.numbers["twin"] == {}
    assert len(study.draw().axes) == len(KINDS) + 1  # and one for the legend
    assert any(note.startswith("MAP no worse in less than 95%") for note in study.notes)


def test_the_twins_walls_tell_the_models_apart() -> None:
    """With the true rig: what the full model leaves is the twin's own, 8 bits and its decoding."""
    rig = half_rig(paper_rig())
    patterns = make_sequence("paper", width=rig.projector.width, height=rig.projector.height)
    held_out = HeldOut.of(rig, patterns)
    fitted = replace(rig, extended=Extended("x", 32.0, Kphi=-0.05))
    scores = score_models(
        {"geometric": (rig, "geometric"), "extended": (fitted, "extended"), "full": (rig, "full")},
        held_out,
    )
    assert scores["full"].planes_systematic_mm < 0.02 < scores["geometric"].planes_systematic_mm
    assert scores["full"].planes_form_mm < 0.01 < 0.1 < scores["geometric"].planes_form_mm
    assert abs(scores["full"].radius_error_mm) < 0.01
    assert scores["full"].planes_rms_mm > 0.05
    assert scores["extended"].planes_systematic_mm != scores["geometric"].planes_systematic_mm
    rows = tabulate_scores(scores)
    assert [row[0] for row in rows] == ["geometric", "extended", "full"]
    assert {len(row) for row in rows} == {len(TWIN_HEAD)}
