"""Spheres: exact ones, noisy ones held against their own sigma, and what is none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.geometry.forms import fit_sphere
from fringeworks.geometry.forms.curved import settled
from fringeworks.geometry.pose import rotation_matrix

Array = NDArray[np.float64]

CENTRE, RADIUS = np.array([20.0, -30.0, 650.0]), 19.05


def cap(count: int, half_angle_deg: float, *, seed: int = 0) -> Array:
    """Unit vectors ``(count, 3)`` evenly over a cap about -z, the side that a camera sees."""
    rng = np.random.default_rng(seed)
    cosine = rng.uniform(np.cos(np.radians(half_angle_deg)), 1, count)
    angle = rng.uniform(0, 2 * np.pi, count)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), -cosine], axis=1)


def noisy_cap(
    count: int, half_angle_deg: float, sd: Array | float, *, seed: int, radius: float = RADIUS
) -> Array:
    noise = np.random.default_rng(seed + 1).normal(0, 1, count) * sd
    return np.asarray(CENTRE + (radius + noise)[:, None] * cap(count, half_angle_deg, seed=seed))


class TestSphere:
    def test_numbers_by_hand(self) -> None:
        # Two points at +-11 on x, four at +-10 on y and z: by symmetry the centre is theirs, and
        # the radius the mean distance, 62 / 6. Deviations 2/3 twice, -1/3 four times: their
        # squares sum to 4/3, over 6 - 4 degrees of freedom.
        axes = np.concatenate([np.eye(3), -np.eye(3)]) * [11, 10, 10]
        fit = fit_sphere(axes + np.array([1.0, 2.0, 300.0]))
        # It ends where a step moves the residuals by less than 1e-6 mm in all.
        np.testing.assert_allclose(fit.centre_mm, [1, 2, 300], atol=1e-6)
        assert fit.radius_mm == pytest.approx(62 / 6, abs=1e-6)
        expected = [2 / 3, -1 / 3, -1 / 3, 2 / 3, -1 / 3, -1 / 3]
        np.testing.assert_allclose(fit.deviations_mm, expected, atol=2e-6)
        assert fit.form_rms_mm == pytest.approx((2 / 3) ** 0.5, abs=1e-6)
        assert fit.range_mm == pytest.approx(1, abs=4e-6)
        # Sorted: the 2.5 % quantile lies between equal values, the 97.5 % one between 2/3 twice.
        assert fit.band95_mm == pytest.approx(1, abs=4e-6)
        # Opposite points: centre and radius are independent, the radius a mean of six.
        assert fit.radius_sigma_mm == pytest.approx((2 / 3 / 6) ** 0.5, abs=1e-6)
        np.testing.assert_allclose(fit.covariance[3, :3], 0, atol=1e-6)

    @pytest.mark.parametrize("half_angle_deg", [3, 10, 30, 90, 180])
    @pytest.mark.parametrize("radius", [0.5, 19.05, 2000.0])
    def test_exact(self, half_angle_deg: float, radius: float) -> None:
        normals = cap(60, half_angle_deg)
        fit = fit_sphere(CENTRE + radius * normals)
        # The fit ends within 1e-6 mm of residual in all, and a radius is a constant beside the
        # centre's share, the cosine: 1e-6 over the cosine's spread. Rounding of 650 or 2000 mm,
        # 2e-13, is amplified likewise and stays below.
        tolerance = 1e-6 / (np.std(normals[:, 2]) * np.sqrt(60))
        assert fit.radius_mm == pytest.approx(radius, abs=tolerance)
        np.testing.assert_allclose(fit.centre_mm, CENTRE, atol=2 * tolerance)
        assert fit.range_mm < 1e-6

    def test_seen_from_inside(self) -> None:
        # The concave side: a bowl is a sphere as well.
        fit = fit_sphere(CENTRE - RADIUS * cap(100, 40))
        np.testing.assert_allclose(fit.centre_mm, CENTRE, atol=1e-5)
        assert fit.radius_mm == pytest.approx(RADIUS, abs=1e-5)

    def test_deviations_are_positive_outside(self) -> None:
        points = CENTRE + RADIUS * cap(1000, 180)
        points[7] += 0.1 * (points[7] - CENTRE) / RADIUS
        fit = fit_sphere(points)
        assert np.argmax(fit.deviations_mm) == 7
        assert fit.deviations_mm[7] == pytest.approx(0.1, abs=0.001)

    @pytest.mark.parametrize("half_angle_deg", [25, 70, 180])
    def test_the_same_minimum_as_scipy(self, half_angle_deg: float) -> None:
        sd = np.where(np.arange(500) % 2, 0.5, 0.1)
        points = noisy_cap(500, half_angle_deg, sd, seed=3)

        def residuals(parameters: Array) -> Array:
            away = np.linalg.norm(points - parameters[:3], axis=1)
            return np.asarray((away - parameters[3]) / sd)

        start = np.array([*(CENTRE + 1), RADIUS + 2])
        other = least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-12)
        fit = fit_sphere(points, sigma_mm=sd)
        # Both stop within some 1e-6 of a standard deviation; the cap of 25 degrees knows its
        # radius to 0.2 mm.
        np.testing.assert_allclose(fit.centre_mm, other.x[:3], atol=1e-5)
        assert fit.radius_mm == pytest.approx(other.x[3], abs=1e-5)

    @given(
        st.tuples(*[st.floats(-3, 3)] * 3).map(np.array),
        st.tuples(*[st.floats(-500, 500)] * 3).map(np.array),
    )
    @settings(deadline=None)
    def test_invariant_under_rigid_motion(self, vector: Array, move: Array) -> None:
        points = noisy_cap(100, 60, 0.1, seed=5)
        turn = rotation_matrix(vector)
        still, moved = fit_sphere(points), fit_sphere(points @ turn.T + move)
        # Radius known to 0.08 mm; both end within 1e-6 of that.
        assert moved.radius_mm == pytest.approx(still.radius_mm, abs=1e-6)
        assert moved.form_rms_mm == pytest.approx(still.form_rms_mm, abs=1e-8)
        np.testing.assert_allclose(moved.centre_mm, turn @ still.centre_mm + move, atol=2e-6)
        turned = turn @ still.covariance[:3, :3] @ turn.T
        np.testing.assert_allclose(moved.covariance[:3, :3], turned, atol=1e-6)

    @pytest.mark.slow
    @pytest.mark.parametrize("weighted", [False, True])
    def test_predicted_against_sampled_sigma(self, weighted: bool) -> None:
        runs, count = 600, 200
        sd = np.where(np.arange(count) % 2, 0.3, 0.03) if weighted else np.full(count, 0.1)
        radii, sigmas, scores, errors, variances = [], [], [], [], []
        truth = np.array([*CENTRE, RADIUS])
        for seed in range(runs):
            points = noisy_cap(count, 60, sd, seed=10 * seed)
            fit = fit_sphere(points, sigma_mm=sd if weighted else None)
            off = np.array([*fit.centre_mm, fit.radius_mm]) - truth
            errors.append(off)
            variances.append(np.diag(fit.covariance))
            radii.append(fit.radius_mm)
            sigmas.append(fit.radius_sigma_mm)
            scores.append(off @ np.linalg.solve(fit.covariance, off))
        ratio = np.std(errors, axis=0) / np.sqrt(np.mean(variances, axis=0))
        assert 0.85 < ratio.min() <= ratio.max() < 1.15
        predicted = np.sqrt(np.mean(np.square(sigmas)))
        assert np.std(radii) == pytest.approx(predicted, rel=5 / np.sqrt(2 * runs))
        assert abs(np.mean(radii) - RADIUS) < 5 * predicted / np.sqrt(runs)
        # Four parameters: four times F(4, 196), of mean 4 * 196 / 194 and variance 8 * 1.04.
        assert np.mean(scores) == pytest.approx(4.04, abs=5 * np.sqrt(8.4 / runs))


class TestNoSphere:
    @pytest.mark.parametrize("count", [0, 1, 4])
    def test_too_few_points(self, count: int) -> None:
        with pytest.raises(MeasurementError, match=f"sphere needs at least 5 points, got {count}"):
            fit_sphere(cap(count, 90))

    def test_void_points(self) -> None:
        points = CENTRE + cap(10, 90)
        points[3, 1], points[4] = np.nan, np.inf
        with pytest.raises(MeasurementError, match="2 of the 10 points are not finite"):
            fit_sphere(points)

    @pytest.mark.parametrize("directions", [0, 1, 2])
    def test_points_on_one_plane(self, directions: int) -> None:
        rng = np.random.default_rng(2)
        points = rng.uniform(-50, 50, (40, directions)) @ rng.normal(0, 1, (directions, 3)) + CENTRE
        with pytest.raises(MeasurementError, match="the 40 points lie on one plane: no sphere"):
            fit_sphere(points)

    def test_points_on_a_circle(self) -> None:
        angle = np.linspace(0, 6, 30)[:, None]
        circle = np.cos(angle) * [1.0, 2.0, 2.0] + np.sin(angle) * [2.0, 1.0, -2.0]
        with pytest.raises(MeasurementError, match="30 points lie on one plane"):
            fit_sphere(10 * circle + CENTRE)

    @pytest.mark.parametrize("seed", range(20))
    def test_a_noisy_plane(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        points = rng.uniform(-50, 50, (3000, 3)) * [1, 1, 0] + CENTRE
        points[:, 2] += rng.normal(0, 0.1, 3000)
        # Its curvature is within five standard deviations of none but once in two million.
        with pytest.raises(MeasurementError, match="do not tell a sphere from a plane"):
            fit_sphere(points)

    def test_two_sheets(self) -> None:
        # Mirrored in their middle, so that no curvature is better than another: none at all.
        x, y, z = np.meshgrid(np.arange(9.0), np.arange(9.0), [0.0, 1e-3])
        with pytest.raises(MeasurementError, match="plane"):
            fit_sphere(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1))

    def test_where_nothing_settles(self) -> None:
        with pytest.raises(MeasurementError, match="no sphere settles on the 7 points"):
            settled(None, np.zeros((7, 3)), form="sphere")

    def test_shapes_that_do_not_fit(self) -> None:
        with pytest.raises(ShapeError, match=r"points must be \(n, 3\), got \(5, 2\)"):
            fit_sphere(np.zeros((5, 2)))
        with pytest.raises(ShapeError, match=r"sigma_mm must be \(9,\) like the points"):
            fit_sphere(cap(9, 90), sigma_mm=np.ones(8))

    @pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, np.inf])
    def test_sigmas_that_are_none(self, wrong: float) -> None:
        sigma = np.ones(9)
        sigma[2] = wrong
        with pytest.raises(UsageError, match="got 1 of 9 that are not"):
            fit_sphere(cap(9, 90), sigma_mm=sigma)
