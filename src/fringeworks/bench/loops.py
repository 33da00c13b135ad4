"""Loops that are measured beside the package's own: the memory's pace, the arctangent alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.arctangent import arctangent
from fringeworks.kernels.compiled import kernel
from fringeworks.kernels.fused_nouns import Points
from fringeworks.kernels.tile import Bytes, Images

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
def read_and_write_maps(stacks: tuple[Images, ...], seen: Bytes, points: Points) -> None:
    """Read every frame and write every map of a cloud: what one pass takes at least.

    `seen` is ``(W,)``, worked in.
    """
    for i in range(points.reason.shape[0]):
        seen[:] = 0
        for stack in stacks:
            for n in range(stack.shape[0]):
                image = stack[n, i]
                for j in range(seen.size):
                    seen[j] ^= np.uint8(image[j])
        x, y, z = points.xyz[0, i], points.xyz[1, i], points.xyz[2, i]
        sigma, intensity, reason = points.sigma_mm[i], points.intensity[i], points.reason[i]
        for j in range(seen.size):
            x[j] = seen[j]
        for j in range(seen.size):
            y[j] = seen[j]
        for j in range(seen.size):
            z[j] = seen[j]
        for j in range(seen.size):
            sigma[j] = seen[j]
        for j in range(seen.size):
            intensity[j] = seen[j]
        for j in range(seen.size):
            reason[j] = seen[j]


@kernel
def angles(y: Floats, x: Floats, out: Floats) -> None:
    """`arctangent` of each pair."""
    for n in range(y.size):
        out[n] = arctangent(y[n], x[n])
