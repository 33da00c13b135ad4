"""What stands in a zone: a box before a rig, looked at scan after scan. No safety function.

A camera sees surfaces, not what is behind them. So the occupied volume is that of the zone between
the seen surface and the zone's far side, along the lines of sight: the object with its shadow, an
upper bound of what the object itself takes up. Of a pixel whose ray goes through the zone between
the depths `near` and `far`, and whose square at depth one has the area `a`, it is
``a (far^3 - z^3) / 3``. Rays without a point, or with one before the zone, say nothing about it:
their share of the zone is told as unseen, and so is what lies outside the image.

A point counts if it lies inside by more than its noise, and most of its neighbours do too: a wall
at the zone's far side would else be in and out, and single wild pixels are no objects.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import ShapeError, UsageError
from fringeworks.geometry.lens import unproject
from fringeworks.model import Camera, Cloud, Pose

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Range: TypeAlias = tuple[float, float]

SIDE = 3
MOST = 5
"""How many of a pixel and its eight neighbours must lie inside."""


@dataclass(frozen=True, slots=True)
class Zone:
    """A box: ranges of x, y and z, mm, in the frame in which zones are told.

    Raises
    ------
    UsageError
        Without a name, or a range that has no end or does not rise.
    """

    name: str
    box_mm: tuple[Range, Range, Range]

    def __post_init__(self) -> None:
        if not self.name:
            raise UsageError("a zone must have a name: NAME=X0:X1,Y0:Y1,Z0:Z1")
        for axis, (low, high) in zip("xyz", self.box_mm, strict=True):
            if not -math.inf < low < high < math.inf:
                raise UsageError(
                    f"zone {self.name}: {axis} must be a finite range that rises, got "
                    f"{low:g}:{high:g}"
                )

    @property
    def volume_mm3(self) -> float:
        return math.prod(high - low for low, high in self.box_mm)


@dataclass(frozen=True, slots=True)
class ZoneRules:
    """When a zone counts as occupied.

    Attributes
    ----------
    margin_sigmas
        How far inside a point must lie, in its own sigmas along the line of sight.
    false_alarm
        Probability per scan that the noise of surfaces all along the zone's sides gives so many
        points.
    least_points, least_mm3
        How much there must be at least, whatever noise would allow.
    """

    margin_sigmas: float = 5.0
    false_alarm: float = 1e-6
    least_points: int = 1
    least_mm3: float = 0.0

    def __post_init__(self) -> None:
        if not (self.margin_sigmas >= 0 and 0 < self.false_alarm < 1):
            raise UsageError(
                "margin_sigmas must be 0 or more and false_alarm between 0 and 1, got "
                f"{self.margin_sigmas:g} and {self.false_alarm:g}"
            )
        if not (self.least_points >= 1 and self.least_mm3 >= 0):
            raise UsageError(
                "least_points must be 1 or more and least_mm3 0 or more, got "
                f"{self.least_points} and {self.least_mm3:g}"
            )

    def needed_points(self, pixels: int) -> int:
        """How many points of a zone that so many pixels look at are an alarm."""
        from scipy.special import ndtr, pdtrc

        beyond = 2 * pixels * ndtr(-self.margin_sigmas)  # a wall at both ends of each ray
        needed = self.least_points
        while pdtrc(needed - 1, beyond) > self.false_alarm:
            needed += 1
        return needed


@dataclass(frozen=True, slots=True, eq=False)
class ZoneView:
    """A zone as a camera sees it; the same for all scans of a rig.

    Attributes
    ----------
    zone
        What is looked at.
    window
        Rows and columns of the camera's image that hold it.
    near_mm, far_mm
        ``(h, w)`` depth z at which each pixel's ray enters and leaves; NaN where it misses.
    area
        ``(h, w)`` of each pixel's square at depth one.
    zone_from_camera
        From the camera's frame to that in which the zone is told.
    shape
        ``(H, W)`` of the camera's image.
    """

    zone: Zone
    window: tuple[slice, slice]
    near_mm: Array
    far_mm: Array
    area: Array
    zone_from_camera: Pose
    shape: tuple[int, int]

    @property
    def pixels(self) -> int:
        """How many rays go through it."""
        return int(np.isfinite(self.far_mm).sum())


@dataclass(frozen=True, slots=True)
class Occupation:
    """What a scan says of a zone.

    Attributes
    ----------
    points
        Points that count.
    occupied_mm3
        Volume of the zone from these points on, away from the camera.
    unseen_share
        Share of the zone's volume that the scan says nothing about, 0 to 1.
    nearest_mm
        Smallest distance of a point that counts from the camera; NaN without any.
    nearest_xyz_mm
        That point, in the zone's frame; NaN without any.
    needed_points
        From how many points on it is an alarm.
    alarm
        Whether it is one.
    """

    points: int
    occupied_mm3: float
    unseen_share: float
    nearest_mm: float
    nearest_xyz_mm: tuple[float, float, float]
    needed_points: int
    alarm: bool


def look_at_zone(zone: Zone, camera: Camera, zone_from_camera: Pose | None = None) -> ZoneView:
    """Where a camera's rays enter and leave a zone.

    Parameters
    ----------
    zone_from_camera
        Frame of the zone; the camera's own unless given.

    Raises
    ------
    UsageError
        No ray meets the zone.
    """
    pose = zone_from_camera or Pose.identity()
    v, u = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    ideal = unproject(np.stack([u, v], axis=-1), camera.lens.vector)
    near, far = _crossed(ideal, zone, pose)
    met = far > near  # NaN is no crossing
    if not met.any():
        raise UsageError(f"zone {zone.name}: the camera does not see it: check its place and frame")
    down, across = (np.gradient(ideal, axis=axis) for axis in (0, 1))
    area = np.abs(down[..., 0] * across[..., 1] - down[..., 1] * across[..., 0])
    window = _window_of(met)
    return ZoneView(
        zone,
        window,
        np.where(met, near, np.nan)[window],
        np.where(met, far, np.nan)[window],
        area[window],
        pose,
        (camera.height, camera.width),
    )


def _crossed(ideal: Array, zone: Zone, pose: Pose) -> tuple[Array, Array]:
    """Depths ``(H, W)`` at which rays enter and leave a box, by its three pairs of planes."""
    rays = np.concatenate([ideal, np.ones_like(ideal[..., :1])], axis=-1) @ pose.rotation.T
    low, high = np.array(zone.box_mm).T - pose.translation_mm
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = low / rays, high / rays
    near = np.fmin(first, second).max(axis=-1)
    far = np.fmax(first, second).min(axis=-1)
    return np.maximum(near, 0.0), far


def _window_of(met: Mask) -> tuple[slice, slice]:
    rows, columns = np.flatnonzero(met.any(axis=1)), np.flatnonzero(met.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def measure_zone(cloud: Cloud, view: ZoneView, rules: ZoneRules | None = None) -> Occupation:
    """What a scan, in the camera's frame, says of a zone.

    Raises
    ------
    ShapeError
        The cloud is not on the grid of the view's camera.
    """
    rules = rules or ZoneRules()
    if cloud.valid.shape != view.shape:
        raise ShapeError(
            f"the cloud must be on its camera's grid, {view.shape}, got {cloud.valid.shape}"
        )
    points = cloud.xyz[view.window].astype(np.float64)
    z, margin = points[..., 2], rules.margin_sigmas * np.nan_to_num(cloud.sigma_mm[view.window])
    with np.errstate(invalid="ignore"):
        inside = _solid((z >= view.near_mm + margin) & (z <= view.far_mm - margin))
        seen = z > view.near_mm
    count, needed = int(inside.sum()), rules.needed_points(view.pixels)
    occupied = float(_volume(view, z)[inside].sum())
    known = float(_volume(view, view.near_mm)[seen].sum()) / view.zone.volume_mm3
    nearest, place = _nearest(points[inside], view.zone_from_camera)
    return Occupation(
        count,
        occupied,
        max(0.0, 1 - known),
        nearest,
        place,
        needed,
        alarm=count >= needed and occupied >= rules.least_mm3,
    )


def _solid(inside: Mask) -> Mask:
    """Of these pixels, those among whose neighbours most are such pixels too."""
    from scipy.ndimage import uniform_filter

    share = uniform_filter(inside.astype(np.float32), SIDE, mode="constant")
    return np.asarray(inside & (share > (MOST - 0.5) / SIDE**2), dtype=np.bool_)


def _volume(view: ZoneView, z: Array) -> Array:
    """``(h, w)`` volume of the zone from a depth on, pixel by pixel, mm^3."""
    return np.asarray(view.area * (view.far_mm**3 - z**3) / 3)


def _nearest(points: Array, pose: Pose) -> tuple[float, tuple[float, float, float]]:
    if not len(points):
        return math.nan, (math.nan, math.nan, math.nan)
    distances = np.linalg.norm(points, axis=-1)
    first = int(distances.argmin())
    x, y, z = pose.apply(points[first])
    return float(distances[first]), (float(x), float(y), float(z))
