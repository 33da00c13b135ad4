"""A scan held against the truth of the twin that made it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from fringeworks.errors import MeasurementError
from fringeworks.geometry.align import align_points
from fringeworks.geometry.forms import CylinderFit
from fringeworks.geometry.grid import grid_normals
from fringeworks.model import Cloud
from fringeworks.twin.truth import Truth

EDGE_PX = 3
"""Pixels this close to the edge of a surface see both sides of it, and are left out."""

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Bias:
    """Error of a cloud after rigid alignment with the truth, mm; 95 % of the points are below.

    `normal_p95_mm` is along the true surface's normal, `depth_p95_mm` along z; `normal_mm` is the
    signed error along the normal, positive towards the camera, ``(H, W)``, NaN where nothing was
    compared.
    """

    normal_p95_mm: float
    depth_p95_mm: float
    normal_mm: Floats


def inner_pixels(truth: Truth) -> Mask:
    """``(H, W)``: lit pixels on one surface with all their neighbours."""
    lit = np.isfinite(truth.column)
    inner = np.zeros_like(lit)
    neighbours = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), dtype=bool)
    for surface in range(len(truth.names)):
        inner |= binary_erosion(lit & (truth.surface == surface), neighbours)
    return inner


def find_bias(cloud: Cloud, truth: Truth) -> Bias:
    """The systematic part of a cloud's error: of a scan without noise.

    Raises
    ------
    MeasurementError
        Fewer than three points to compare.
    """
    use = inner_pixels(truth) & cloud.valid
    if np.count_nonzero(use) < 3:
        raise MeasurementError("the scan and its truth have fewer than 3 pixels in common")
    seen, true = cloud.xyz[use].astype(np.float64), truth.xyz[use]
    rotation, translation = align_points(seen, true)
    error = seen @ rotation.T + translation - true
    normals = grid_normals(truth.xyz.astype(np.float32))[use].astype(np.float64)
    along = np.full(use.shape, np.nan)
    along[use] = np.einsum("ni,ni->n", error, normals)
    return Bias(
        normal_p95_mm=float(np.nanpercentile(np.abs(along), 95)),
        depth_p95_mm=float(np.percentile(np.abs(error[:, 2]), 95)),
        normal_mm=along,
    )


def predicted_form_mm(cloud: Cloud, cylinder: CylinderFit) -> float:
    """Form rms that the cloud's sigma predicts of a perfect cylinder, mm.

    An error of z moves a point along its ray (x / z, y / z, 1): ``sigma_z |n . ray|`` of it lies
    along the normal n.
    """
    points, sigma = cloud.points(), cloud.sigma_mm[cloud.valid].astype(np.float64)
    outwards = points - cylinder.axis_point_mm
    outwards -= np.outer(outwards @ cylinder.axis_direction, cylinder.axis_direction)
    normals = outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    facing = np.einsum("ni,ni->n", normals, points / points[:, 2:])
    return float(np.sqrt(np.mean((sigma * facing) ** 2)))


def sigma_ratio(noisy: Cloud, quiet: Cloud, truth: Truth) -> float:
    """Predicted over observed random part of the depth: 1 where sigma is right.

    The observed one is the root mean square of the differences between a scan and the same scan
    without noise, each over its own sigma.
    """
    use = inner_pixels(truth) & noisy.valid & quiet.valid
    scores = (noisy.xyz[use, 2] - quiet.xyz[use, 2]) / noisy.sigma_mm[use]
    return float(1 / np.sqrt(np.mean(scores.astype(np.float64) ** 2)))
