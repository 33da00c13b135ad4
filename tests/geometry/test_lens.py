"""The lens against OpenCV, against numbers written by hand, and against its own inverse."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.geometry.lens import LENS_NAMES, project, project_jacobian, unproject
from fringeworks.kernels.lens import distort, distort_jacobian
from fringeworks.model import Lens

Array = NDArray[np.float64]

# fx, fy, cx, cy, k1, k2, p1, p2, k3: none, a paper-like projector, a wide lens, a pincushion.
LENSES = {
    "pinhole": Lens(1000.0, 1010.0, 320.0, 240.0),
    "projector": Lens(1913.5, 1912.8, 481.2, 1013.4, -0.14, 0.10, -0.002, 0.0031, -0.02),
    "wide": Lens(420.0, 422.0, 310.0, 251.0, -0.29, 0.094, 0.0012, -0.0007, -0.013),
    "pincushion": Lens(800.0, 790.0, 400.0, 300.0, 0.21, 0.05, 0.001, 0.002, 0.01),
}
each_lens = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())


def cloud(count: int = 200) -> Array:
    """Points in a cone of 35 degrees, 300 to 900 mm ahead."""
    rng = np.random.default_rng(7)
    z = rng.uniform(300, 900, count)
    return np.stack([*rng.uniform(-0.5, 0.5, (2, count)) * z, z], axis=-1)


def opencv_arguments(lens: Lens) -> tuple[Array, Array]:
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1.0]])
    return matrix, np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])


class TestProject:
    @each_lens
    def test_equals_opencv(self, lens: Lens) -> None:
        points = cloud()
        still = np.zeros(3)
        theirs, _ = cv2.projectPoints(points, still, still, *opencv_arguments(lens))
        # Both are a dozen operations in double precision on numbers of a few thousand.
        np.testing.assert_allclose(project(points, lens.vector), theirs.reshape(-1, 2), atol=1e-10)

    def test_each_term_by_hand(self) -> None:
        # (30, 40, 100): x = 0.3, y = 0.4, r^2 = 0.25.
        point = np.array([30.0, 40.0, 100.0])
        # radial terms: 0.1 r^2, r^4, r^6 = 0.025, 0.00625, 0.0015625 of (0.3, 0.4);
        # p1: (2 x y, r^2 + 2 y^2) = (0.24, 0.57); p2: (r^2 + 2 x^2, 2 x y) = (0.43, 0.24).
        moves = {
            "k1": (0.0075, 0.01),
            "k2": (0.001875, 0.0025),
            "k3": (0.00046875, 0.000625),
            "p1": (0.024, 0.057),
            "p2": (0.043, 0.024),
        }
        for name, (dx, dy) in moves.items():
            lens = np.zeros(9)
            lens[:4] = 1000.0, 2000.0, 10.0, 20.0
            lens[LENS_NAMES.index(name)] = 0.1
            expected = [10 + 1000 * (0.3 + dx), 20 + 2000 * (0.4 + dy)]
            np.testing.assert_allclose(project(point, lens), expected, rtol=1e-14)

    def test_not_in_front_is_nan(self) -> None:
        points = np.array([[1.0, 2.0, -5.0], [1, 2, 0], [0, 0, 0], [np.nan, 0, 5], [1, 2, np.nan]])
        assert np.isnan(project(points, LENSES["wide"].vector)).any(axis=1).all()
        assert np.isnan(project(points[:3], LENSES["wide"].vector)).all()

    @pytest.mark.parametrize("shape", [(3,), (1, 3), (0, 3), (4, 5, 3), (2, 3, 4, 3)])
    def test_any_leading_shape(self, shape: tuple[int, ...]) -> None:
        points = np.broadcast_to([10.0, 20.0, 100.0], shape)
        pixels = project(points, LENSES["pinhole"].vector)
        assert pixels.shape == (*shape[:-1], 2)
        np.testing.assert_allclose(pixels, np.broadcast_to([420.0, 442.0], pixels.shape))
        back = unproject(pixels, LENSES["pinhole"].vector)
        np.testing.assert_allclose(back, np.broadcast_to([0.1, 0.2], pixels.shape), rtol=1e-14)

    def test_names_follow_the_vector(self) -> None:
        lens = Lens(*range(1, 10))
        assert [getattr(lens, name) for name in LENS_NAMES] == lens.vector.tolist()
        assert Lens.from_vector(lens.vector) == lens


@st.composite
def gentle_lenses(draw: st.DrawFn) -> Array:
    """Lenses whose distortion rises up to a radius of 0.7 (35 degrees)."""
    k1 = draw(st.floats(-0.3, 0.3))
    k2, k3 = draw(st.floats(-0.15, 0.15)), draw(st.floats(-0.1, 0.1))
    p1, p2 = draw(st.floats(-0.005, 0.005)), draw(st.floats(-0.005, 0.005))
    return np.array([1500.0, 1450.0, 500.0, 300.0, k1, k2, p1, p2, k3])


class TestUnproject:
    @each_lens
    def test_equals_opencv(self, lens: Lens) -> None:
        pixels = project(cloud(), lens.vector)
        matrix, distortion = opencv_arguments(lens)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-13)
        theirs = cv2.undistortPointsIter(
            pixels.reshape(-1, 1, 2), matrix, distortion, np.eye(3), np.eye(3), criteria
        )
        # OpenCV's fixed-point iteration ends within 1e-13 px of the distorted point.
        np.testing.assert_allclose(
            unproject(pixels, lens.vector), theirs.reshape(-1, 2), atol=1e-11
        )

    @given(lens=gentle_lenses(), x=st.floats(-0.5, 0.5), y=st.floats(-0.5, 0.5))
    def test_inverse_of_project(self, lens: Array, x: float, y: float) -> None:
        # The least slope in this family is 1 - 0.9 r^2 - 0.75 r^4 - 0.7 r^6 = 0.27 at r^2 = 0.5,
        # less 0.07 for the tangential terms: an error of 1e-16 grows to less than 1e-14.
        pixels = project(np.array([x * 400, y * 400, 400.0]), lens)
        np.testing.assert_allclose(unproject(pixels, lens), [x, y], atol=1e-13)

    @given(lens=gentle_lenses(), u=st.floats(0, 1000), v=st.floats(0, 600))
    def test_project_undoes_it(self, lens: Array, u: float, v: float) -> None:
        ray = unproject(np.array([u, v]), lens)
        if np.isfinite(ray).all():
            np.testing.assert_allclose(project(np.append(ray, 1.0), lens), [u, v], atol=1e-8)

    def test_beyond_the_fold_is_nan(self) -> None:
        # k1 = -1/3: r - r^3 / 3 rises to 2 / 3 at r = 1 and folds back.
        lens = Lens(100.0, 100.0, 0.0, 0.0, k1=-1 / 3).vector
        for angle in np.linspace(0, 2 * np.pi, 13):
            ahead = np.array([np.cos(angle), np.sin(angle)])
            inside = unproject(66.0 * ahead, lens)
            # By hand: r - r^3 / 3 = 0.66 has its root on the rising branch at r = 0.90124...
            root = min(r.real for r in np.roots([-1 / 3, 0, 1, -0.66]) if 0 < r.real < 1)
            np.testing.assert_allclose(inside, root * ahead, atol=1e-10)
            for radius in (66.7, 67.0, 80.0, 150.0, 1000.0):
                assert np.isnan(unproject(radius * ahead, lens)).all()

    def test_a_second_rise_is_no_inverse(self) -> None:
        # 1 - 0.708 s - 0.707 s^2 + 0.319 s^3 is negative from s = 0.92 on and positive again from
        # 2.8: points whose distortion only that far branch can give have no inverse.
        lens = Lens(1.0, 1.0, 0.0, 0.0, -0.236, -0.1414, 0.0, 0.0, 0.0455).vector
        radii = np.linspace(0, 0.958, 200)
        highest = float(np.max(radii - 0.236 * radii**3 - 0.1414 * radii**5 + 0.0455 * radii**7))
        for radius in np.linspace(highest + 1e-3, 3.0, 60):
            assert np.isnan(unproject(np.array([radius, 0.0]), lens)).all()

    def test_a_fold_nearer_than_the_distorted_radius(self) -> None:
        # k1 = 0.35, k3 = -0.26: the distortion grows to 1.19 at r = 1.03, so the distorted point
        # itself, where the search begins, lies beyond the fold.
        lens = Lens(1.0, 1.0, 0.0, 0.0, 0.3138, 0.1129, 0.0, 0.0, -0.2553).vector
        for radius in np.linspace(0.05, 1.05, 40):
            ideal = radius * np.array([0.6, -0.8])
            pixels = project(np.append(ideal, 1.0), lens)
            np.testing.assert_allclose(unproject(pixels, lens), ideal, atol=1e-9)

    def test_nan_stays_nan(self) -> None:
        assert np.isnan(unproject(np.array([np.nan, 3.0]), LENSES["wide"].vector)).all()


class TestJacobian:
    @each_lens
    def test_of_the_distortion_alone(self, lens: Lens) -> None:
        step = 1e-4  # third derivatives are below 10: 10 step^2 / 6; rounding 1e-16 / step
        for x, y in np.random.default_rng(2).uniform(-0.5, 0.5, (20, 2)):
            found = np.reshape(distort_jacobian(x, y, lens.vector), (2, 2))
            slopes = [
                np.subtract(
                    distort(x + dx, y + dy, lens.vector), distort(x - dx, y - dy, lens.vector)
                )
                for dx, dy in ((step, 0.0), (0.0, step))
            ]
            np.testing.assert_allclose(found, np.transpose(slopes) / (2 * step), atol=2e-8)

    @each_lens
    def test_pixels_are_projections(self, lens: Lens) -> None:
        pixels, _, _ = project_jacobian(cloud(), lens.vector)
        np.testing.assert_allclose(pixels, project(cloud(), lens.vector), atol=1e-10)

    @each_lens
    def test_by_point(self, lens: Lens) -> None:
        points = cloud()
        _, by_point, _ = project_jacobian(points, lens.vector)
        step = 1e-2  # mm: third derivatives are below 1e-5 px / mm^3, rounding 1e-12 / step
        for axis in range(3):
            move = np.zeros(3)
            move[axis] = step
            ahead, behind = (project(points + sign * move, lens.vector) for sign in (1, -1))
            slope = (ahead - behind) / (2 * step)
            np.testing.assert_allclose(by_point[:, :, axis], slope, atol=2e-8)

    @each_lens
    def test_by_lens(self, lens: Lens) -> None:
        points = cloud()
        _, _, by_lens = project_jacobian(points, lens.vector)
        for n in range(9):
            move = np.zeros(9)
            move[n] = 0.25  # the projection is linear in f, c, and each coefficient by itself
            ahead, behind = (project(points, lens.vector + sign * move) for sign in (1, -1))
            np.testing.assert_allclose(by_lens[:, :, n], (ahead - behind) / 0.5, atol=1e-9)
