"""The table stands for the full model: everywhere within 1 um, and it knows where it does not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fringeworks.errors import UsageError
from fringeworks.model import Axis, Cloud, Lens, ProjectorMap, Rig
from fringeworks.reconstruct.full import CloudRules, triangulate
from fringeworks.reconstruct.table import STEPS_PX, make_table, table_for
from tests.scenes import RIG, map_of, plane_points

DEPTHS = (600.0, 820.0)
TILTED = plane_points(RIG, (0.1, -0.2, 0.97), 680.0)
ONE_UM = 1e-3
SINGLE_MM = 4e-4
"""Rounding of coordinates to 3e-5 px, at up to 3 mm / px of the badly placed axis y, and of z."""

AXES: tuple[Axis | None, ...] = ("x", "y", None)
DEFAULTS = CloudRules(z_range_mm=DEPTHS, edges=None)


def both_ways(seen: ProjectorMap, rig: Rig, rules: CloudRules) -> tuple[Cloud, Cloud]:
    """By table and by iteration."""
    return (
        triangulate(seen, rig, rules=rules),
        triangulate(seen, rig, rules=replace(rules, exact=True)),
    )


@pytest.mark.parametrize("axis", ["x", None])
def test_the_table_gives_the_full_models_points(axis: Axis | None) -> None:
    seen = map_of(RIG, TILTED)
    table, exact = both_ways(seen, RIG, replace(DEFAULTS, axis=axis))
    np.testing.assert_array_equal(table.valid, exact.valid)
    np.testing.assert_array_equal(table.reason, exact.reason)
    assert table.valid.mean() > 0.3
    np.testing.assert_allclose(table.xyz, exact.xyz, rtol=0, atol=ONE_UM)
    np.testing.assert_allclose(table.sigma_mm, exact.sigma_mm, rtol=1e-3)
    assert (table.xyz[table.valid] != exact.xyz[exact.valid]).any()
    if axis is None:
        np.testing.assert_allclose(table.epipolar_px, exact.epipolar_px, atol=1e-3)


@pytest.mark.parametrize("axis", AXES)
def test_the_bound_holds_where_nobody_looked(axis: Axis | None) -> None:
    """Of points at random depths and pixels none lies further from the model's than the bound."""
    table = make_table(RIG, axis, DEPTHS)
    assert table.holds == (table.bound_mm <= ONE_UM)
    if not table.holds:
        assert table_for(RIG, axis, DEPTHS) is None
        return
    rng = np.random.default_rng(4)
    rays = plane_points(RIG, (0.0, 0.0, 1.0), 1.0)
    depth = rng.uniform(*DEPTHS, rays.shape[:2])
    xyz = rays * depth[..., None]
    found = triangulate(map_of(RIG, xyz), RIG, rules=replace(DEFAULTS, axis=axis))
    misses = np.linalg.norm(found.xyz - xyz, axis=-1)
    assert found.valid.mean() > 0.98
    assert np.nanmax(misses) < table.bound_mm + SINGLE_MM


def test_it_is_as_coarse_as_it_may_be() -> None:
    """Lenses that bend more need a finer lattice; the error then falls with its fourth power."""
    bent = replace(RIG.camera.lens, k1=-0.4, k2=0.3)
    strong = replace(RIG, camera=replace(RIG.camera, lens=bent))
    coarse, fine = make_table(RIG, "x", DEPTHS), make_table(strong, "x", DEPTHS)
    assert max(coarse.step_px) <= STEPS_PX[0]
    assert coarse.nodes.size <= fine.nodes.size
    assert fine.holds


def test_without_distortion_lines_are_not_bent_twice() -> None:
    """Depth over coordinate is equation (1) then, c2 and c3 are nothing; what remains of the bound
    is that a ratio of linear functions of the pixel is no cubic."""
    pinhole = replace(
        RIG,
        camera=replace(RIG.camera, lens=Lens(1974, 1970, 376, 240)),
        projector=replace(RIG.projector, lens=Lens(1013, 1015, 300, 700)),
    )
    table, bent = make_table(pinhole, "x", DEPTHS), make_table(RIG, "x", DEPTHS)
    for of_pinhole, of_lenses in zip(
        np.abs(table.nodes[4:6]), np.abs(bent.nodes[4:6]), strict=True
    ):
        assert of_pinhole.max() < 1e-6 * of_lenses.max()
    assert table.bound_mm < 2e-4


def test_a_lens_that_no_lattice_follows_has_no_table() -> None:
    """Its own iteration has no inverse in the corners."""
    wild = replace(RIG, camera=replace(RIG.camera, lens=replace(RIG.camera.lens, k1=-9.0)))
    assert not make_table(wild, "x", DEPTHS).holds
    assert table_for(wild, "x", DEPTHS) is None


@pytest.mark.parametrize("window", [(0.0, 800.0), (600.0, math.inf)])
def test_open_ranges_have_no_table(window: tuple[float, float]) -> None:
    assert table_for(RIG, "x", window) is None
    with pytest.raises(UsageError, match="z-range must rise between 0 and infinity"):
        make_table(RIG, "x", window)
