"""What points must be for a form to be fitted to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError, UsageError

Array = NDArray[np.float64]

FLAT = 1e-12
"""Of the largest eigenvalue of the points' scatter: a millionth in length, double precision's own
rounding at a metre is a thousandth of that."""


def check_points(points: Array, *, form: str, least: int) -> None:
    """Refuse what is not ``(n, 3)`` numbers with n >= `least`; `form` is for the message.

    Raises
    ------
    ShapeError, MeasurementError
    """
    if points.ndim != 2 or points.shape[1] != 3:
        raise ShapeError(f"points must be (n, 3), got {points.shape}")
    if len(points) < least:
        raise MeasurementError(f"a {form} needs at least {least} points, got {len(points)}")
    void = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
    if void:
        raise MeasurementError(
            f"{void} of the {len(points)} points are not finite: leave void points out"
        )


def check_curved(points: Array, *, form: str) -> None:
    """Refuse checked points that lie on one plane, a line or a point included."""
    centred = points - points.mean(axis=0)
    spread = np.linalg.eigvalsh(np.einsum("ni,nj->ij", centred, centred))
    if spread[0] <= FLAT * spread[2]:
        raise MeasurementError(f"the {len(points)} points lie on one plane: no {form} is defined")


def weights_of(sigma_mm: Array | None, count: int) -> Array:
    """``1 / sigma_mm`` of each of `count` points, one without `sigma_mm`.

    Raises
    ------
    ShapeError, UsageError
        Not ``(count,)``, or not positive and finite everywhere.
    """
    if sigma_mm is None:
        return np.ones(count)
    if sigma_mm.shape != (count,):
        raise ShapeError(f"sigma_mm must be ({count},) like the points, got {sigma_mm.shape}")
    wrong = int(np.count_nonzero(~((sigma_mm > 0) & np.isfinite(sigma_mm))))
    if wrong:
        raise UsageError(
            f"sigma_mm must be positive and finite, got {wrong} of {count} that are not"
        )
    return np.asarray(1 / sigma_mm, dtype=np.float64)
