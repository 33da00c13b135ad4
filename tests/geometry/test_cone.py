"""Cones: exact ones, noisy ones held against their own sigma, and what is none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.geometry.forms import fit_cone
from fringeworks.geometry.forms.cone import cone_jacobian
from fringeworks.geometry.forms.curved import Curved
from fringeworks.geometry.pose import rotation_matrix

Array = NDArray[np.float64]

APEX, HALF_DEG = np.array([62.0, -58.0, 665.0]), 19.0
"""The axis is y of the frame; the camera sees the side towards -z."""

Y = np.array([0.0, 1.0, 0.0])


def side(
    count: int,
    arc_deg: float,
    ways: tuple[float, float] = (5.0, 110.0),
    *,
    half_deg: float = HALF_DEG,
    sd: Array | float = 0.0,
    seed: int = 0,
) -> Array:
    """Points evenly on the visible side, so far from the apex, off by noise along their normals."""
    rng = np.random.default_rng(seed)
    way = np.sqrt(rng.uniform(ways[0] ** 2, ways[1] ** 2, count))
    angle, half = np.radians(rng.uniform(-arc_deg / 2, arc_deg / 2, count)), np.radians(half_deg)
    off = sd * rng.normal(0, 1, count)
    across = way * np.sin(half) + off * np.cos(half)
    along = way * np.cos(half) - off * np.sin(half)
    return np.asarray(APEX + np.stack([across * np.sin(angle), along, -across * np.cos(angle)], 1))


class TestCone:
    def test_numbers_by_hand(self) -> None:
        # Rings of 8 points about z with radii 10, 20, 30 mm, 10, 20 and 30 mm from the apex: half
        # of a right angle. Off by +-1 mm along the normals, in turn: by symmetry the cone stays.
        angle = np.arange(8) * np.pi / 4
        off = np.where(np.arange(8) % 2, 1, -1) / np.sqrt(2)
        rings = [
            np.stack([(r + off) * np.cos(angle), (r + off) * np.sin(angle), r - off], axis=1)
            for r in (10, 20, 30)
        ]
        fit = fit_cone(np.concatenate(rings) + np.array([1, 2, 300]))
        # It ends where a step moves the residuals by less than 1e-6 mm in all.
        np.testing.assert_allclose(fit.apex_mm, [1, 2, 300], atol=3e-6)
        np.testing.assert_allclose(fit.axis_direction, [0, 0, 1], atol=1e-6)
        assert fit.half_angle_deg == pytest.approx(45, abs=1e-5)
        np.testing.assert_allclose(fit.deviations_mm, 12 * [-1, 1], atol=5e-6)
        assert fit.form_rms_mm == pytest.approx((24 / 18) ** 0.5, abs=1e-6)
        assert fit.range_mm == pytest.approx(2, abs=1e-5)
        assert fit.band95_mm == pytest.approx(2, abs=1e-5)

    @pytest.mark.parametrize("arc_deg", [40, 140, 360])
    @pytest.mark.parametrize("half_deg", [3, 19, 45, 75])
    @pytest.mark.parametrize("ways", [(0.0, 110.0), (60.0, 110.0)])
    def test_exact(self, arc_deg: float, half_deg: float, ways: tuple[float, float]) -> None:
        turn = rotation_matrix(np.array([0.7, -0.4, 1.1]))
        fit = fit_cone(side(300, arc_deg, ways, half_deg=half_deg) @ turn.T)
        # 1e-6 mm of residual in all; the narrow arcs amplify it as they do noise: sigma of the
        # half angle is at most 20 degrees per mm of noise (arc 40, the frustum), and the apex is
        # 60 mm away.
        assert fit.half_angle_deg == pytest.approx(half_deg, abs=1e-4)
        np.testing.assert_allclose(fit.axis_direction, turn @ Y, atol=1e-5)
        np.testing.assert_allclose(fit.apex_mm, turn @ APEX, atol=5e-3)
        assert fit.range_mm < 1e-6

    def test_the_derivatives(self) -> None:
        rng = np.random.default_rng(0)
        base = Curved(
            np.array([1.0, 2, 300]), rotation_matrix(np.array([0.3, -0.5, 0.2])), 1 / 30, True
        )
        points, at = rng.normal(0, 10, (50, 3)), np.array([0.5, 0.04, 0.1, -0.05, 0.08, 0.3])
        _, jacobian = cone_jacobian(base, points, at)
        for column, step in enumerate(np.diag([1e-5, 1e-7, 1e-6, 1e-6, 1e-6, 1e-6])):
            ahead, behind = (cone_jacobian(base, points, at + s * step)[0] for s in (1, -1))
            numeric = (ahead - behind) / (2 * step.sum())
            # Central differences: rounding 1e-15 * 20 mm over the step, and its square.
            np.testing.assert_allclose(jacobian[:, column], numeric, rtol=1e-6, atol=1e-6)

    def test_seen_from_inside(self) -> None:
        fit = fit_cone(2 * APEX - side(300, 120))
        np.testing.assert_allclose(fit.apex_mm, APEX, atol=1e-4)
        np.testing.assert_allclose(fit.axis_direction, -Y, atol=1e-5)

    def test_deviations_are_positive_outside(self) -> None:
        points = side(1000, 360)
        half = np.radians(HALF_DEG)
        outwards = (points[7] - APEX) * [1, 0, 1]
        outwards /= np.linalg.norm(outwards)
        points[7] += 0.1 * (outwards * np.cos(half) - Y * np.sin(half))
        fit = fit_cone(points)
        assert np.argmax(fit.deviations_mm) == 7
        assert fit.deviations_mm[7] == pytest.approx(0.1, abs=0.002)

    @pytest.mark.parametrize("arc_deg", [60, 140, 360])
    def test_the_same_minimum_as_scipy(self, arc_deg: float) -> None:
        sd = np.where(np.arange(600) % 2, 0.5, 0.1)
        points = side(600, arc_deg, sd=sd, seed=3)

        def residuals(parameters: Array) -> Array:
            *apex, dx, dz, half = parameters
            direction = np.array([dx, 1.0, dz]) / np.sqrt(1 + dx**2 + dz**2)
            away = points - np.array(apex)
            across = np.linalg.norm(np.cross(away, direction), axis=1)
            return np.asarray((across * np.cos(half) - away @ direction * np.sin(half)) / sd)

        start = np.array([*(APEX + 1), 0.01, 0.02, np.radians(HALF_DEG + 1)])
        other = least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-12, x_scale="jac")
        fit = fit_cone(points, sigma_mm=sd)
        # Both stop within some 1e-6 of a standard deviation; the narrow arc knows its apex to 2 mm.
        np.testing.assert_allclose(fit.apex_mm, other.x[:3], atol=1e-4)
        tilt = fit.axis_direction / fit.axis_direction[1]
        np.testing.assert_allclose(tilt[[0, 2]], other.x[3:5], atol=1e-5)
        assert fit.half_angle_deg == pytest.approx(np.degrees(other.x[5]), abs=1e-4)

    @given(
        st.tuples(*[st.floats(-3, 3)] * 3).map(np.array),
        st.tuples(*[st.floats(-500, 500)] * 3).map(np.array),
    )
    @settings(deadline=None, max_examples=10)
    def test_invariant_under_rigid_motion(self, vector: Array, move: Array) -> None:
        points = side(200, 140, sd=0.1)
        turn = rotation_matrix(vector)
        still, moved = fit_cone(points), fit_cone(points @ turn.T + move)
        # Half angle known to 0.1 degrees; both end within 1e-6 of that.
        assert moved.half_angle_deg == pytest.approx(still.half_angle_deg, abs=1e-5)
        assert moved.form_rms_mm == pytest.approx(still.form_rms_mm, abs=1e-8)
        np.testing.assert_allclose(moved.apex_mm, turn @ still.apex_mm + move, atol=2e-5)
        np.testing.assert_allclose(moved.axis_direction, turn @ still.axis_direction, atol=1e-6)
        assert moved.half_angle_sigma_deg == pytest.approx(still.half_angle_sigma_deg, rel=1e-4)

    @pytest.mark.slow
    @pytest.mark.parametrize("weighted", [False, True])
    def test_predicted_against_sampled_sigma(self, weighted: bool) -> None:
        runs, count = 200, 200
        sd = np.where(np.arange(count) % 2, 0.3, 0.03) if weighted else np.full(count, 0.1)
        errors, sigmas, scores = [], [], []
        for seed in range(runs):
            points = side(count, 140, sd=sd, seed=seed)
            fit = fit_cone(points, sigma_mm=sd if weighted else None)
            angle = np.radians(fit.half_angle_deg - HALF_DEG)
            off = np.array([*(fit.apex_mm - APEX), *(fit.axis_direction - Y), angle])
            free = [0, 1, 2, 3, 5, 6]  # along the axis its direction does not vary
            errors.append(off)
            sigmas.append(np.sqrt(np.diag(fit.covariance)))
            scores.append(
                off[free] @ np.linalg.solve(fit.covariance[np.ix_(free, free)], off[free])
            )
        predicted = np.sqrt(np.mean(np.square(sigmas), axis=0))[free]
        ratio = np.std(errors, axis=0)[free] / predicted
        assert ratio.min() > 0.85
        assert ratio.max() < 1.15
        assert np.all(np.abs(np.mean(errors, axis=0)[free]) < 5 * predicted / np.sqrt(runs))
        # Six parameters: six times F(6, 194), of mean 6 * 194 / 192 and variance 12 * 1.05.
        assert np.mean(scores) == pytest.approx(6.06, abs=5 * np.sqrt(12.6 / runs))


class TestNoCone:
    @pytest.mark.parametrize("count", [0, 3, 6])
    def test_too_few_points(self, count: int) -> None:
        with pytest.raises(MeasurementError, match=f"at least 7 points, got {count}"):
            fit_cone(side(count, 90))

    def test_void_points(self) -> None:
        points = side(10, 90)
        points[3, 1] = np.nan
        with pytest.raises(MeasurementError, match="1 of the 10 points are not finite"):
            fit_cone(points)

    @pytest.mark.parametrize("directions", [0, 1, 2])
    def test_points_on_one_plane(self, directions: int) -> None:
        rng = np.random.default_rng(2)
        points = rng.uniform(-50, 50, (40, directions)) @ rng.normal(0, 1, (directions, 3)) + APEX
        with pytest.raises(MeasurementError, match="the 40 points lie on one plane: no cone"):
            fit_cone(points)

    @pytest.mark.parametrize("seed", range(5))
    def test_a_noisy_plane(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        points = rng.uniform(-50, 50, (3000, 3)) * [1, 1, 0] + APEX
        points[:, 2] += rng.normal(0, 0.1, 3000)
        with pytest.raises(MeasurementError, match="cone"):
            fit_cone(points)

    @pytest.mark.parametrize("seed", range(5))
    def test_a_noisy_cylinder(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        angle, height = rng.uniform(-1, 1, 2000), rng.uniform(-75, 75, 2000)
        away = 52.5 + rng.normal(0, 0.1, 2000)
        points = np.stack([away * np.sin(angle), height, -away * np.cos(angle)], axis=1)
        # Five standard deviations: once in two million.
        with pytest.raises(MeasurementError, match="do not tell a cone from a cylinder"):
            fit_cone(points + APEX)

    def test_an_exact_cylinder(self) -> None:
        angle, height = np.meshgrid(np.linspace(-1, 1, 20), np.linspace(-50, 50, 20))
        ring = np.stack([50 * np.sin(angle), height, -50 * np.cos(angle)], axis=-1)
        with pytest.raises(MeasurementError, match="cone"):
            fit_cone(ring.reshape(-1, 3) + APEX)

    def test_shapes_that_do_not_fit(self) -> None:
        with pytest.raises(ShapeError, match=r"points must be \(n, 3\), got \(9, 2\)"):
            fit_cone(np.zeros((9, 2)))
        with pytest.raises(ShapeError, match=r"sigma_mm must be \(9,\) like the points"):
            fit_cone(side(9, 90), sigma_mm=np.ones(8))
        with pytest.raises(UsageError, match="sigma_mm must be positive"):
            fit_cone(side(9, 90), sigma_mm=np.zeros(9))
