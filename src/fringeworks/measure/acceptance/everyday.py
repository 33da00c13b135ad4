"""The same in everyday words: how precise a point is, how flat a flat, how true a length.

VDI/VDE 2634-2 tells ranges, which grow with the number of points. These words part what a range
mixes: noise of single points, ripple over a finger's width, bend over the whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.forms import PlaneFit

PATCHES = 10
"""Patches along the longer side of a flat."""

LEAST_PATCH = 30
"""Points of a patch that is told."""

FULL_SHARE = 0.5
"""Of the middling patch's points: patches with fewer lie across the border."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Planarity:
    """How flat a flat comes out, mm; None where the points do not tell it.

    Attributes
    ----------
    point_precision_mm
        One standard deviation of a single point against its two neighbours in the row, across the
        plane: noise, without anything that is smooth. None of a cloud without a grid.
    local_mm
        Root mean square about planes through patches a tenth of the flat wide: noise and ripple.
    global_mm
        Range of the patches' means about the plane through all: bend, the noise averaged out.
    patch_mm
        Side of a patch.
    """

    point_precision_mm: float | None
    local_mm: float | None
    global_mm: float | None
    patch_mm: float


def find_planarity(
    xyz: NDArray[np.float32], stay: NDArray[np.bool_], plane: PlaneFit, *, corners: Array
) -> Planarity:
    """Planarity of the pixels `stay` ``(H, W)`` of a grid ``(H, W, 3)``, mm, fitted by `plane`.

    `corners` ``(4, 3)`` are those of the rectangle that the patches divide, longer side first.
    """
    points = xyz[stay].astype(np.float64)
    across = np.full(stay.shape, np.nan)
    across[stay] = plane.deviations_mm
    side, residuals, means = _patches(points, plane.deviations_mm, corners)
    return Planarity(
        point_precision_mm=_point_precision(across),
        local_mm=float(np.sqrt(np.mean(residuals**2))) if len(residuals) else None,
        global_mm=float(np.ptp(means)) if len(means) > 1 else None,
        patch_mm=side,
    )


def _point_precision(across: Array) -> float | None:
    """From a - 2 b + c of neighbours, whose variance is 6 times that of independent ones."""
    if 1 in across.shape:
        return None  # a list of points: the next in it need not be a neighbour
    second = across[:, :-2] - 2 * across[:, 1:-1] + across[:, 2:]
    known = second[np.isfinite(second)]
    return float(np.sqrt(np.mean(known**2) / 6)) if len(known) else None


def _patches(points: Array, across: Array, corners: Array) -> tuple[float, Array, Array]:
    """Side of a patch, what is left of all points in their patches' planes, the patches' means."""
    sides = corners[1] - corners[0], corners[3] - corners[0]
    frame = np.stack([side / np.linalg.norm(side) for side in sides], axis=1)
    flat = (points - corners[0]) @ frame
    side = float(np.linalg.norm(sides[0])) / PATCHES
    places = np.floor(flat / side).astype(np.int64)
    _, label = np.unique(places, axis=0, return_inverse=True)
    order = np.argsort(label, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    least = max(LEAST_PATCH, FULL_SHARE * float(np.median([len(group) for group in groups])))
    full = [group for group in groups if len(group) >= least]
    residuals = [_about_plane(flat[group], across[group]) for group in full]
    means = np.array([across[group].mean() for group in full])
    return side, np.concatenate(residuals) if residuals else np.empty(0), means


def _about_plane(flat: Array, across: Array) -> Array:
    """Residuals of a patch's plane, scaled by its three parameters' degrees of freedom."""
    design = np.column_stack([np.ones(len(flat)), flat - flat.mean(axis=0)])
    solution, *_ = np.linalg.lstsq(design, across, rcond=None)
    return np.asarray((across - design @ solution) * np.sqrt(len(flat) / (len(flat) - 3)))
