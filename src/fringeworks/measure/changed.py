"""What is measured of one changed region: height, area, volume, each with its random part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fringeworks.measure.grid_mesh import cloud_normals
from fringeworks.model import Cloud

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kind = Literal["changed", "appeared", "vanished"]

CORE_SHARE = 0.5
"""A window mean of half the step stands on its edge: what is above is the region's area."""

TYPICAL_PERCENT = 90.0

LEAST_LEAN = 0.1
"""Cosine of the steepest view that is believed; a pixel without a normal counts as facing."""


@dataclass(frozen=True, slots=True, eq=False)
class ChangedRegion:
    """One connected change.

    Attributes
    ----------
    kind
        "appeared" and "vanished": a surface where the other scan has none; then only pixels,
        place and area are known.
    pixels
        Pixels of its area.
    centre_mm
        ``(3,)`` in the clouds' frame: of the later scan, of the earlier where vanished.
    mean_mm, mean_sigma_mm, largest_mm
        Change of the distance to the camera over the area, positive towards it: mean with its
        random standard deviation, and the mean of the window where it is largest.
    area_mm2
        Of the surface that is there afterwards; beforehand where vanished.
    volume_mm3, volume_sigma_mm3
        What came (positive) or went, with its random standard deviation.
    box_px
        First and last column, first and last row.
    """

    kind: Kind
    pixels: int
    centre_mm: Array
    mean_mm: float
    mean_sigma_mm: float
    largest_mm: float
    area_mm2: float
    volume_mm3: float
    volume_sigma_mm3: float
    box_px: tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """What both scans see along each pixel's ray, ``(H, W)``.

    Attributes
    ----------
    before, after
        Distances from the camera, mm; NaN where there is no point.
    solid
        Solid angle of the pixel.
    sigma
        Of the distances' difference, mm, one standard deviation.
    """

    before: Array
    after: Array
    solid: Array
    sigma: Array


def rays_of(before: Cloud, after: Cloud) -> Rays:
    """The rays of two scans on one grid."""
    points = [cloud.seen_from_camera() for cloud in (before, after)]
    first, second = (np.linalg.norm(part, axis=-1) for part in points)
    # An error of z moves the point along its ray, by as many times more as the ray is longer.
    slants = [
        cloud.sigma_mm * distance / part[..., 2]
        for cloud, part, distance in zip((before, after), points, (first, second), strict=True)
    ]
    rays = np.where(np.isfinite(first)[..., None], points[0], points[1])
    directions = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return Rays(first, second, _solid_angles(directions), np.hypot(*slants))


def _solid_angles(directions: Array) -> Array:
    """Solid angle of each pixel; where a neighbour is missing, the median of all."""
    down, right = (np.gradient(directions, axis=axis) for axis in (0, 1))
    solid = np.linalg.norm(np.cross(down, right), axis=-1)
    known = np.isfinite(solid)
    return np.where(known, solid, np.median(solid[known]) if known.any() else np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A scan's points ``(H, W, 3)`` and the surface that each pixel shows ``(H, W)``, mm^2."""

    xyz: NDArray[np.float32]
    areas: Array


def show_surface(cloud: Cloud, solid: Array) -> Shown:
    """What each pixel's cone of a solid angle ``(H, W)`` cuts from the surface's own plane."""
    seen, pose = cloud.seen_from_camera(), cloud.frame_from_camera
    normals = cloud_normals(cloud)
    turned = normals if pose is None else normals @ pose.rotation
    distance = np.linalg.norm(seen, axis=-1)
    lean = np.abs(np.einsum("...i,...i->...", seen, turned)) / distance
    return Shown(cloud.xyz, solid * distance**2 / np.where(lean > LEAST_LEAN, lean, 1.0))


def changed_region(
    surface: Shown, rays: Rays, maps: tuple[Array, Array], mask: Mask
) -> ChangedRegion:
    """A change inside a mask, from the differences and their window means ``(H, W)``, mm."""
    difference, mean = maps
    heights = np.abs(mean[mask])
    core = mask & (np.abs(mean) >= CORE_SHARE * np.percentile(heights, TYPICAL_PERCENT))
    weights = 1 / rays.sigma[core] ** 2
    volume = (rays.before**3 - rays.after**3) / 3 * rays.solid
    noise = rays.after**2 * rays.solid * rays.sigma
    largest = np.flatnonzero(mask)[np.argmax(heights)]
    return ChangedRegion(
        "changed",
        int(core.sum()),
        surface.xyz[core].astype(np.float64).mean(axis=0),
        float(np.average(difference[core], weights=weights)),
        float(1 / np.sqrt(weights.sum())),
        float(mean.ravel()[largest]),
        float(surface.areas[core].sum()),
        float(np.nansum(volume[mask])),
        float(np.sqrt(np.nansum(noise[mask] ** 2))),
        _box(core),
    )


def one_sided_region(kind: Kind, surface: Shown, mask: Mask) -> ChangedRegion:
    """A surface that only one scan has."""
    nan = float("nan")
    return ChangedRegion(
        kind,
        int(mask.sum()),
        surface.xyz[mask].astype(np.float64).mean(axis=0),
        nan,
        nan,
        nan,
        float(surface.areas[mask].sum()),
        nan,
        nan,
        _box(mask),
    )


def _box(mask: Mask) -> tuple[int, int, int, int]:
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return int(columns[0]), int(columns[-1]), int(rows[0]), int(rows[-1])
