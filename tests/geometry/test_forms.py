"""Planes and normals: exact ones, noisy ones with the tolerances of their statistics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.geometry.forms import fit_plane
from fringeworks.geometry.grid import grid_normals
from fringeworks.geometry.pose import rotation_matrix

Array = NDArray[np.float64]

NORMAL = np.array([2.0, -1.0, -2.0]) / 3


def plane_points(count: int, *, size: float = 100.0, seed: int = 0) -> Array:
    """Points on ``NORMAL . X = -400``, in a square of half side `size` about its foot."""
    along = np.array([1.0, 2.0, 0.0]) / np.sqrt(5)
    across = np.cross(NORMAL, along)
    s, t = np.random.default_rng(seed).uniform(-size, size, (2, count, 1))
    return np.asarray(-400 * NORMAL + s * along + t * across)


class TestPlane:
    def test_by_hand(self) -> None:
        # z = 10, seen from the origin: the normal looks back, at -z.
        fit = fit_plane(np.array([[0.0, 0, 10], [1, 0, 10], [0, 1, 10], [5, 7, 10]]))
        np.testing.assert_allclose(fit.normal, [0, 0, -1], atol=1e-15)
        assert fit.offset_mm == pytest.approx(-10, abs=1e-14)
        assert fit.flatness_mm == pytest.approx(0, abs=1e-14)

    def test_numbers_by_hand(self) -> None:
        # A square of which two opposite corners are up by 1 and two down: the plane between.
        points = np.array([[0.0, 0, 11], [1, 0, 9], [1, 1, 11], [0, 1, 9]])
        fit = fit_plane(100 * points * [10, 10, 0.01])  # z stays, x and y grow to a metre
        # Deviations are +-1 along -z: sum of squares 4 over 4 - 3 degrees of freedom.
        assert fit.form_rms_mm == pytest.approx(2.0, abs=1e-9)
        assert fit.flatness_mm == pytest.approx(2.0, abs=1e-9)
        # Sorted -1 -1 1 1: the 2.5 % quantile is at place 0.075, between -1 and -1.
        assert fit.band95_mm == pytest.approx(2.0, abs=1e-9)
        np.testing.assert_allclose(fit.deviations_mm, [-1, 1, -1, 1], atol=1e-9)

    def test_exact(self) -> None:
        fit = fit_plane(plane_points(50))
        np.testing.assert_allclose(fit.normal, NORMAL, atol=1e-13)
        assert fit.offset_mm == pytest.approx(-400, abs=1e-11)
        assert fit.flatness_mm < 1e-11

    def test_noisy(self) -> None:
        # n points of sd 0.1 in a square of half side 100: offset within sd / sqrt n of the truth
        # (the foot of the plane is its centre), slopes within sd / sqrt(n 100^2 / 3), rms within
        # a share 1 / sqrt(2 n); five sigma of each.
        count, sd = 4000, 0.1
        points = plane_points(count)
        noise = np.random.default_rng(1).normal(0, sd, (count, 1))
        fit = fit_plane(points + noise * NORMAL)
        assert abs(fit.offset_mm + 400) < 5 * sd / np.sqrt(count)
        slope = sd / np.sqrt(count * 100**2 / 3)
        # Two slopes: their length has 2 degrees of freedom; 5.7 sigma is as rare as 5 of one.
        assert np.linalg.norm(np.cross(fit.normal, NORMAL)) < 5.7 * slope
        assert fit.form_rms_mm == pytest.approx(sd, rel=5 / np.sqrt(2 * count))
        # Quantiles of a normal: +-1.960 sd, each known to sqrt(p q / n) / density(1.96 = 0.0584).
        quantile_sd = sd * np.sqrt(0.025 * 0.975 / count) / 0.0584
        assert abs(fit.band95_mm - 2 * 1.96 * sd) < 5 * np.sqrt(2) * quantile_sd

    def test_errors_are_orthogonal(self) -> None:
        # A steep plane whose points are off along its normal: z alone would bias the slope.
        steep = np.array([0.995, 0.0, -0.0998749])
        basis = np.linalg.svd(steep[np.newaxis])[2][1:]
        rng = np.random.default_rng(3)
        points = rng.uniform(-10, 10, (20000, 2)) @ basis + rng.normal(0, 1.0, (20000, 1)) * steep
        fit = fit_plane(points - 50 * steep)
        # slopes within 1 / sqrt(n 10^2 / 3)
        assert np.linalg.norm(np.cross(fit.normal, steep)) < 5.7 / np.sqrt(20000 * 100 / 3)

    @given(
        st.tuples(*[st.floats(-3, 3)] * 3).map(np.array),
        st.tuples(*[st.floats(-500, 500)] * 3).map(np.array),
    )
    def test_invariant_under_rigid_motion(self, vector: Array, move: Array) -> None:
        noise = np.random.default_rng(5).normal(0, 0.1, (100, 1))
        points = plane_points(100) + noise * NORMAL
        still, moved = fit_plane(points), fit_plane(points @ rotation_matrix(vector).T + move)
        # A thousand mm at 1e-16; the smallest of three eigenvalues 1e6 apart.
        assert moved.form_rms_mm == pytest.approx(still.form_rms_mm, abs=1e-10)
        assert moved.flatness_mm == pytest.approx(still.flatness_mm, abs=1e-10)
        assert moved.offset_mm <= 0
        turned = rotation_matrix(vector) @ still.normal
        assert abs(moved.normal @ turned) == pytest.approx(1, abs=1e-12)

    @pytest.mark.parametrize("count", [0, 1, 2])
    def test_too_few_points(self, count: int) -> None:
        with pytest.raises(MeasurementError, match=f"at least 3 points, got {count}"):
            fit_plane(np.zeros((count, 3)))

    @pytest.mark.parametrize("direction", [(1, 0, 0), (1, 2, 3), (0, 0, 0)])
    def test_points_on_one_line(self, direction: tuple[float, float, float]) -> None:
        along = np.linspace(-100, 100, 20)[:, np.newaxis]
        points = np.array([7.0, -3.0, 900.0]) + along * np.array(direction)
        with pytest.raises(MeasurementError, match="20 points lie on one line"):
            fit_plane(points)

    def test_three_points_are_exact_and_of_unknown_sigma(self) -> None:
        fit = fit_plane(plane_points(3))
        assert fit.form_rms_mm < 1e-11
        assert np.isnan(fit.offset_sigma_mm)
        assert np.isnan(fit.tilt_sigma_deg)

    def test_covariance_by_hand(self) -> None:
        # The square of test_numbers_by_hand: variance 4 over one degree of freedom, four points
        # 500 mm from their middle line each way, seen from that middle: 4 / 4 and 4 / (4 * 500^2).
        points = np.array([[-500.0, -500, 11], [500, -500, 9], [500, 500, 11], [-500, 500, 9]])
        fit = fit_plane(points)
        assert fit.offset_sigma_mm == pytest.approx(1.0, abs=1e-9)
        assert fit.tilt_sigma_deg == pytest.approx(np.degrees(1 / 500), rel=1e-9)
        aside = fit_plane(points + np.array([3000.0, 0, 0]))  # a tilt of 1 / 500 at 3000 mm: 6 mm
        assert aside.offset_sigma_mm == pytest.approx(np.sqrt(1 + 6**2), rel=1e-5)

    @pytest.mark.parametrize("weighted", [False, True])
    def test_predicted_against_sampled_sigma(self, weighted: bool) -> None:
        runs, count = 600, 60
        sd = np.where(np.arange(count) % 2, 0.3, 0.03) if weighted else np.full(count, 0.1)
        scores, offsets, sigmas = [], [], []
        for seed in range(runs):
            noise = np.random.default_rng(10_000 + seed).normal(0, 1, count) * sd
            points = plane_points(count, seed=seed) + noise[:, None] * NORMAL + [30.0, 60, 0]
            fit = fit_plane(points, sigma_mm=sd if weighted else None)
            offset = -400 + float(NORMAL @ np.array([30.0, 60, 0]))
            off = np.array([*(fit.normal - NORMAL), fit.offset_mm - offset])
            free = [0, 1, 3]  # the normal is of length one
            scores.append(
                off[free] @ np.linalg.solve(fit.covariance[np.ix_(free, free)], off[free])
            )
            offsets.append(off[3])
            sigmas.append(fit.offset_sigma_mm)
        predicted = np.sqrt(np.mean(np.square(sigmas)))
        assert np.std(offsets) == pytest.approx(predicted, rel=5 / np.sqrt(2 * runs))
        # Three parameters: three times F(3, 57), of mean 3 * 57 / 55 and variance 6 * 1.13.
        assert np.mean(scores) == pytest.approx(3.11, abs=5 * np.sqrt(6.8 / runs))

    def test_weights(self) -> None:
        # Means by hand: z = 0 at weight 1 and z = 3 at weight 1/4 on every corner: 0.75 / 1.25.
        corners = np.array([[0.0, 0], [9, 0], [9, 9], [0, 9]])
        low, high = (np.column_stack([corners, np.full(4, z)]) for z in (10.0, 13.0))
        fit = fit_plane(np.concatenate([low, high]), sigma_mm=np.repeat([1.0, 2.0], 4))
        assert fit.offset_mm == pytest.approx(-10.6, abs=1e-12)
        with pytest.raises(ShapeError, match=r"sigma_mm must be \(8,\) like the points"):
            fit_plane(np.concatenate([low, high]), sigma_mm=np.ones(4))


def rays(height: int, width: int) -> Array:
    v, u = np.mgrid[:height, :width].astype(float)
    return np.stack([(u - width / 2) / 500, (v - height / 2) / 500, np.ones_like(u)], axis=-1)


def tilted_plane(height: int, width: int) -> NDArray[np.float32]:
    ray = rays(height, width)
    return (ray * (-400 / (ray @ NORMAL))[..., np.newaxis]).astype(np.float32)


class TestNormals:
    # Points 400 to 700 mm away in single precision: 3e-5 mm each; neighbours are 0.8 mm apart and
    # more, so a normal is off by 2 sqrt 2 * 3e-5 / 0.8 = 1e-4 at most.
    ROUNDING = 2e-4

    def test_tilted_plane(self) -> None:
        normals = grid_normals(tilted_plane(20, 30))
        assert normals.dtype == np.float32
        np.testing.assert_allclose(
            normals, np.broadcast_to(NORMAL, (20, 30, 3)), atol=self.ROUNDING
        )

    def test_plane_seen_from_behind(self) -> None:
        # The same points mirrored through the camera's centre line: the normal turns with them.
        normals = grid_normals(tilted_plane(20, 30) * np.array([-1, 1, 1], np.float32))
        expected = np.broadcast_to(NORMAL * [-1, 1, 1], (20, 30, 3))
        np.testing.assert_allclose(normals, expected, atol=self.ROUNDING)

    def test_sphere(self) -> None:
        centre, radius = np.array([0.0, 0.0, 600.0]), 200.0
        ray = rays(60, 60)
        along, square = ray @ centre, np.einsum("...i,...i->...", ray, ray)
        root = np.sqrt(along**2 - square * (centre @ centre - radius**2))
        xyz = ray * ((along - root) / square)[..., np.newaxis]
        normals = grid_normals(xyz.astype(np.float32))
        truth = (xyz - centre) / radius
        inside = (slice(1, -1), slice(1, -1))
        # Central differences of step h on a radius r are off by the third derivative, (h / r)^2 / 6
        # times a slope below 1; h = 1 mm: 4e-6. What is left is rounding.
        np.testing.assert_allclose(normals[inside], truth[inside], atol=self.ROUNDING)
        # At the rim one-sided: h / (2 r), 1 mm / 400 mm, and the same across.
        np.testing.assert_allclose(normals, truth, atol=5e-3)

    def test_holes(self) -> None:
        xyz = tilted_plane(9, 9)
        xyz[4, 4] = np.nan
        normals = grid_normals(xyz)
        assert np.isnan(normals[4, 4]).all()
        there = np.isfinite(normals).all(axis=-1)
        assert there.sum() == 80  # the hole's neighbours have a difference on their other side
        np.testing.assert_allclose(
            normals[there], np.broadcast_to(NORMAL, (80, 3)), atol=self.ROUNDING
        )

    def test_without_neighbours_along_one_direction(self) -> None:
        xyz = np.full((5, 5, 3), np.nan, np.float32)
        xyz[2] = tilted_plane(5, 5)[2]  # a single row
        assert np.isnan(grid_normals(xyz)).all()

    @pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (7, 1)])
    def test_images_one_pixel_wide(self, height: int, width: int) -> None:
        normals = grid_normals(np.ones((height, width, 3), np.float32))
        assert normals.shape == (height, width, 3)
        assert np.isnan(normals).all()

    def test_two_by_two(self) -> None:
        normals = grid_normals(tilted_plane(2, 2))
        np.testing.assert_allclose(normals, np.broadcast_to(NORMAL, (2, 2, 3)), atol=self.ROUNDING)
