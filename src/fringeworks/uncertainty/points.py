"""The systematic part of each point's uncertainty: what the calibration leaves open.

The variance of a depth, pixel and projector coordinate fixed, is ``g C g`` with C the covariance of
the rig's parameters and g the depth's derivatives by them (`calibrate.uncertainty`). Like the depth
of a pinhole, g grows with z^2; ``g C g / z^4`` is smooth in the pixel and in 1 / z, so that a grid
of few nodes tells it at every pixel. The scale of the board, which no calibration with it can see,
adds its own share of z.

It is no noise: neighbouring points share it, repeating a scan does not average it, and a form is
known better than its points are (docs/uncertainty.md).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.adjust.covariance import Covariance, read_covariance
from fringeworks.calibrate.judge.uncertainty import (
    points_by_parameters,
    shared_covariance,
    state_of,
    variances,
)
from fringeworks.errors import ShapeError
from fringeworks.kernels.sampling import read_sigma
from fringeworks.model import Axis, Cloud, FloatMap, Rig
from fringeworks.uncertainty.seen import Seen

Array = NDArray[np.float64]

NODES = (6, 25, 37)
"""Of 1 / z, rows and columns: between them the variance is read to about one part in a thousand."""

WEIGHTS: dict[Axis | None, tuple[float, float]] = {
    None: (1.0, 1.0),
    "x": (1.0, 0.0),
    "y": (0.0, 1.0),
}


def add_systematic(cloud: Cloud, rig: Rig, *, axis: Axis | None = None) -> Cloud:
    """The cloud with `Cloud.systematic_mm`; as it is where the rig keeps no covariance.

    Parameters
    ----------
    cloud
        In the camera's frame, on its grid.
    rig
        The rig that made it.
    axis
        The axis that alone was used; None for both, taken as alike in weight.

    Raises
    ------
    ShapeError
        The cloud is not of the size of the rig's camera.
    FormatError
        The rig's covariance is damaged.
    """
    covariance = read_covariance(rig.further)
    if covariance is None:
        return cloud
    sigma = systematic_sigma(cloud.xyz[..., 2], rig, covariance, axis=axis)
    return replace(cloud, systematic_mm=sigma)


def systematic_sigma(
    depth_mm: FloatMap, rig: Rig, covariance: Covariance, *, axis: Axis | None = None
) -> FloatMap:
    """Systematic part of depths ``(H, W)``, mm, one standard deviation; NaN where they are.

    Raises
    ------
    ShapeError
        The map is not of the size of the rig's camera.
    """
    expected = (rig.camera.height, rig.camera.width)
    if depth_mm.shape != expected:
        raise ShapeError(f"depth_mm must be {expected} like the rig's camera, got {depth_mm.shape}")
    out = np.full(expected, np.nan, np.float32)
    if not np.isfinite(depth_mm).any():
        return out
    nodes = _lay_nodes(depth_mm)
    inverse, row, column = np.meshgrid(*nodes, indexing="ij")
    pixels = np.stack([column.ravel(), row.ravel()], axis=1)
    seen = Seen.of(rig, pixels, 1 / inverse.ravel())
    by = points_by_parameters(state_of(rig), seen, weights=WEIGHTS[axis])[:, 2:]
    grid = variances(by, shared_covariance(covariance))[:, 0].reshape(inverse.shape) * inverse**4
    start = _three(float(node[0]) for node in nodes)
    per = _three((len(node) - 1) / float(node[-1] - node[0]) for node in nodes)
    read_sigma(depth_mm, grid, start, per, rig.scale_sigma or 0.0, out)
    return out


def _three(values: Iterable[float]) -> tuple[float, float, float]:
    first, second, third = values
    return first, second, third


def _lay_nodes(depth_mm: FloatMap) -> tuple[Array, Array, Array]:
    """Nodes of 1 / z, row and column about what the map holds; no interval is empty."""
    valid = np.isfinite(depth_mm)
    limits = [(1 / float(np.nanmax(depth_mm)), 1 / float(np.nanmin(depth_mm)))]
    for other in (1, 0):
        places = np.flatnonzero(valid.any(axis=other))
        limits.append((float(places[0]), float(places[-1])))
    widest = [1e-3 * limits[0][1], 1.0, 1.0]
    inverse, row, column = (
        np.linspace(low, max(high, low + least), count)
        for (low, high), least, count in zip(limits, widest, NODES, strict=True)
    )
    return inverse, row, column
