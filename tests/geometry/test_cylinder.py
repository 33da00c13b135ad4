"""Cylinders: exact ones, noisy ones held against their own sigma, and what is none."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.geometry.forms import fit_cylinder
from fringeworks.geometry.forms.search import SAMPLE, spread_indices
from fringeworks.geometry.pose import rotation_matrix

Array = NDArray[np.float64]

MIDDLE, RADIUS = np.array([10.0, -5.0, 700.0]), 52.5
"""A point of the axis that is y of the frame; the camera sees the side towards -z."""

Y = np.array([0.0, 1.0, 0.0])


def side(
    count: int,
    arc_deg: float,
    length: float = 150.0,
    *,
    radius: float = RADIUS,
    sd: Array | float = 0.0,
    seed: int = 0,
) -> Array:
    """Points on the visible side, off by normal noise of `sd` along their normals."""
    rng = np.random.default_rng(seed)
    angle = np.radians(rng.uniform(-arc_deg / 2, arc_deg / 2, count))
    along = rng.uniform(-length / 2, length / 2, count)
    away = radius + sd * rng.normal(0, 1, count)
    return np.asarray(
        MIDDLE + np.stack([away * np.sin(angle), along, -away * np.cos(angle)], axis=1)
    )


def from_axis(points: Array, direction: Array) -> Array:
    """Distances of points from the line through `MIDDLE`."""
    return np.asarray(np.linalg.norm(np.cross(points - MIDDLE, direction), axis=-1))


class TestCylinder:
    def test_numbers_by_hand(self) -> None:
        # Rings of eight points, 11 and 10 mm from the axis in turn, at three heights: by symmetry
        # the axis is z and the radius 10.5. 24 deviations of 1/2: squares sum to 6 over 24 - 5.
        angle = np.arange(8) * np.pi / 4
        away = np.where(np.arange(8) % 2, 10, 11)
        ring = np.stack([away * np.cos(angle), away * np.sin(angle), 0 * angle], axis=1)
        middle = np.array([1.0, 2.0, 300.0])
        fit = fit_cylinder(np.concatenate([ring + middle + [0, 0, z] for z in (-20, 0, 20)]))
        # It ends where a step moves the residuals by less than 1e-6 mm in all.
        np.testing.assert_allclose(fit.axis_direction, [0, 0, 1], atol=1e-7)
        np.testing.assert_allclose(fit.axis_point_mm, middle, atol=1e-6)
        assert fit.radius_mm == pytest.approx(10.5, abs=1e-6)
        np.testing.assert_allclose(fit.deviations_mm, 12 * [0.5, -0.5], atol=2e-6)
        assert fit.form_rms_mm == pytest.approx((6 / 19) ** 0.5, abs=1e-6)
        assert fit.range_mm == pytest.approx(1, abs=4e-6)
        assert fit.band95_mm == pytest.approx(1, abs=4e-6)
        # The normal matrix: 24 for the radius, 12 for a shift, 8 * 20^2 for a tilt.
        variances = [1 / 12, 1 / 12, 0, 1 / 3200, 1 / 3200, 0, 1 / 24]
        np.testing.assert_allclose(fit.covariance, 6 / 19 * np.diag(variances), atol=1e-6)

    @pytest.mark.parametrize("arc_deg", [20, 60, 140, 360])
    @pytest.mark.parametrize(
        ("radius", "length"), [(52.5, 150.0), (52.5, 5.0), (3.0, 600.0), (400.0, 100.0)]
    )
    def test_exact(self, arc_deg: float, radius: float, length: float) -> None:
        turn = rotation_matrix(np.array([0.7, -0.4, 1.1]))
        fit = fit_cylinder(side(300, arc_deg, length, radius=radius) @ turn.T)
        # The fit ends within 1e-6 mm of residual in all; over an arc of 20 degrees the cosine that
        # tells radius from centre spreads by 0.0045, and there are 300 points: 1e-5 mm. A tilt
        # moves points by up to half the length.
        assert fit.radius_mm == pytest.approx(radius, abs=2e-5)
        direction = fit.axis_direction
        assert np.linalg.norm(np.cross(direction, turn @ Y)) < 1e-4 / length
        assert from_axis(turn.T @ fit.axis_point_mm, Y) < 2e-5
        assert fit.range_mm < 1e-6

    def test_what_is_seen_of_the_papers_cylinder(self) -> None:
        # 100 degrees of it with 1e5 points of sd 0.05 mm.
        points = side(100_000, 100, sd=0.05)
        fit = fit_cylinder(points)
        assert fit.radius_sigma_mm < 0.003
        assert abs(fit.radius_mm - RADIUS) < 5 * fit.radius_sigma_mm
        assert fit.form_rms_mm == pytest.approx(0.05, rel=5 / np.sqrt(2 * 100_000))
        # A tilt of both kinds moves the ends by sd / sqrt(n / 12) some ten times over (the arc
        # tells a tilt in depth from a growing radius only by its curve): 1e-3 mm over 75 mm.
        assert np.linalg.norm(np.cross(fit.axis_direction, Y)) < 1e-4

    def test_the_axis_is_said_in_one_way(self) -> None:
        # Down the image, whichever way the points run; nearest to the centroid.
        points = side(500, 120, sd=0.1)
        fit, back = fit_cylinder(points), fit_cylinder(points[::-1])
        assert fit.axis_direction[1] > 0.99
        np.testing.assert_allclose(fit.axis_direction, back.axis_direction, atol=1e-7)
        to_centroid = points.mean(axis=0) - fit.axis_point_mm
        assert abs(to_centroid @ fit.axis_direction) < 1e-10

    def test_seen_from_inside(self) -> None:
        fit = fit_cylinder(2 * MIDDLE - side(300, 100))
        assert fit.radius_mm == pytest.approx(RADIUS, abs=1e-5)
        assert from_axis(fit.axis_point_mm, Y) < 1e-5

    def test_deviations_are_positive_outside(self) -> None:
        points = side(1000, 360)
        points[7] += 0.1 * (points[7] - MIDDLE) * [1, 0, 1] / RADIUS
        fit = fit_cylinder(points)
        assert np.argmax(fit.deviations_mm) == 7
        assert fit.deviations_mm[7] == pytest.approx(0.1, abs=0.002)

    @pytest.mark.parametrize("arc_deg", [40, 120, 360])
    def test_the_same_minimum_as_scipy(self, arc_deg: float) -> None:
        sd = np.where(np.arange(600) % 2, 0.5, 0.1)
        points = side(600, arc_deg, sd=sd, seed=3)

        def residuals(parameters: Array) -> Array:
            x, z, dx, dz, radius = parameters
            direction = np.array([dx, 1.0, dz]) / np.sqrt(1 + dx**2 + dz**2)
            across = np.cross(points - [x, MIDDLE[1], z], direction)
            return np.asarray((np.linalg.norm(across, axis=1) - radius) / sd)

        start = np.array([MIDDLE[0] + 1, MIDDLE[2] - 2, 0.01, 0.02, RADIUS - 1])
        other = least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-12, x_scale="jac")
        fit = fit_cylinder(points, sigma_mm=sd)
        # Finite differences leave scipy some 1e-6 of a standard deviation, here up to 0.5 mm.
        assert fit.radius_mm == pytest.approx(other.x[4], abs=1e-5)
        tilt = fit.axis_direction / fit.axis_direction[1]
        np.testing.assert_allclose(tilt[[0, 2]], other.x[2:4], atol=1e-6)
        at_middle = fit.axis_point_mm + tilt * (MIDDLE[1] - fit.axis_point_mm[1])
        np.testing.assert_allclose(at_middle[[0, 2]], other.x[:2], atol=2e-5)

    @given(
        st.tuples(*[st.floats(-3, 3)] * 3).map(np.array),
        st.tuples(*[st.floats(-500, 500)] * 3).map(np.array),
    )
    @settings(deadline=None, max_examples=20)
    def test_invariant_under_rigid_motion(self, vector: Array, move: Array) -> None:
        points = side(200, 120, sd=0.1)
        turn = rotation_matrix(vector)
        still, moved = fit_cylinder(points), fit_cylinder(points @ turn.T + move)
        # Radius known to 0.05 mm; both end within 1e-6 of that.
        assert moved.radius_mm == pytest.approx(still.radius_mm, abs=1e-6)
        assert moved.form_rms_mm == pytest.approx(still.form_rms_mm, abs=1e-8)
        point = turn @ still.axis_point_mm + move
        np.testing.assert_allclose(moved.axis_point_mm, point, atol=2e-6)
        turned = turn @ still.axis_direction
        assert abs(turned @ moved.axis_direction) == pytest.approx(1, abs=1e-12)
        assert np.max(moved.axis_direction) == np.max(np.abs(moved.axis_direction))

    @pytest.mark.slow
    @pytest.mark.parametrize("weighted", [False, True])
    def test_predicted_against_sampled_sigma(self, weighted: bool) -> None:
        runs, count = 300, 200
        sd = np.where(np.arange(count) % 2, 0.3, 0.03) if weighted else np.full(count, 0.1)
        radii, sigmas, scores, errors, variances = [], [], [], [], []
        for seed in range(runs):
            points = side(count, 110, sd=sd, seed=seed)
            fit = fit_cylinder(points, sigma_mm=sd if weighted else None)
            radii.append(fit.radius_mm)
            sigmas.append(fit.radius_sigma_mm)
            # x and z of point and direction: along y the axis' point is where the centroid is.
            free = [0, 2, 3, 5, 6]
            away = fit.axis_point_mm - MIDDLE
            off = np.array([*away, *fit.axis_direction, fit.radius_mm - RADIUS])[free]
            errors.append(off)
            variances.append(np.diag(fit.covariance)[free])
            scores.append(off @ np.linalg.solve(fit.covariance[np.ix_(free, free)], off))
        ratio = np.std(errors, axis=0) / np.sqrt(np.mean(variances, axis=0))
        assert 0.85 < ratio.min() <= ratio.max() < 1.15
        predicted = np.sqrt(np.mean(np.square(sigmas)))
        assert np.std(radii) == pytest.approx(predicted, rel=5 / np.sqrt(2 * runs))
        assert abs(np.mean(radii) - RADIUS) < 5 * predicted / np.sqrt(runs)
        # Five parameters: five times F(5, 195), of mean 5 * 195 / 193 and variance 10 * 1.05.
        assert np.mean(scores) == pytest.approx(5.05, abs=5 * np.sqrt(10.5 / runs))

    @pytest.mark.parametrize("period", [100, 200, 400, 752])
    def test_a_sample_does_not_beat_with_the_grid(self, period: int) -> None:
        # A comb of one index per row of the grid would see one column: a line.
        chosen = spread_indices(SAMPLE * period, SAMPLE)
        assert len(np.unique(chosen)) == SAMPLE
        columns = np.bincount(chosen % period * 10 // period, minlength=10)
        rows = np.bincount(chosen // period * 10 // SAMPLE, minlength=10)
        # A tenth of the sample in each tenth of the grid, as evenly as chance alone would: five
        # standard deviations of a binomial.
        assert np.abs(np.concatenate([columns, rows]) - 100).max() < 5 * np.sqrt(100 * 0.9)


class TestNoCylinder:
    @pytest.mark.parametrize("count", [0, 5])
    def test_too_few_points(self, count: int) -> None:
        with pytest.raises(MeasurementError, match=f"at least 6 points, got {count}"):
            fit_cylinder(side(count, 90))

    def test_void_points(self) -> None:
        points = side(10, 90)
        points[3, 1] = np.nan
        with pytest.raises(MeasurementError, match="1 of the 10 points are not finite"):
            fit_cylinder(points)

    @pytest.mark.parametrize("length", [0.0, 100.0])
    def test_points_on_one_plane(self, length: float) -> None:
        flat = side(40, 90, length) * [1, 1, 0] if length else side(40, 90, length)
        with pytest.raises(MeasurementError, match="the 40 points lie on one plane: no cylinder"):
            fit_cylinder(flat)

    @pytest.mark.parametrize("seed", range(10))
    def test_a_noisy_plane(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        points = rng.uniform(-50, 50, (3000, 3)) * [1, 1, 0] + MIDDLE
        points[:, 2] += rng.normal(0, 0.1, 3000)
        # The best of all directions: chi^2 of three degrees, above 25 once in sixty thousand.
        with pytest.raises(MeasurementError, match="do not tell a cylinder from a plane"):
            fit_cylinder(points)

    def test_a_sphere_is_told_soon(self) -> None:
        """On a sample: the fit to all of its points would wander for minutes."""
        rng = np.random.default_rng(1)
        points = rng.normal(0, 1, (1_000_000, 3))
        points *= 50 / np.linalg.norm(points, axis=1, keepdims=True)
        before = time.process_time()
        with pytest.raises(MeasurementError, match="no cylinder settles"):
            fit_cylinder(points + MIDDLE)
        assert time.process_time() - before < 30  # 1 s, but for a machine that is busy

    def test_two_crossed_lines(self) -> None:
        # Skew ones: many cylinders touch both.
        along = np.linspace(-50, 50, 20)[:, None]
        lines = np.concatenate([along * [1.0, 0, 0], along * [0, 1.0, 0] + [0, 0, 30.0]])
        with pytest.raises(MeasurementError):
            fit_cylinder(lines + MIDDLE)

    def test_shapes_that_do_not_fit(self) -> None:
        with pytest.raises(ShapeError, match=r"points must be \(n, 3\), got \(4, 5, 3\)"):
            fit_cylinder(np.zeros((4, 5, 3)))
        with pytest.raises(ShapeError, match=r"sigma_mm must be \(9,\) like the points"):
            fit_cylinder(side(9, 90), sigma_mm=np.ones((9, 1)))
        with pytest.raises(UsageError, match="sigma_mm must be positive"):
            fit_cylinder(side(9, 90), sigma_mm=np.zeros(9))
