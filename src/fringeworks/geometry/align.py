"""Rigid alignment of points that belong together, one by one.

Least squares by the singular value decomposition of the covariance between both sets: Kabsch (Acta
Crystallographica A32, 1976), with Umeyama's guard against reflections (IEEE PAMI 13, 1991).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError, UsageError

Array = NDArray[np.float64]

LEAST_POINTS = 3
ON_A_LINE = 1e-12
"""Second of the covariance's singular values over the first: squares of lengths."""


def align_points(source: Array, target: Array, weights: Array | None = None) -> tuple[Array, Array]:
    """Rigid motion that brings each point of `source` to that of `target`, ``target_from_source``.

    Least ``sum w |R source + t - target|^2``, R a rotation even where a reflection would fit
    better. No pair is left out: outliers pull it.

    Parameters
    ----------
    source, target
        ``(n, 3)`` mm, row by row the same point.
    weights
        ``(n,)`` not negative, such as 1 / sigma^2; all alike without.

    Returns
    -------
    rotation, translation
        ``(3, 3)`` and ``(3,)`` mm.

    Raises
    ------
    MeasurementError
        Fewer than three pairs (of a weight that is not zero), points that are not finite, or all
        of them on one line.
    ShapeError, UsageError
        Shapes that do not fit; weights that are negative or not finite.
    """
    weights = _check(source, target, weights)
    share = weights / weights.sum()
    source_middle, target_middle = share @ source, share @ target
    covariance = (source - source_middle).T @ ((target - target_middle) * share[:, None])
    left, size, right = np.linalg.svd(covariance)
    if size[1] <= ON_A_LINE * size[0]:
        raise MeasurementError(f"the {len(source)} points lie on one line: no rotation is defined")
    mirrored = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = np.asarray((left * mirrored @ right).T)
    return rotation, np.asarray(target_middle - rotation @ source_middle)


def _check(source: Array, target: Array, weights: Array | None) -> Array:
    """The weights ``(n,)`` of pairs that can be aligned."""
    if source.ndim != 2 or source.shape[1] != 3 or source.shape != target.shape:
        raise ShapeError(
            f"source and target must both be (n, 3), got {source.shape} and {target.shape}"
        )
    if weights is None:
        weights = np.ones(len(source))
    if weights.shape != (len(source),):
        raise ShapeError(f"weights must be ({len(source)},) like the points, got {weights.shape}")
    if not np.all((weights >= 0) & np.isfinite(weights)):
        raise UsageError("weights must be finite and not negative, got others")
    counted = int(np.count_nonzero(weights))
    if counted < LEAST_POINTS:
        raise MeasurementError(f"an alignment needs at least {LEAST_POINTS} pairs, got {counted}")
    void = int(np.count_nonzero(~np.isfinite(source + target).all(axis=1)))
    if void:
        raise MeasurementError(
            f"{void} of the {len(source)} pairs are not finite: leave void points out"
        )
    return weights
