"""A rig's residual fields as scans apply them: which axis, which model, and told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fringeworks.experiments.calibrations import half_rig
from fringeworks.model import Axis, ModelName, ResidualField
from fringeworks.model.residual import count_terms
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import scan
from fringeworks.reconstruct.full import CloudRules
from fringeworks.reconstruct.fused_plan import prepare_scan
from fringeworks.reconstruct.residual import notice_fields, take_residuals
from fringeworks.twin.effects import Effects
from fringeworks.twin.scenes import paper_rig, wall_scene
from fringeworks.twin.simulate import simulate
from tests.scenes import RIG, map_of, plane_points


def constant(model: ModelName, axis: Axis, px: float) -> ResidualField:
    """A field that is the same everywhere."""
    return ResidualField(
        model=model,
        axis=axis,
        order=1,
        middle=(0.0, 0.0, 0.0),
        low=(0.0, 0.0, 0.0),
        high=(751.0, 479.0, 608.0),
        coefficients=(px,) + (0.0,) * (count_terms(1) - 1),
        gain=0.9,
        gain_sigma=0.01,
    )


def test_each_axis_and_model_has_its_own() -> None:
    rig = replace(RIG, residual=(constant("full", "x", 0.5), constant("geometric", "y", 0.25)))
    seen = map_of(RIG, plane_points(RIG, (0.0, 0.0, 1.0), 650.0))
    assert seen.column is not None
    assert seen.row is not None
    full = take_residuals(seen, rig, "full")
    assert full.column is not None
    assert full.row is seen.row
    # half a unit in the last place of a float32 below 1024
    np.testing.assert_allclose(seen.column.coordinate - full.column.coordinate, 0.5, atol=6.2e-5)
    paper = take_residuals(seen, rig, "geometric")
    assert paper.column is seen.column
    assert paper.row is not None
    np.testing.assert_allclose(seen.row.coordinate - paper.row.coordinate, 0.25, atol=6.2e-5)
    assert take_residuals(seen, rig, "extended") == seen


def test_it_is_told() -> None:
    rig = replace(RIG, residual=(constant("full", "x", 0.5), constant("full", "y", 0.25)))
    (note,) = notice_fields(rig, "full")
    assert "order 1 along x and of order 1 along y" in note.message
    assert notice_fields(rig, "geometric") == ()


@pytest.mark.parametrize("model", ["full", "geometric"])
def test_a_scan_takes_it_before_it_triangulates(model: ModelName) -> None:
    """Coordinates that are read half a pixel too large give back what a true reading gives.

    In single precision the coordinate is known to 1.5e-5 px, and one px is worth some 8 mm;
    tables are within 1e-3 mm, one of each rig.
    """
    true = half_rig(paper_rig())
    patterns = make_sequence(
        "measure", width=true.projector.width, height=true.projector.height, axes=("x",)
    )
    made = simulate(
        wall_scene(),
        true,
        patterns,
        effects=Effects().without_noise(),
        rng=np.random.default_rng(0),
    )
    lens = true.projector.lens
    shifted = replace(true, projector=replace(true.projector, lens=replace(lens, cx=lens.cx - 0.5)))
    mended = replace(shifted, residual=(constant(model, "x", 0.5),))
    rules = CloudRules(edges=None)
    # what would go in one pass over the frames, which knows no fields
    assert prepare_scan(made.capture, shifted, cloud_rules=rules) is not None
    plain, off, back = (
        scan(made.capture, rig, model=model, cloud_rules=rules) for rig in (true, shifted, mended)
    )
    wrong = np.nanmedian(np.abs(off.xyz[..., 2] - plain.xyz[..., 2]))
    left = np.nanmax(np.abs(back.xyz[..., 2] - plain.xyz[..., 2]))
    assert wrong > 1.0
    assert left < 3e-3
    assert any("residual field" in finding.message for finding in back.findings)
    assert not any("residual field" in finding.message for finding in off.findings)
