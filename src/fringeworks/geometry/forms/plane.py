"""Planes by orthogonal least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.geometry.forms.checks import check_points, weights_of
from fringeworks.geometry.forms.deviations import band95_of, range_of, rms_per_freedom

Array = NDArray[np.float64]

PARAMETERS = 3


@dataclass(frozen=True, slots=True)
class PlaneFit:
    """A plane ``normal . X = offset_mm`` with the signed distances of its points.

    The normal is of length one and looks at the origin of the frame (the camera), so `offset_mm`
    is never positive.

    Attributes
    ----------
    covariance
        ``(4, 4)`` of normal and offset (mm), of rank three, from what is left of the points: it
        takes their errors as independent, and knows of no systematic ones. NaN of three points.
    deviations_mm
        ``(n,)`` in the points' order, positive on the side that the normal looks to.
    """

    normal: Array
    offset_mm: float
    covariance: Array
    deviations_mm: Array

    @property
    def offset_sigma_mm(self) -> float:
        """Standard deviation of the offset, which a tilt moves where the points lie aside."""
        return float(np.sqrt(self.covariance[-1, -1]))

    @property
    def tilt_sigma_deg(self) -> float:
        """Standard deviation of the normal's direction, where it is known worst."""
        if not np.isfinite(self.covariance).all():
            return float("nan")
        largest = float(np.linalg.eigvalsh(self.covariance[:3, :3])[-1])
        return float(np.rad2deg(np.sqrt(max(largest, 0.0))))

    @property
    def form_rms_mm(self) -> float:
        """Root mean square distance, per degree of freedom (three parameters are fitted)."""
        return rms_per_freedom(self.deviations_mm, parameters=PARAMETERS)

    @property
    def flatness_mm(self) -> float:
        """Range of the signed distances: grows with the number of points by noise alone."""
        return range_of(self.deviations_mm)

    @property
    def band95_mm(self) -> float:
        """Width between the 2.5 % and 97.5 % quantiles of the distances (ISO 10360-13's manner)."""
        return band95_of(self.deviations_mm)


def fit_plane(points: Array, *, sigma_mm: Array | None = None) -> PlaneFit:
    """Orthogonal least-squares plane through points ``(n, 3)``, mm; no point is left out.

    Parameters
    ----------
    sigma_mm
        ``(n,)`` standard deviations of the points; only their ratios matter.

    Raises
    ------
    MeasurementError
        Fewer than three points, some of them not finite, or all of them on one line.
    ShapeError, UsageError
        Shapes that do not fit; a `sigma_mm` that is not positive.
    """
    check_points(points, form="plane", least=PARAMETERS)
    weights = weights_of(sigma_mm, len(points)) ** 2
    centre = weights @ points / np.sum(weights)
    centred = points - centre
    spread, axes = np.linalg.eigh((centred * weights[:, None]).T @ centred)
    if spread[1] <= 1e-12 * max(spread[2], 1e-300):
        raise MeasurementError(f"the {len(points)} points lie on one line: no plane is defined")
    if float(axes[:, 0] @ centre) > 0:
        axes = -axes
    normal = axes[:, 0]
    deviations = centred @ normal
    variance = _variance(deviations, weights)
    variances = variance / np.array([float(np.sum(weights)), *spread[1:]])
    change = np.zeros((4, 3))  # by a shift along the normal and both tilts
    change[:3, 1:] = axes[:, 1:]
    change[3] = [1.0, *(axes[:, 1:].T @ centre)]
    return PlaneFit(
        normal=normal,
        offset_mm=float(normal @ centre),
        covariance=(change * variances) @ change.T,
        deviations_mm=deviations,
    )


def _variance(deviations: Array, weights: Array) -> float:
    """Of unit weight, per degree of freedom; NaN where there is none."""
    freedom = len(deviations) - PARAMETERS
    return float(np.sum(weights * deviations**2)) / freedom if freedom else float("nan")
