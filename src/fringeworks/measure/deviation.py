"""How far a cloud lies from a surface, point by point: measured minus nominal, mm.

Positive is outside: along the normal of a mesh, towards the sensor of a cloud.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, UsageError
from fringeworks.measure.reference import Reference, find_counterparts, noise_across
from fringeworks.model import Cloud, Pose
from fringeworks.model.frame import UNKNOWN_FRAME


@dataclass(frozen=True, slots=True, eq=False)
class Deviations:
    """Signed distances of a cloud's points from a surface.

    Attributes
    ----------
    deviation_mm
        ``(H, W)`` positive outside; NaN where the point or its counterpart is missing.
    sigma_mm
        ``(H, W)`` random part of it, one standard deviation; of both where the reference is
        a cloud.
    reference_from_cloud
        Where the cloud was moved to before it was compared.
    beyond
        Points that have nothing of the surface within reach.
    border
        Points nearest to where the surface ends: it does not say what is beside it.
    """

    deviation_mm: NDArray[np.float32]
    sigma_mm: NDArray[np.float32]
    reference_from_cloud: Pose
    beyond: int
    border: int

    @property
    def values_mm(self) -> NDArray[np.float64]:
        """``(n,)`` all that are known, row by row."""
        return self.deviation_mm[np.isfinite(self.deviation_mm)].astype(np.float64)


def compare_cloud(
    cloud: Cloud,
    reference: Reference,
    *,
    pose: Pose | None = None,
    within_mm: float = 5.0,
) -> Deviations:
    """Hold a cloud against a surface.

    Parameters
    ----------
    pose
        ``reference_from_cloud``; None where both are in one frame.
    within_mm
        Points further off than this are no part of what is compared.

    Raises
    ------
    UsageError
        `within_mm` is not positive, or no pose is given and the reference is known to be in another
        frame.
    MeasurementError
        The cloud has no points, or none of them a counterpart.
    """
    if not within_mm > 0:
        raise UsageError(f"within_mm must be positive, got {within_mm}")
    if pose is None:
        _check_frames(cloud, reference)
    pose = pose or Pose.identity()
    pixels = np.flatnonzero(cloud.valid)
    if not len(pixels):
        raise MeasurementError("the cloud has no points to compare")
    points = pose.apply(cloud.points())
    found = find_counterparts(reference, points, within_mm=within_mm)
    known = (found.triangles >= 0) & ~found.border
    if not known.any():
        raise MeasurementError(
            f"none of the cloud's {len(points)} points lies within {within_mm:g} mm of the "
            "reference: are both in one frame and in mm? --align brings the cloud to it"
        )
    triangles = found.triangles[known]
    normals = reference.smooth[triangles] @ pose.rotation
    sigma = np.hypot(noise_across(cloud, pixels[known], normals), reference.sigma_mm[triangles])
    return Deviations(
        _spread(cloud, pixels[known], found.distance_mm[known]),
        _spread(cloud, pixels[known], sigma),
        pose,
        int(np.count_nonzero(found.triangles < 0)),
        int(np.count_nonzero(found.border)),
    )


def _check_frames(cloud: Cloud, reference: Reference) -> None:
    names = (cloud.frame, reference.frame or UNKNOWN_FRAME)
    if names[0] != names[1] and UNKNOWN_FRAME not in names:
        raise UsageError(
            f"the cloud is in frame '{names[0]}' and the reference in '{names[1]}': bring "
            "both into one by convert --frame, or --align"
        )


def _spread(
    cloud: Cloud, pixels: NDArray[np.integer], values: NDArray[np.floating]
) -> NDArray[np.float32]:
    whole = np.full(cloud.valid.size, np.nan, np.float32)
    whole[pixels] = values
    return whole.reshape(cloud.valid.shape)
