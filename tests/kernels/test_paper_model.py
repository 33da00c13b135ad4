"""The paper's equations as kernels: by hand, against its printed form, against the full model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.geometry.lens import project, unproject
from fringeworks.kernels.normal_equations import (
    COLUMNS,
    slopes_of,
    sum_normal_equations,
    sum_squares,
)
from fringeworks.kernels.paper_model import paper_depths
from fringeworks.kernels.triangulate import solve_depth
from fringeworks.model import Axis, Extended, Lens, Pose, Rig
from fringeworks.reconstruct.geometric import equation_of
from tests.scenes import CAMERA, PROJECTOR, RIG

Array = NDArray[np.float64]

PINHOLE = replace(
    RIG,
    camera=replace(CAMERA, lens=Lens(1974, 1970, 376, 240)),
    projector=replace(PROJECTOR, lens=Lens(1013, 1015, 300, 700)),
)
TEN = Extended("x", 32.0, 0.4, -0.3, 1e-3, -8e-4, 3.0, 0.2, 4.0, -2.0, 3.0, 0.5)
P = 32.0


def seen(rig: Rig, axis: Axis, count: int = 200) -> tuple[Array, Array, Array]:
    """Rays ``(2, n)``, coordinates ``(n,)`` and depths ``(n,)`` of random points."""
    rng = np.random.default_rng(3)
    pixels = rng.uniform(0, (751, 479), (count, 2))
    depth = rng.uniform(550, 800, count)
    rays = unproject(pixels, rig.camera.lens.vector)
    points = np.column_stack([rays, np.ones(count)]) * depth[:, None]
    lit = project(rig.projector_from_camera.apply(points), rig.projector.lens.vector)
    column = 0 if axis == "x" else 1
    return np.ascontiguousarray(rays.T), np.ascontiguousarray(lit[:, column]), depth


def as_printed(rig: Rig, ten: Extended, rays: Array, coordinate: Array) -> Array:
    """Equations 4 to 7 in the paper's letters, K = 2 pi f / (phase lambda), C3 and C4 added."""
    inverse = rig.projector_from_camera.rotation  # R^-1: the paper's R is camera from projector
    translation = -inverse.T @ rig.projector_from_camera.translation_mm  # its T
    s = 0 if ten.axis == "x" else 1
    f, centre = (
        (rig.projector.lens.fx, rig.projector.lens.cx)
        if s == 0
        else (rig.projector.lens.fy, rig.projector.lens.cy)
    )
    camera = rig.camera.lens
    phase, phase_0 = (2 * np.pi * (at + 0.5) / ten.period_px for at in (coordinate, centre))
    big_k = 2 * np.pi * (f + ten.Kfp) / ((phase - phase_0 + ten.Kphi) * ten.period_px)
    d1 = (rays[0] * camera.fx + ten.Ku0) / (camera.fx + ten.Kfc)
    d2 = (rays[1] * camera.fy + ten.Kv0) / (camera.fy + ten.Kfc)
    row, last = inverse[s], inverse[2]
    up = big_k * (row @ translation + ten.C1) - (last @ translation + ten.C2)
    along = row[0] * d1 + row[1] * d2 + row[2] + ten.C3
    ahead = last[0] * d1 + last[1] * d2 + last[2] + ten.C4
    return np.asarray(up / (big_k * along - ahead) + ten.Kz)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("ten", [Extended("x", P), TEN])
def test_it_is_the_printed_equation(axis: Axis, ten: Extended) -> None:
    """Both divide numbers of size 1e4 to 1e5: some ten roundings of 1e-16 each, times 700 mm, and
    along y, where the baseline is 35 times shorter, the differences lose two digits more."""
    ten = replace(ten, axis=axis)
    rays, coordinate, _ = seen(RIG, axis)
    z, _ = paper_depths(rays, coordinate, equation_of(RIG, ten))
    np.testing.assert_allclose(z, as_printed(RIG, ten, rays, coordinate), rtol=1e-11)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_without_distortion_geometric_and_full_agree(axis: Axis) -> None:
    """To 1e-9 mm along x; y, whose baseline is 35 times shorter, loses as much by rounding."""
    rays, coordinate, depth = seen(PINHOLE, axis)
    z, slope = paper_depths(rays, coordinate, equation_of(PINHOLE, Extended(axis, P)))
    pose, lens = PINHOLE.projector_from_camera, PINHOLE.projector.lens.vector
    weight = (1.0, 0.0) if axis == "x" else (0.0, 1.0)
    for n, (x, y) in enumerate(rays.T):
        a, b, c = pose.rotation @ (x, y, 1.0)
        measured = (coordinate[n] * weight[0], coordinate[n] * weight[1])
        full, sigma, _ = solve_depth((a, b, c), pose.translation_mm, measured, weight, lens)
        assert abs(full - z[n]) < (1e-9 if axis == "x" else 5e-8)
        assert abs(slope[n]) == pytest.approx(sigma, rel=1e-6)
    np.testing.assert_allclose(z, depth, atol=1e-9 if axis == "x" else 5e-8)


def test_a_ray_worked_by_hand() -> None:
    """Projector 100 mm to the right, both straight ahead, f = 1000: a point at z = 500 mm on the
    camera's axis has column 320 - 1000 * 100 / 500 = 120; z = 1e5 / (320 - u), so that
    dz/du = z^2 / 1e5 = 2.5 mm per px. C1 = 1 mm lengthens r_s . T to 101: z = 505. Kphi =
    2 pi / 32 is one px towards the centre: z = 1e5 / 199."""
    lens = Lens(1000, 1000, 376, 240)
    rig = Rig(
        replace(CAMERA, lens=lens),
        replace(PROJECTOR, lens=replace(lens, cx=320.0)),
        Pose(np.eye(3), np.array([-100.0, 0, 0])),
    )
    rays, column = np.zeros((2, 1)), np.array([120.0])
    z, slope = paper_depths(rays, column, equation_of(rig, Extended("x", P)))
    assert z[0] == pytest.approx(500, rel=1e-15)
    assert slope[0] == pytest.approx(2.5, rel=1e-14)
    for changed, expected in (
        (Extended("x", P, C1=1.0), 505.0),
        (Extended("x", P, Kphi=2 * np.pi / P), 1e5 / 199),
        (Extended("x", P, Kz=0.5), 500.5),
        (Extended("x", P, Kfp=10.0), 505.0),
    ):
        z, _ = paper_depths(rays, column, equation_of(rig, changed))
        assert z[0] == pytest.approx(expected, rel=1e-14)


def test_at_the_projectors_centre_nothing_is_divided_by_zero() -> None:
    """There K is infinite and z = (r_s . T) / (r_s . ray)."""
    rays = np.array([[0.5], [-0.05]])
    centre = np.array([float(PINHOLE.projector.lens.cx)])
    z, _ = paper_depths(rays, centre, equation_of(PINHOLE, Extended("x", P)))
    row = PINHOLE.projector_from_camera.rotation[0]
    expected = -PINHOLE.projector_from_camera.translation_mm[0] / (row @ (0.5, -0.05, 1.0))
    assert z[0] == pytest.approx(expected, rel=1e-14)


def test_a_point_behind_the_projector_is_void() -> None:
    """On the far side of the epipole the lines meet behind."""
    rays, coordinate, _ = seen(PINHOLE, "x")
    away = np.full_like(coordinate, 5000.0)
    z, slope = paper_depths(rays, away, equation_of(PINHOLE, Extended("x", P)))
    lit = PINHOLE.projector_from_camera.apply(np.column_stack([*rays, np.ones(200)]) * z[:, None])
    assert np.isnan(z).any()
    assert (lit[np.isfinite(z), 2] > 0).all()
    assert (np.isnan(z) == np.isnan(slope)).all()


def test_slopes_are_the_derivatives() -> None:
    """Central differences of steps h err by h^2 z''' / 6 and by rounding 1e-13 / h."""
    rays, coordinate, _ = seen(RIG, "x", 20)
    slopes = slopes_of(rays, coordinate, equation_of(RIG, TEN))
    for place, name in enumerate(COLUMNS):
        step = 1e-4 * {"C3": 1e-3, "C4": 1e-3, "Kphi": 0.1}.get(name, 1.0)
        ends = [
            paper_depths(
                rays,
                coordinate,
                equation_of(RIG, replace(TEN, **{name: getattr(TEN, name) + sign * step})),
            )[0]
            for sign in (-1, 1)
        ]
        np.testing.assert_allclose(slopes[:, place], (ends[1] - ends[0]) / (2 * step), rtol=1e-5)


@pytest.mark.parametrize("count", [1, 127, 128, 129, 1000])
@pytest.mark.parametrize("weighted", [False, True])
def test_sums_are_those_of_the_whole_jacobian(count: int, weighted: bool) -> None:
    """About 1000 terms: rounding of 1e-16 each, of the largest."""
    rays, coordinate, depth = seen(RIG, "x", count)
    rng = np.random.default_rng(1)
    weights = rng.uniform(0.5, 2, count) if weighted else np.ones(1)
    equation = equation_of(RIG, TEN)
    z, _ = paper_depths(rays, coordinate, equation)
    rows = np.column_stack([slopes_of(rays, coordinate, equation), depth - z])
    expected = np.tril((rows.T * weights) @ rows)
    found = sum_normal_equations(rays, coordinate, depth, weights, equation)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert (np.abs(found - expected) <= 1e-13 * scale).all()
    assert sum_squares(rays, coordinate, depth, equation) == pytest.approx(
        np.sum((depth - z) ** 2), rel=1e-12
    )
