"""What changed between two scans of one scene by one rig that stood still.

Per pixel both scans see along one ray, and what the rig gets wrong it gets wrong in both: only the
random parts are left, and these average. A window of pixels whose weighted mean difference is
beyond what noise alone would show anywhere in the picture (Bonferroni) belongs to a change; windows
that touch are one region. Noise that neighbours share, such as the ripple of a frame that was a
little brighter, averages less: how much the windows of the whole picture scatter says so. All this
takes it that most of the scene stayed as it was.

Volumes are those of the pixels' cones between both surfaces, ``(r_before^3 - r_after^3) / 3`` per
solid angle, and so exact on slopes too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, ShapeError, UsageError
from fringeworks.measure.changed import (
    ChangedRegion,
    Kind,
    Rays,
    changed_region,
    one_sided_region,
    rays_of,
    show_surface,
)
from fringeworks.model import Cloud
from fringeworks.model.frame import CAMERA_FRAME

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Part: TypeAlias = "tuple[ChangedRegion, Mask]"

MAD_TO_SIGMA = 1.4826
TAIL_SIGMAS = 4.0
"""What one pixel may say at most for a change: a wild one must not speak for its whole window."""

FULL = 0.95
"""Of a window: where so much of it has a point in one scan alone, a surface came or went."""


@dataclass(frozen=True, slots=True)
class ChangeRules:
    """When a difference is a change.

    Attributes
    ----------
    window_px
        Odd width of the window that is averaged, camera px.
    least_mm
        Smallest mean change along the line of sight, mm, however significant.
    false_alarm
        Probability that noise alone gives a region anywhere in a pair of scans.
    """

    window_px: int = 9
    least_mm: float = 0.1
    false_alarm: float = 1e-3

    def __post_init__(self) -> None:
        if self.window_px < 1 or self.window_px % 2 == 0:
            raise UsageError(f"window_px must be odd and positive, got {self.window_px}")
        if not (self.least_mm >= 0 and 0 < self.false_alarm < 1):
            raise UsageError(
                "least_mm must be 0 or more and false_alarm between 0 and 1, got "
                f"{self.least_mm:g} and {self.false_alarm:g}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """Differences of two scans and the regions in which they are no noise.

    Attributes
    ----------
    difference_mm
        ``(H, W)`` distance to the camera before minus after: positive towards the camera, NaN
        where one scan has no point.
    sigma_mm
        ``(H, W)`` its random part, times `noise_factor`.
    labels
        ``(H, W)`` number of the region from 1; 0 elsewhere.
    regions
        Largest volume first, then surfaces that came or went by their area.
    noise_factor
        By how much the differences scatter more than the scans' sigmas say; at least 1.
    limit_sigmas
        What a window's mean had to exceed, in its sigmas as if pixels were independent.
    """

    difference_mm: Array
    sigma_mm: Array
    labels: NDArray[np.int32]
    regions: tuple[ChangedRegion, ...]
    noise_factor: float
    limit_sigmas: float


def find_change(before: Cloud, after: Cloud, rules: ChangeRules | None = None) -> Change:
    """What changed between two scans on one pixel grid.

    Raises
    ------
    ShapeError
        The grids differ, or there is none, or one smaller than the window.
    UsageError
        The scans are in two frames, and where the camera stood in one of them nobody knows.
    MeasurementError
        No pixel has a point, and a sigma, in both scans.
    """
    rules = rules or ChangeRules()
    _check_scans(before, after, rules)
    rays = rays_of(before, after)
    difference = rays.before - rays.after
    if not np.isfinite(difference).any():
        raise MeasurementError("no pixel has a point in both scans: do they show one scene?")
    if not (rays.sigma[np.isfinite(difference)] > 0).any():
        raise MeasurementError("the scans say no sigma of their points: start from their .npz")
    factor = _noise_factor(difference / rays.sigma)
    rays = replace(rays, sigma=factor * rays.sigma)
    mean, _ = _window_means(difference, rays.sigma, rules.window_px)
    limit = _limit(rules.false_alarm, int(np.isfinite(difference).sum()))
    with np.errstate(invalid="ignore"):
        scores = _window_scores(difference, rays.sigma, rules.window_px)
        limit *= _noise_factor(scores)
        significant = (np.abs(scores) > limit) & (np.abs(mean) >= rules.least_mm)
    parts = [
        *_changed_parts(
            after, rays, (difference, mean), significant=significant, window=rules.window_px
        ),
        *_one_sided_parts((before, after), rays, rules.window_px),
    ]
    labels = np.zeros(difference.shape, np.int32)
    for number, (_, mask) in enumerate(parts, start=1):
        labels[mask] = number
    regions = tuple(region for region, _ in parts)
    return Change(difference, rays.sigma, labels, regions, factor, limit)


def _check_scans(before: Cloud, after: Cloud, rules: ChangeRules) -> None:
    shapes = before.valid.shape, after.valid.shape
    if shapes[0] != shapes[1] or min(shapes[0]) == 1:
        raise ShapeError(
            f"both scans must be on one camera's grid (.npz), got {shapes[0]} and {shapes[1]}"
        )
    if min(shapes[0]) < rules.window_px:
        raise ShapeError(
            f"window_px must be at most the grid's sides, {shapes[0]}, got {rules.window_px}"
        )
    placed = [scan.frame == CAMERA_FRAME or scan.frame_from_camera for scan in (before, after)]
    if before.frame != after.frame and not all(placed):
        raise UsageError(
            f"the scans are in frames '{before.frame}' and '{after.frame}', and where the camera "
            "stood is not in the files: start from the .npz of both scans"
        )


def _noise_factor(scores: Array) -> float:
    """How much wider than a normal distribution the bulk of the scores is; changes are outliers."""
    known = scores[np.isfinite(scores)]
    spread = MAD_TO_SIGMA * float(np.median(np.abs(known - np.median(known)))) if known.size else 1
    return max(1.0, spread)


def _window_means(difference: Array, sigma: Array, window: int) -> tuple[Array, Array]:
    """Weighted mean of the differences about each pixel, and its sigma; NaN where it has none."""
    from scipy.ndimage import uniform_filter

    known = np.isfinite(difference) & (sigma > 0)
    weights = np.where(known, 1 / np.where(known, sigma, 1) ** 2, 0)
    product = np.where(known, difference, 0) * weights
    total, moment = (
        window**2 * uniform_filter(part, window, mode="constant") for part in (weights, product)
    )
    total = np.where(known, total, np.nan)
    return moment / total, 1 / np.sqrt(total)


def _window_scores(difference: Array, sigma: Array, window: int) -> Array:
    """Mean of each window's tamed differences, over its sigma if pixels were independent."""
    tame = np.clip(difference, -TAIL_SIGMAS * sigma, TAIL_SIGMAS * sigma)
    mean, error = _window_means(tame, sigma, window)
    return mean / error


def _limit(false_alarm: float, windows: int) -> float:
    from scipy.stats import norm

    return float(norm.isf(false_alarm / (2 * max(windows, 1))))


def _changed_parts(
    after: Cloud, rays: Rays, maps: tuple[Array, Array], *, significant: Mask, window: int
) -> list[Part]:
    """Regions of one sign each, largest volume first; maps are differences and window means."""
    signs = (significant & (np.sign(maps[1]) == sign) for sign in (1, -1))
    masks = [mask for one in signs for mask in _pieces(one, window)]
    if not masks:
        return []
    surface = show_surface(after, rays.solid)
    parts = [(changed_region(surface, rays, maps, mask), mask) for mask in masks]
    return sorted(parts, key=lambda part: -abs(part[0].volume_mm3))


def _one_sided_parts(clouds: tuple[Cloud, Cloud], rays: Rays, window: int) -> list[Part]:
    """Surfaces that came or went, largest area first."""
    before, after = clouds
    parts: list[Part] = []
    sides: tuple[tuple[Kind, Cloud, Cloud], ...] = (
        ("appeared", after, before),
        ("vanished", before, after),
    )
    for kind, there, other in sides:
        masks = _pieces(_solid_part(there.valid & ~other.valid, window), window)
        if masks:
            surface = show_surface(there, rays.solid)
            parts += [(one_sided_region(kind, surface, mask), mask) for mask in masks]
    return sorted(parts, key=lambda part: -part[0].area_mm2)


def _pieces(mask: Mask, window: int) -> list[Mask]:
    """Regions of a mask; what overlaps as windows is one."""
    from scipy.ndimage import label, maximum_filter

    numbers, count = label(maximum_filter(mask, window), np.ones((3, 3)))
    return [mask & (numbers == number) for number in range(1, count + 1)]


def _solid_part(alone: Mask, window: int) -> Mask:
    """Where whole windows are so, and what hangs together with them; single pixels flicker."""
    from scipy.ndimage import binary_propagation, uniform_filter

    seeds = alone & (uniform_filter(alone.astype(float), window, mode="constant") >= FULL)
    return np.asarray(binary_propagation(seeds, mask=alone), dtype=np.bool_)
