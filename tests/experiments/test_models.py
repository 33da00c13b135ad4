"""The study of models: its table, what it keeps, and rivals on points that they describe."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fringeworks.calibrate.extended.planes import PlanePoints
from fringeworks.calibrate.extended.points import Measured
from fringeworks.errors import FormatError
from fringeworks.experiments import models
from fringeworks.experiments.extended import ModelScore
from fringeworks.experiments.held_rig import Still
from fringeworks.experiments.model_trials import FieldTold, ModelTrial
from fringeworks.experiments.models import MODELS, median_scores, study_models
from fringeworks.experiments.rivals import FRACTION, GOVERNING, PIXELS, fit_rivals
from fringeworks.experiments.studies import named_study
from fringeworks.geometry.lens import unproject
from fringeworks.model import Camera, Rig
from tests.scenes import PROJECTOR, RIG, map_of, plane_points

PINHOLE = replace(
    RIG,
    camera=Camera(152, 96, replace(RIG.camera.lens, cx=76.0, cy=48.0)),
    projector=replace(PROJECTOR, lens=replace(PROJECTOR.lens, k1=0.0, k2=0.0, p1=0.0, p2=0.0)),
    volume_mm=(600.0, 700.0),
)
HELD = object()


def canned(rig: str, seed: int) -> ModelTrial:
    """A trial whose model number n is off by n + seed µm."""
    scores = {
        model: ModelScore(*(1e-3 * (place + seed) for _ in range(5)))
        for place, model in enumerate(MODELS)
    }
    field = FieldTold("full", "x", 3 * seed, 0.005, 0.004)
    return ModelTrial(rig, seed, scores, (field,), 0.25)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int, bool, int]]:
    """What was run, as (rig, seed, quick, projector's width); its result is canned."""
    done = []

    def fake(rig: tuple[str, Rig], *_: Any, seed: int, quick: bool, **others: Any) -> ModelTrial:
        assert others["held_out"] is HELD
        done.append((rig[0], seed, quick, rig[1].projector.width))
        return canned(rig[0], seed)

    monkeypatch.setattr(models, "run_models", fake)
    monkeypatch.setattr(models, "HeldOut", SimpleNamespace(of=lambda *_: HELD))
    return done


def test_each_rig_is_told_model_by_model(tmp_path: Path, runs: list[Any]) -> None:
    study = named_study("models")(tmp_path, seeds=3, quick=False, progress=lambda items, _: items)
    assert [run[:2] for run in runs] == [
        (rig, seed) for rig in ("paper", "far_warped") for seed in range(3)
    ]
    assert len(study.rows) == 2 * len(MODELS)
    assert {len(row) for row in study.rows} == {len(study.head)}
    assert study.rows[1][:2] == ("the paper's rig, geometric + field", "2.0")  # of 1, 2 and 3
    assert study.rows[-1][0] == f"warped strong, {PIXELS}"
    assert any("order none, 3, 6" in note for note in study.notes)
    assert any("25% of a wall's pixels" in note for note in study.notes)
    assert [len(axes.collections) for axes in study.draw().axes] == [4, 4]
    study_models(tmp_path, seeds=3)
    assert len(runs) == 6  # kept


def test_quick_runs_one_of_each_at_half_the_size(tmp_path: Path, runs: list[Any]) -> None:
    study_models(tmp_path, quick=True)
    assert runs == [("paper", 0, True, 304), ("far_warped", 0, True, 304)]
    assert sorted(path.name for path in (tmp_path / "seeds-quick").iterdir()) == [
        "far_warped-00.json",
        "paper-00.json",
    ]


@pytest.mark.usefixtures("runs")
def test_a_kept_file_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "seeds").mkdir()
    (tmp_path / "seeds" / "paper-00.json").write_text('{"rig": "paper"}')
    with pytest.raises(FormatError, match="not a calibration of this study"):
        study_models(tmp_path, seeds=1)


def test_medians_are_of_each_quantity() -> None:
    scores = median_scores([canned("paper", seed) for seed in (0, 5, 1)])
    assert list(scores) == list(MODELS)
    assert scores["full"].radius_error_mm == pytest.approx(1e-3 * (MODELS.index("full") + 1))


def test_rivals_scan_what_they_were_fitted_to() -> None:
    """Five planes seen without noise, at every pixel, by a projector that does not distort.

    Coordinates are in single precision, 3e-5 px of 4 mm, the clouds too: 6e-5 mm of 700.
    """
    planes = [plane_points(PINHOLE, (0.1, 0.05, 1.0), z) for z in (600.0, 630, 650, 680, 710)]
    columns = [map_of(PINHOLE, xyz).axes[0].coordinate.astype(np.float64) for xyz in planes]
    v, u = np.mgrid[:96, :152].astype(np.float64)
    rays = unproject(np.stack([u, v], axis=-1), PINHOLE.camera.lens.vector).reshape(-1, 2).T
    points = PlanePoints(
        np.tile(rays, 5),
        np.concatenate([column.ravel() for column in columns]),
        np.concatenate([xyz[..., 2].ravel() for xyz in planes]),
        np.full(5 * u.size, 0.02),
        np.repeat(np.arange(5), u.size),
    )
    rivals = fit_rivals(Measured(points, "x", 32.0), PINHOLE)
    assert list(rivals) == [GOVERNING, FRACTION, PIXELS]
    held = plane_points(PINHOLE, (-0.05, 0.02, 1.0), 655.0)
    still = cast(Still, SimpleNamespace(projector_map=map_of(PINHOLE, held)))
    clouds = {name: scan(still) for name, scan in rivals.items()}
    for name in (GOVERNING, FRACTION):
        np.testing.assert_allclose(clouds[name].xyz, held, atol=1e-3)
    # a quadratic through a fraction, over 110 mm of depth
    np.testing.assert_allclose(clouds[PIXELS].xyz[..., 2], held[..., 2], atol=0.2)
    beyond = plane_points(PINHOLE, (0.0, 0.0, 1.0), 730.0)
    far = cast(Still, SimpleNamespace(projector_map=map_of(PINHOLE, beyond)))
    assert not rivals[FRACTION](far).valid.any()
