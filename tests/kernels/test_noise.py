"""Sums and counts of images, against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fringeworks.kernels.noise import count_second_differences, sum_drawn_in


def test_sums_by_hand() -> None:
    values = np.array([[1.0, -3.0, np.nan], [2.0, 1.0, np.nan]], np.float32)
    sums = np.full((2, 3), 99, np.float32)
    sum_drawn_in(values, 4.0, sums)
    # squares 1, 4 | 9 drawn in to 4, 1 | none
    assert sums.tolist() == [[5.0, 5.0, 0.0], [2.0, 2.0, 0.0]]


def test_second_differences_by_hand() -> None:
    # One bright pixel of 10 answers with the mask itself: 4 at itself, 2 beside, 1 at corners.
    image = np.zeros((5, 5), np.int32)
    image[2, 2] = 10
    counts = np.zeros(81, np.int64)
    count_second_differences(image, np.ones((5, 5), np.bool_), counts)
    assert {int(n): int(counts[n]) for n in np.flatnonzero(counts)} == {40: 1, 20: 4, 10: 4}


@given(
    height=st.integers(1, 8),
    width=st.integers(1, 8),
    seed=st.integers(0, 1000),
    dtype=st.sampled_from([np.uint8, np.uint16, np.int32]),
)
def test_second_differences_against_numpy(
    height: int, width: int, seed: int, dtype: type[np.integer]
) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 200, (height, width)).astype(dtype)
    use = rng.random((height, width)) < 0.7
    counts = np.zeros(8 * 200 + 1, np.int64)
    count_second_differences(image, use, counts)
    mask = np.outer([1, -2, 1], [1, -2, 1])
    expected = np.zeros_like(counts)
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            if use[i, j]:
                window = image[i - 1 : i + 2, j - 1 : j + 2].astype(int)
                expected[abs(int(np.sum(mask * window)))] += 1
    np.testing.assert_array_equal(counts, expected)


@pytest.mark.parametrize("slope", [(3, 0), (0, 5), (2, 7)])
def test_what_is_linear_counts_as_nothing(slope: tuple[int, int]) -> None:
    v, u = np.mgrid[:9, :9]
    image = (slope[0] * u + slope[1] * v + 1).astype(np.uint8)
    counts = np.zeros(8 * 255 + 1, np.int64)
    count_second_differences(image, np.ones(image.shape, np.bool_), counts)
    assert counts[0] == 49
