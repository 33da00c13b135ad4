"""Parts of a cloud: by a box in mm or by a rectangle of camera pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.model import Cloud

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Region:
    """What to measure: None leaves that side open.

    Attributes
    ----------
    box_mm
        Ranges of x, y and z, in the cloud's frame.
    pixels
        Ranges of camera columns and rows, both ends included.
    """

    box_mm: tuple[Range, Range, Range] | None = None
    pixels: tuple[Range, Range] | None = None


def select_points(cloud: Cloud, region: Region) -> NDArray[np.float64]:
    """``(n, 3)`` valid points of the region, mm.

    Raises
    ------
    MeasurementError
        The cloud has no point there.
    """
    points: NDArray[np.float64] = cloud.xyz[chosen_pixels(cloud, region)].astype(np.float64)
    if not len(points):
        raise MeasurementError(f"the region holds no point; {_where_points_are(cloud)}")
    return points


def chosen_pixels(cloud: Cloud, region: Region) -> NDArray[np.bool_]:
    """``(H, W)``: valid points of the region."""
    chosen = cloud.valid
    if region.box_mm is not None:
        for axis, (low, high) in enumerate(region.box_mm):
            with np.errstate(invalid="ignore"):
                chosen &= (cloud.xyz[..., axis] >= low) & (cloud.xyz[..., axis] <= high)
    if region.pixels is not None:
        (u0, u1), (v0, v1) = region.pixels
        v, u = np.ogrid[: chosen.shape[0], : chosen.shape[1]]
        chosen &= (u >= u0) & (u <= u1) & (v >= v0) & (v <= v1)
    return chosen


def _where_points_are(cloud: Cloud) -> str:
    points = cloud.points()
    if not len(points):
        return "the whole cloud is void"
    low, high = points.min(axis=0), points.max(axis=0)
    sides = ", ".join(
        f"{name} {a:.0f} to {b:.0f}" for name, a, b in zip("xyz", low, high, strict=True)
    )
    return f"the cloud's points span {sides} mm"
