"""Loops that are measured beside the package's own: the memory's pace, the arctangent alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.arctangent import arctangent
from fringeworks.kernels.compiled import kernel

Floats = NDArray[np.float32]


@kernel
def read_and_write(frames: NDArray[np.generic], out: Floats) -> None:
    """Read three frames and write one map: what any kernel with this traffic takes at least."""
    _, height, width = frames.shape
    for i in range(height):
        first, second, third, row = frames[0, i], frames[1, i], frames[2, i], out[i]
        for j in range(width):
            row[j] = np.float32(first[j]) + np.float32(second[j]) + np.float32(third[j])


@kernel
def angles(y: Floats, x: Floats, out: Floats) -> None:
    """`arctangent` of each pair."""
    for n in range(y.size):
        out[n] = arctangent(y[n], x[n])
