"""Circles in a plane, and that few points never make a confident radius."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fringeworks.errors import MeasurementError, ShapeError
from fringeworks.geometry.forms import curved, fit_cylinder, fit_sphere
from fringeworks.geometry.forms.circle import fit_circle
from fringeworks.geometry.forms.curved import FALSE_ALARM, telling_sigmas

Array = NDArray[np.float64]

CENTRE, RADIUS = np.array([10.0, 700.0]), 52.5


def arc(count: int, arc_deg: float, sd: float = 0.0, *, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    angle = np.radians(rng.uniform(-arc_deg / 2, arc_deg / 2, count))
    away = RADIUS + rng.normal(0, 1, count) * sd
    return np.asarray(CENTRE + away[:, None] * np.stack([np.sin(angle), -np.cos(angle)], axis=1))


class TestCircle:
    def test_numbers_by_hand(self) -> None:
        # Eight points, 11 and 10 mm away in turn: radius 10.5, squares sum to 2 over 8 - 3.
        angle = np.arange(8) * np.pi / 4
        away = np.where(np.arange(8) % 2, 10, 11)
        fit = fit_circle(CENTRE + np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1))
        np.testing.assert_allclose(fit.centre_mm, CENTRE, atol=1e-6)
        assert fit.radius_mm == pytest.approx(10.5, abs=1e-6)
        assert fit.form_rms_mm == pytest.approx((2 / 5) ** 0.5, abs=1e-6)
        assert fit.radius_sigma_mm == pytest.approx((2 / 5 / 8) ** 0.5, abs=1e-6)

    @pytest.mark.parametrize("arc_deg", [30, 100, 360])
    def test_the_same_minimum_as_scipy(self, arc_deg: float) -> None:
        points = arc(300, arc_deg, 0.1, seed=3)

        def residuals(parameters: Array) -> Array:
            away = points - parameters[:2]
            return np.asarray(np.hypot(away[:, 0], away[:, 1]) - parameters[2])

        start = np.array([*(CENTRE + 1), RADIUS - 2])
        other = least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-12)
        fit = fit_circle(points)
        # Both stop within some 1e-6 of a standard deviation, here up to 0.5 mm.
        np.testing.assert_allclose([*fit.centre_mm, fit.radius_mm], other.x, atol=1e-5)

    def test_predicted_against_sampled_sigma(self) -> None:
        runs = 300
        fits = [fit_circle(arc(60, 110, 0.1, seed=seed)) for seed in range(runs)]
        predicted = np.sqrt(np.mean([fit.radius_sigma_mm**2 for fit in fits]))
        radii = [fit.radius_mm for fit in fits]
        assert np.std(radii) == pytest.approx(predicted, rel=5 / np.sqrt(2 * runs))
        assert abs(np.mean(radii) - RADIUS) < 5 * predicted / np.sqrt(runs)

    @pytest.mark.parametrize(
        ("points", "message"),
        [
            (np.zeros((3, 2)), "at least 4 points, got 3"),
            (np.full((9, 2), np.nan), "9 of the 9 points are not finite"),
            (np.ones((9, 2)), "are one point"),
            (np.stack([np.arange(9.0)] * 2, axis=1), "do not tell a circle from a line"),
        ],
    )
    def test_what_is_none(self, points: Array, message: str) -> None:
        with pytest.raises(MeasurementError, match=message):
            fit_circle(points)

    def test_shape(self) -> None:
        with pytest.raises(ShapeError, match=r"points must be \(n, 2\), got \(9, 3\)"):
            fit_circle(np.zeros((9, 3)))


def taken_for_spheres(count: int, *, runs: int) -> int:
    """How many of the noisy planes of so few points pass for a sphere."""
    taken = 0
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        points = rng.uniform(-50, 50, (count, 3)) * [1, 1, 0]
        points[:, 2] += rng.normal(0, 0.1, count)
        try:
            fit_sphere(points + np.array([0, 0, 700]))
            taken += 1
        except MeasurementError:
            pass
    return taken


class TestFewPoints:
    def test_students_quantiles(self) -> None:
        # 99.9 % of t: with one degree of freedom 1 / tan(pi / 1000), with very many 3.09, so five.
        assert telling_sigmas(1) == pytest.approx(1 / np.tan(np.pi / 1000))
        assert telling_sigmas(1000) == 5

    def test_what_five_sigmas_alone_would_take(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(curved, "telling_sigmas", lambda freedom: 5.0)
        # One residual too many: beyond five sigmas either way in one of eight if all were linear.
        assert taken_for_spheres(5, runs=300) > 20  # 30, but for rounding

    @pytest.mark.parametrize("count", [5, 6, 8])
    def test_a_noisy_plane_is_no_sphere(self, count: int) -> None:
        runs = 300
        # Either sign of curvature: a Poisson number of 0.6, more than four once in 2500.
        assert 2 * runs * FALSE_ALARM == pytest.approx(0.6)
        assert taken_for_spheres(count, runs=runs) <= 4

    @pytest.mark.parametrize("fit", [fit_sphere, fit_cylinder])
    def test_equal_and_collinear_points(self, fit) -> None:  # type: ignore[no-untyped-def]
        for points in (np.ones((50, 3)), np.linspace(0, 9, 50)[:, None] * [1.0, 2, 3]):
            with pytest.raises(MeasurementError, match="lie on one plane"):
                fit(points)
