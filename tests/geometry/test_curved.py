"""Derivatives of what spheres and cylinders share, and its start, each against its own numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from fringeworks.geometry.forms import cylinder, sphere
from fringeworks.geometry.forms.curved import Curved, distance_jacobian, fit_algebraic, moved
from fringeworks.geometry.pose import rotation_matrix

Array = NDArray[np.float64]

FRAME = rotation_matrix(np.array([0.4, -0.9, 0.3]))
FOOT = np.array([30.0, -20.0, 650.0])
POINTS = FOOT + np.random.default_rng(3).uniform(-30, 30, (50, 3))
STEPS = np.array([1e-3, 1e-7, 1e-5, 1e-5, 1e-5])
"""Of rise, mm, curvature, 1 / mm, and turns: central differences err by their squares."""


def differences(function: Callable[[Array], Array], at: Array) -> Array:
    """Derivative ``(n, 5)`` of a function ``(n,)`` of parameters ``(5,)``."""
    columns = [
        (function(at + step) - function(at - step)) / (2 * step.sum()) for step in np.diag(STEPS)
    ]
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("curvature", [0.02, 1e-4, 0.0, -0.01])
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.3, -0.5, 0.2)])
def test_derivatives_of_distances(
    straight: bool, curvature: float, turn: tuple[float, float, float]
) -> None:
    start = Curved(FOOT, FRAME, 0.01, straight)
    at = np.array([2.0, curvature, *turn])

    def distances(parameters: Array) -> Array:
        return distance_jacobian(start, POINTS - FOOT, parameters)[0]

    # Second derivatives grow with the square of 30 mm, third ones with its cube: 1e-10 of 1e5,
    # and rounding of 1e-14 over steps of 1e-5 or 1e-7, times 50 mm.
    jacobian = distance_jacobian(start, POINTS - FOOT, at)[1]
    expected = differences(distances, at)
    free = [0, 1, 2, 3, 4] if straight else [0, 1, 3, 4]
    np.testing.assert_allclose(
        jacobian[:, free] * STEPS[free], expected[:, free] * STEPS[free], rtol=1e-4, atol=1e-10
    )


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("curvature", [0.02, 1e-4])
def test_distances_are_those_from_the_centre(straight: bool, curvature: float) -> None:
    surface = moved(Curved(FOOT, FRAME, 0.01, straight), np.array([2, curvature, 0.3, -0.5, 0.2]))
    away = POINTS - surface.centre
    if straight:
        away = np.cross(away, surface.frame[:, 1])
    expected = np.linalg.norm(away, axis=1) - 1 / curvature
    # A radius of 1e4 mm in double precision: 2e-12, of a difference of two.
    np.testing.assert_allclose(surface.distances(POINTS), expected, atol=2e-11)


@pytest.mark.parametrize("straight", [False, True])
def test_a_negative_curvature_is_turned(straight: bool) -> None:
    parameters = np.array([2, -0.02, 0.3, -0.5, 0.2])
    start = Curved(FOOT, FRAME, 0.01, straight)
    surface = moved(start, parameters)
    inward = distance_jacobian(start, POINTS - FOOT, parameters)[0]
    assert surface.curvature == 0.02
    assert np.linalg.det(surface.frame) == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(surface.distances(POINTS), -inward, atol=1e-11)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_derivatives_of_a_cylinders_numbers(side: float) -> None:
    # The frame's axis and its opposite: one of them runs against the direction that is told.
    found = Curved(FOOT, FRAME * [side, side, 1], 0.02, straight=True)
    middle = FOOT + np.array([3.0, 7.0, -11.0])

    def numbers(parameters: Array) -> Array:
        now = moved(found, parameters)
        return np.array([*np.concatenate(cylinder.axis_of(now, middle)), 1 / now.curvature])

    expected = differences(numbers, np.array([0, 0.02, 0, 0, 0]))
    np.testing.assert_allclose(cylinder.change_of(found, middle), expected, rtol=1e-6, atol=1e-5)


def test_derivatives_of_a_spheres_numbers() -> None:
    found = Curved(FOOT, FRAME, 0.02, straight=False)

    def numbers(parameters: Array) -> Array:
        now = moved(found, parameters)
        return np.array([*now.centre, 1 / now.curvature])

    expected = differences(numbers, np.array([0, 0.02, 0, 0, 0]))[:, [0, 1, 3, 4]]
    np.testing.assert_allclose(sphere.change_of(found), expected, rtol=1e-6, atol=1e-5)


class TestAlgebraic:
    def test_circles_by_hand(self) -> None:
        # Half of the unit circle, y > 0, and a straight piece; both about their centroids.
        angle = np.linspace(0, np.pi, 181)
        arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        line = np.stack([np.linspace(-1, 1, 181), np.zeros(181)], axis=1)
        middle = arc.mean(axis=0)
        curvature, foot, normal = fit_algebraic(np.stack([arc - middle, line]))
        np.testing.assert_allclose(np.abs(curvature), [1, 0], atol=1e-12)
        np.testing.assert_allclose(foot[0] + middle, [0, 1], atol=1e-12)
        np.testing.assert_allclose(normal[0] * np.sign(curvature[0]), [0, -1], atol=1e-12)
        np.testing.assert_allclose(foot[1], 0, atol=1e-12)
        np.testing.assert_allclose(np.abs(normal[1]), [0, 1], atol=1e-12)

    def test_a_whole_sphere_has_its_centroid_in_the_centre(self) -> None:
        points = np.concatenate([np.eye(3), -np.eye(3)]) * 5
        curvature, foot, normal = fit_algebraic(points)
        assert abs(curvature) == pytest.approx(0.2, abs=1e-14)
        np.testing.assert_allclose(foot + normal / curvature, 0, atol=1e-12)
        assert np.linalg.norm(foot) == pytest.approx(5, abs=1e-12)
