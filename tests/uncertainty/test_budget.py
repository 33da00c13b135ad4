"""The error budget against sampling and by hand; the working range."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import UsageError
from fringeworks.model import Camera, Lens, Pose, Projector, ProjectorMap, Rig
from fringeworks.patterns import make_sequence
from fringeworks.reconstruct.geometric import triangulate_by_phase
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import paper_rig
from fringeworks.uncertainty.budget import (
    KINDS,
    SAMPLES,
    Budget,
    finest_fringes,
    make_budget,
    sample_budget,
)
from fringeworks.uncertainty.contributions import DISTORTION, GROUPS, Setting
from fringeworks.uncertainty.seen import Seen, working_range
from tests.scenes import coded_axis
from tests.uncertainty.rigs import calibrated, rig_of, truth

DEPTHS = (560.0, 650.0, 740.0)
FRINGES = finest_fringes(make_sequence("measure", width=608, height=684))
SETTING = Setting(calibrated(), FRINGES, Effects())


@pytest.fixture(scope="module")
def budget() -> Budget:
    return make_budget(SETTING, DEPTHS)


def test_every_class_has_its_sources(budget: Budget) -> None:
    kinds = [source.kind for source in budget.sources]
    assert kinds == sorted(kinds, key=KINDS.index)
    assert [s.name for s in budget.sources if s.kind == "parameters"] == list(GROUPS)
    assert all((source.sigma_mm >= 0).all() for source in budget.sources)


def test_propagation_is_monte_carlo(budget: Budget) -> None:
    """Draws of one wall err together: 4 sigma of a deviation from a thousand is 9 %."""
    sampled = sample_budget(SETTING, DEPTHS, rng=np.random.default_rng(2))
    for kind in ("parameters", "phase"):
        ratio = budget.of_kind(kind) / sampled[kind]
        assert np.abs(ratio - 1).max() < 4 / math.sqrt(2 * SAMPLES)


def test_parameters_together_are_less_than_their_sum(budget: Budget) -> None:
    """Principal points of camera and projector trade with the rotation; the form has even less."""
    assert budget.parameters_mm is not None
    assert budget.aligned_mm is not None
    alone = [source.sigma_mm for source in budget.sources if source.kind == "parameters"]
    assert (budget.parameters_mm < np.sqrt(np.sum(np.square(alone), axis=0)) / 2).all()
    assert (budget.aligned_mm < budget.parameters_mm).all()


def test_totals_are_quadratures(budget: Budget) -> None:
    classes = [budget.of_kind(kind) for kind in KINDS]
    np.testing.assert_allclose(budget.total_mm, np.sqrt(np.sum(np.square(classes), axis=0)))
    scaled = make_budget(replace(SETTING, rig=replace(SETTING.rig, scale_sigma=1e-3)), DEPTHS)
    assert budget.parameters_mm is not None
    expected = np.hypot(budget.parameters_mm, 1e-3 * np.array(DEPTHS))
    np.testing.assert_allclose(scaled.of_kind("parameters"), expected, rtol=1e-9)


def test_distortion_counts_where_equation_1_is_used(budget: Budget) -> None:
    """The full model has the table's bound alone, at most a micrometre."""
    assert budget.of_kind("model").max() <= 1e-3
    plain = make_budget(replace(SETTING, geometric=True), DEPTHS)
    (left_out,) = [s.sigma_mm for s in plain.sources if (s.kind, s.name) == DISTORTION]
    np.testing.assert_allclose(plain.of_kind("model"), left_out)
    assert left_out.min() > 0.05


def test_what_is_left_out_is_what_the_geometric_model_misses() -> None:
    """Against `triangulate_by_phase` on the wall's exact pixels, at the same grid of places."""
    rig = rig_of(truth())
    depth = np.full((rig.camera.height, rig.camera.width), 650.0)
    v, u = np.mgrid[: rig.camera.height, : rig.camera.width].astype(float)
    seen = Seen.of(rig, np.stack([u.ravel(), v.ravel()], axis=1), depth.ravel())
    column = np.where(seen.lit(rig), seen.projector_px[:, 0], np.nan).reshape(depth.shape)
    coded = coded_axis("x", column, 0.02)
    error = triangulate_by_phase(ProjectorMap(coded, None), rig).xyz[..., 2] - depth
    everywhere = float(np.sqrt(np.nanmean(error.astype(float) ** 2)))
    found = make_budget(Setting(rig, FRINGES, Effects()), (650.0,))
    (left_out,) = [s.sigma_mm[0] for s in found.sources if (s.kind, s.name) == DISTORTION]
    assert left_out == pytest.approx(everywhere, rel=0.1)  # 117 places stand for 360 960


def test_pinholes_leave_no_distortion_out() -> None:
    rig = calibrated()
    lenses = [
        replace(one.lens, k1=0.0, k2=0.0, p1=0.0, p2=0.0) for one in (rig.camera, rig.projector)
    ]
    straight = replace(
        rig,
        camera=replace(rig.camera, lens=lenses[0]),
        projector=replace(rig.projector, lens=lenses[1]),
    )
    found = make_budget(Setting(straight, FRINGES, Effects(), geometric=True), DEPTHS)
    assert found.of_kind("model").max() < 1e-9


def test_without_a_covariance_parameters_are_left_out() -> None:
    found = make_budget(Setting(rig_of(truth()), FRINGES, Effects()), DEPTHS)
    assert found.parameters_mm is None
    assert not found.of_kind("parameters").any()
    assert not sample_budget(
        Setting(rig_of(truth()), FRINGES, Effects()), DEPTHS[:1], rng=np.random.default_rng(0)
    )["parameters"].any()


def test_a_fringe_of_depth_by_hand() -> None:
    """Pinholes side by side: P z^2 / (f b) = 32 x 600^2 / (1000 x 120) = 96 mm."""
    pinhole = Lens(1000.0, 1000.0, 50.0, 40.0)
    pose = Pose(np.eye(3), np.array([120.0, 0.0, 0.0]))
    rig = Rig(Camera(100, 80, pinhole), Projector(400, 80, pinhole), pose)
    fringes = finest_fringes(
        make_sequence("paper", width=400, height=80, axes=("x",), codewords_px=())
    )
    found = make_budget(Setting(rig, fringes, Effects()), (600.0,))
    assert found.fringe_mm == pytest.approx([96.0])
    assert found.camera_px_mm == pytest.approx([0.6])


def test_an_unlit_wall_is_refused() -> None:
    with pytest.raises(UsageError, match="must light the wall at z = 50 mm, got no lit point"):
        make_budget(SETTING, (50.0,))


def test_a_sequence_without_fringes_is_refused() -> None:
    sequence = make_sequence("measure", width=608, height=684)
    with pytest.raises(UsageError, match="a budget needs fringes"):
        finest_fringes(replace(sequence, sets=sequence.sets[-2:]))


def test_the_working_range_by_hand() -> None:
    """Pinholes side by side, 100 px wide, b = 120 mm: shifted by f b / z against 400 px.

    The projector's image begins 50 px left of its axis and ends 350 px right; a wall's pixel u
    shows column u + f b / z. All of it is lit while f b / z is at most 300: beyond 400 mm; seven
    tenths while it is 330: beyond 364 mm. At the far end nothing is lost.
    """
    pinhole = Lens(1000.0, 1000.0, 49.5, 39.5)
    pose = Pose(np.eye(3), np.array([120.0, 0.0, 0.0]))
    rig = Rig(Camera(100, 80, pinhole), Projector(400, 80, pinhole), pose)
    near, far = working_range(rig)
    assert near == pytest.approx(1000 * 120 / 330, rel=0.03)
    assert far == math.inf


def test_a_rig_like_the_papers_works_where_the_paper_says() -> None:
    """364 to 2169 mm; the paper gives neither baseline nor angle, so within a tenth."""
    near, far = working_range(paper_rig())
    assert near == pytest.approx(364, rel=0.1)
    assert far == pytest.approx(2169, rel=0.1)


def test_a_projector_that_looks_away_works_nowhere() -> None:
    rig = paper_rig()
    pose = rig.projector_from_camera
    away = replace(pose, translation_mm=pose.translation_mm + np.array([1e5, 0, 0]))
    with pytest.raises(UsageError, match="got no such depth"):
        working_range(replace(rig, projector_from_camera=away))
