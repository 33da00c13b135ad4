from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.geometry.align import align_points
from fringeworks.geometry.pose import rotation_matrix

Array = NDArray[np.float64]


def scatter(count: int, *, seed: int = 0) -> Array:
    """Points all about one at 700 mm."""
    rng = np.random.default_rng(seed)
    return np.array([0.0, 0.0, 700.0]) + rng.uniform(-100, 100, (count, 3))


def test_by_hand() -> None:
    # A quarter turn about z, x to y, then 5 along z.
    source = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]])
    target = np.array([[0.0, 1, 5], [-1, 0, 5], [0, 0, 6], [0, 0, 5]])
    rotation, translation = align_points(source, target)
    np.testing.assert_allclose(rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(translation, [0, 0, 5], atol=1e-15)


@given(
    st.tuples(*[st.floats(-3, 3)] * 3).map(np.array),
    st.tuples(*[st.floats(-500, 500)] * 3).map(np.array),
    st.sampled_from([3, 4, 50]),
)
def test_any_motion_is_found(vector: Array, move: Array, count: int) -> None:
    source, turn = scatter(count), rotation_matrix(vector)
    rotation, translation = align_points(source, source @ turn.T + move)
    # Rounding of 1000 mm, 1e-13, over points 100 mm apart; three may be a thin triangle.
    np.testing.assert_allclose(rotation, turn, atol=1e-13)
    np.testing.assert_allclose(translation, move, atol=1e-10)


def test_points_on_one_plane_are_enough() -> None:
    source, turn = scatter(20) * [1, 1, 0], rotation_matrix(np.array([1.0, -2.0, 0.5]))
    rotation, _ = align_points(source, source @ turn.T)
    np.testing.assert_allclose(rotation, turn, atol=1e-13)


def test_a_mirror_image_is_turned_and_not_mirrored() -> None:
    source = scatter(50)
    rotation, _ = align_points(source, source * [1, 1, -1])
    assert np.linalg.det(rotation) == pytest.approx(1, abs=1e-12)


def test_the_motion_is_the_best() -> None:
    """No small motion beside it brings the pairs closer."""
    source = scatter(30)
    target = source @ rotation_matrix(np.array([0.1, 0.2, 0.3])).T + [1, 2, 3]
    target += np.random.default_rng(1).normal(0, 1.0, target.shape)
    weights = np.random.default_rng(2).uniform(0.1, 3, 30)
    rotation, translation = align_points(source, target, weights)

    def loss(turn: Array, move: Array) -> float:
        off = source @ (rotation @ rotation_matrix(turn)).T + translation + move - target
        return float(weights @ np.sum(off**2, axis=1))

    none = np.zeros(3)
    for step in np.concatenate([np.eye(3), -np.eye(3)]):
        assert loss(1e-4 * step, none) > loss(none, none) < loss(none, 1e-3 * step)


def test_noise_moves_it_as_far_as_its_statistics_say() -> None:
    # n pairs of sd 0.1 in each coordinate, spread 100 / sqrt 3 a side: the middle is known to
    # sd / sqrt n, an angle to sd / sqrt(n 2 * 100^2 / 3); five sigma of each, three at once.
    count, sd = 5000, 0.1
    source = scatter(count)
    noise = np.random.default_rng(4).normal(0, sd, source.shape)
    rotation, translation = align_points(source, source + noise)
    middle = source.mean(axis=0)
    assert np.abs(rotation @ middle + translation - middle).max() < 5 * sd / np.sqrt(count)
    angles = (rotation - rotation.T)[[2, 0, 1], [1, 2, 0]] / 2
    assert np.abs(angles).max() < 5 * sd / np.sqrt(count * 2 * 100**2 / 3)


def test_pairs_without_weight_do_not_count() -> None:
    source, turn = scatter(10), rotation_matrix(np.array([0.1, 0.2, 0.3]))
    target = source @ turn.T
    target[3] += 100
    weights = np.ones(10)
    weights[3] = 0
    rotation, _ = align_points(source, target, weights)
    np.testing.assert_allclose(rotation, turn, atol=1e-13)


class TestWhatCannotBeAligned:
    def test_too_few_pairs(self) -> None:
        with pytest.raises(MeasurementError, match="at least 3 pairs, got 2"):
            align_points(scatter(2), scatter(2))
        with pytest.raises(MeasurementError, match="at least 3 pairs, got 2"):
            align_points(scatter(3), scatter(3), np.array([1.0, 0, 1]))

    @pytest.mark.parametrize("direction", [(1, 2, 3), (0, 0, 0)])
    def test_points_on_one_line(self, direction: tuple[float, float, float]) -> None:
        line = np.linspace(-50, 50, 9)[:, None] * np.array(direction, dtype=float) + [3, 4, 700]
        with pytest.raises(MeasurementError, match="9 points lie on one line"):
            align_points(line, line)
        with pytest.raises(MeasurementError, match="9 points lie on one line"):
            align_points(scatter(9), line)

    def test_void_points(self) -> None:
        target = scatter(5)
        target[2, 0] = np.nan
        with pytest.raises(MeasurementError, match="1 of the 5 pairs are not finite"):
            align_points(scatter(5), target)

    def test_shapes_that_do_not_fit(self) -> None:
        with pytest.raises(ShapeError, match=r"must both be \(n, 3\), got \(5, 3\) and \(4, 3\)"):
            align_points(scatter(5), scatter(4))
        with pytest.raises(ShapeError, match=r"weights must be \(5,\)"):
            align_points(scatter(5), scatter(5), np.ones(4))

    @pytest.mark.parametrize("wrong", [-1.0, np.nan, np.inf])
    def test_weights_that_are_none(self, wrong: float) -> None:
        with pytest.raises(UsageError, match="weights must be finite and not negative"):
            align_points(scatter(3), scatter(3), np.array([1, wrong, 1]))
