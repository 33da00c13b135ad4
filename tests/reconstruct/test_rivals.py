"""Rivals in closed form: exact on what they can describe, and only on that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.errors import ShapeError
from fringeworks.geometry.lens import project
from fringeworks.model import Rig
from fringeworks.reconstruct.rivals import PixelPolynomials, RationalModel
from tests.scenes import PROJECTOR, RIG

Array = NDArray[np.float64]

PINHOLE = replace(
    RIG, projector=replace(PROJECTOR, lens=replace(PROJECTOR.lens, k1=0.0, k2=0.0, p1=0.0, p2=0.0))
)


def seen(rig: Rig, count: int = 400, seed: int = 0) -> tuple[Array, Array, Array]:
    """Rays, columns and depths of points anywhere in the volume."""
    rng = np.random.default_rng(seed)
    rays, depth = rng.uniform(-0.18, 0.18, (2, count)), rng.uniform(560, 760, count)
    points = np.column_stack([rays.T, np.ones(count)]) * depth[:, None]
    lit = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)
    return rays, lit[:, 0], depth


@pytest.mark.parametrize("above", [2, 6])
def test_a_pinhole_projector_is_within_both(above: int) -> None:
    """Null vectors of 12 columns of size one, to rounding: some 1e-12 of 700 mm, ten times that."""
    model = RationalModel.fit(*seen(PINHOLE), above=above)
    rays, column, depth = seen(PINHOLE, seed=1)
    np.testing.assert_allclose(model.depth(rays, column), depth, atol=1e-8)


def test_a_distorted_projector_is_beyond_both() -> None:
    fraction, governing = (RationalModel.fit(*seen(RIG), above=above) for above in (2, 6))
    rays, column, depth = seen(RIG, seed=1)
    off = [float(np.std(model.depth(rays, column) - depth)) for model in (fraction, governing)]
    assert off[0] > off[1] > 0.01


def test_what_only_the_larger_one_can_describe() -> None:
    rays, column, _ = seen(PINHOLE)
    x, y = rays
    depth = (700 + 50 * x - 30 * y + 0.1 * column * x) / (1 + 0.2 * x + 1e-4 * column * y)
    model = RationalModel.fit(rays, column, depth, above=6)
    np.testing.assert_allclose(model.depth(rays, column), depth, atol=1e-8)
    fraction = RationalModel.fit(rays, column, depth, above=2)
    assert np.abs(fraction.depth(rays, column) - depth).max() > 0.01


@pytest.mark.parametrize(("above", "count", "message"), [(4, 50, "2 or 6"), (6, 11, "12, got 11")])
def test_a_wrong_call_is_refused(above: int, count: int, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        RationalModel.fit(*seen(PINHOLE, count), above=above)


def test_every_pixel_has_a_quadratic_of_its_own() -> None:
    """Five planes at one pixel; three, which is too few, at another; none elsewhere."""
    pixels = np.array([[1] * 5 + [0] * 3, [0] * 5 + [1] * 3])
    coordinate = np.array([100.0, 130, 170, 190, 250, 300, 320, 340])
    depth = 600 + 0.8 * coordinate - 1e-3 * coordinate**2
    model = PixelPolynomials.fit(pixels, coordinate, depth, shape=(2, 3))
    z = model.depth(np.full((2, 3), 210.0, np.float32))
    assert np.isfinite(z).sum() == 1
    assert z[0, 1] == pytest.approx(600 + 0.8 * 210 - 1e-3 * 210**2, abs=1e-9)


def test_points_of_one_coordinate_are_no_polynomial() -> None:
    alike = np.full(6, 210.0)
    model = PixelPolynomials.fit(np.zeros((2, 6), np.intp), alike, alike + 400, shape=(1, 1))
    assert np.isnan(model.depth(np.full((1, 1), 210.0))).all()
