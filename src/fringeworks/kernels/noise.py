"""Sums and counts from which the noise of an image is read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.compiled import kernel

Floats = NDArray[np.float32]

ZERO = np.float32(0)
ONE = np.float32(1)


@kernel
def sum_drawn_in(values: Floats, limit: float, sums: Floats) -> None:
    """Per column of `values` ``(H, W)``: the sum of squares drawn in to `limit`, and their count.

    `sums` is ``(2, W)``. NaN is left out.
    """
    height, width = values.shape
    most = np.float32(limit)
    total, count = sums[0], sums[1]
    sums[:] = ZERO
    for i in range(height):
        row = values[i]
        for j in range(width):
            square = row[j] * row[j]
            drawn_in = square if square < most else most
            total[j] += drawn_in if square == square else ZERO
            count[j] += ONE if square == square else ZERO


@kernel
def count_second_differences(
    frame: NDArray[np.generic], use: NDArray[np.bool_], counts: NDArray[np.int64]
) -> None:
    """Histogram of the absolute (1 -2 1) x (1 -2 1) differences about the pixels of `use`.

    `frame` and `use` are ``(H, W)``; the outermost pixels have no difference. `counts` has a bin
    for each whole number up to eight times the range of grey levels, and starts at zero.
    """
    height, width = frame.shape
    down = np.empty(width, np.int32)
    across = np.empty(width, np.int32)
    two = np.int32(2)
    for i in range(1, height - 1):
        above, here, below, wanted = frame[i - 1], frame[i], frame[i + 1], use[i]
        for j in range(width):
            down[j] = np.int32(above[j]) - two * np.int32(here[j]) + np.int32(below[j])
        for j in range(1, width - 1):
            across[j] = abs(down[j - 1] - two * down[j] + down[j + 1])
        for j in range(1, width - 1):
            if wanted[j]:
                counts[across[j]] += 1
