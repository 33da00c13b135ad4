"""The full model as a table: the same depths without iteration, error bound checked and kept.

The numbers of `kernels.table` stand on a lattice of a few pixels, so that a table takes less than
a tenth of a second to make and next to no memory, and belongs to a rig and a depth range alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError
from fringeworks.kernels.table import LINE, PAIR, RAY, triangulate_by_table
from fringeworks.kernels.table_fit import sample_nodes, worst_miss
from fringeworks.kernels.triangulate import triangulate
from fringeworks.model import AXES, Axis, FloatMap, Rig

Array = NDArray[np.float64]
Optics = tuple[Array, Array, Array, Array]

STEPS_PX = (64, 32, 16, 8)
"""Lattices that are tried, coarse to fine."""

LEAST_CELLS = 3
LARGEST_ERROR_MM = 1e-3
"""Of a table that stands for the full model."""

CHECKED_DEPTHS = 9
WIDENED = 0.01
"""Share of the range that a table reaches beyond it at both ends."""

BOTH = 2
"""What the kernels call a table of both axes."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthTable:
    """Depth of every camera pixel over its coordinate along one axis, or along both.

    Attributes
    ----------
    axis
        The projector axis; None for both.
    z_range_mm
        Depths for which it holds; points outside are void.
    reference_mm
        The depth from which its lines are counted.
    nodes
        ``(K, rows, cols)``: see `kernels.table`.
    step_px
        Of the lattice, camera px, down and across.
    bound_mm
        Largest distance from the full model's point in the middle of any cell, at depths between
        those that the table was made from.
    """

    axis: Axis | None
    z_range_mm: tuple[float, float]
    reference_mm: float
    nodes: Array
    step_px: tuple[float, float]
    bound_mm: float

    @property
    def holds(self) -> bool:
        """Whether it may stand for the full model."""
        return self.bound_mm <= LARGEST_ERROR_MM

    @property
    def depths(self) -> tuple[float, float, float]:
        """Depth of reference and range, mm, as the kernels take them."""
        return (self.reference_mm, *self.z_range_mm)

    @property
    def kind(self) -> int:
        """What the kernels call its axis."""
        return BOTH if self.axis is None else AXES.index(self.axis)


def make_table(rig: Rig, axis: Axis | None, z_range_mm: tuple[float, float]) -> DepthTable:
    """The coarsest table that holds, else the finest.

    Parameters
    ----------
    axis
        The coded axis; None: both, weighted by their sigma.
    z_range_mm
        Depths, above zero and finite.

    Raises
    ------
    UsageError
        The range does not rise, reaches the camera, or has no end.
    """
    near, far = z_range_mm
    if not 0 < near < far < math.inf:
        raise UsageError(f"z-range must rise between 0 and infinity, MIN:MAX, got {near}:{far}")
    for step_px in STEPS_PX:
        table = _table_of(rig, axis, (near, far), step_px)
        if table.holds:
            break
    return table


def solve_points(
    coordinates: FloatMap,
    sigmas: FloatMap,
    rig: Rig,
    window: tuple[float, float],
    *,
    exact: bool,
) -> tuple[FloatMap, FloatMap, FloatMap]:
    """Points ``(H, W, 3)``, their sigma and the residual across the epipolar line.

    By table where one holds, unless they must be `exact`. The arrays are those of
    `kernels.triangulate`, whose iteration is the other way.
    """
    shape = coordinates.shape[1:]
    xyz: FloatMap = np.empty((*shape, 3), np.float32)
    sigma, epipolar = np.empty(shape, np.float32), np.empty(shape, np.float32)
    out = (xyz, sigma, epipolar)
    table = None if exact else table_for(rig, _measured_axis(sigmas), window)
    if table is None:
        triangulate(coordinates, sigmas, *optics_of(rig), window, *out)
    else:
        triangulate_by_table(
            coordinates, sigmas, table.nodes, table.step_px, table.kind, table.depths, *out
        )
    return out


def table_for(rig: Rig, axis: Axis | None, window: tuple[float, float]) -> DepthTable | None:
    """A table that may stand for the full model, if there is one."""
    if not 0 < window[0] < window[1] < math.inf:
        return None
    table = make_table(rig, axis, window)
    return table if table.holds else None


def _measured_axis(sigmas: FloatMap) -> Axis | None:
    """The axis that alone was measured; the other's sigma is infinite."""
    missing = [bool(np.isinf(sigma.flat[0])) for sigma in sigmas]
    if missing[0] == missing[1]:
        return None
    return "y" if missing[0] else "x"


def _table_of(rig: Rig, axis: Axis | None, z_range: tuple[float, float], step: int) -> DepthTable:
    optics = optics_of(rig)
    kind = BOTH if axis is None else AXES.index(axis)
    width, height = rig.camera.width, rig.camera.height
    rows, down = _lattice(height, step)
    cols, across = _lattice(width, step)
    numbers = RAY + LINE if axis else PAIR + 2 * LINE
    nodes = np.empty((numbers, rows, cols))
    depths = _sampled_depths(z_range)
    sample_nodes((down, across), optics, depths, kind, nodes)
    near, far = _widened(z_range)
    checked = np.concatenate([depths[:1], 1 / np.linspace(1 / near, 1 / far, CHECKED_DEPTHS)])
    extent = rig.projector.width if axis == "x" else rig.projector.height
    sizes = (width, height, extent)
    bound = worst_miss(nodes, (down, across), optics, kind, checked, sizes)
    return DepthTable(axis, z_range, float(depths[0]), nodes, (down, across), bound)


def optics_of(rig: Rig) -> Optics:
    """Lenses of camera and projector, rotation and translation of ``projector_from_camera``."""
    pose = rig.projector_from_camera
    return (
        rig.camera.lens.vector,
        rig.projector.lens.vector,
        np.ascontiguousarray(pose.rotation),
        np.ascontiguousarray(pose.translation_mm),
    )


def _lattice(pixels: int, step_px: int) -> tuple[int, float]:
    """Count of nodes and their step, px; the outermost stand on the outermost pixels."""
    cells = max(LEAST_CELLS, math.ceil((pixels - 1) / step_px))
    return cells + 1, max(pixels - 1, 1) / cells


def _widened(z_range: tuple[float, float]) -> tuple[float, float]:
    margin = WIDENED * (z_range[1] - z_range[0])
    return max(z_range[0] - margin, z_range[0] / 2), z_range[1] + margin


def _sampled_depths(z_range: tuple[float, float]) -> Array:
    """``(5,)``: zeros of Chebyshev's polynomial in 1 / z, the one in the middle first."""
    near, far = (1 / z for z in _widened(z_range))
    zeros = np.cos(np.pi * np.array([5, 1, 3, 7, 9]) / 10)
    return np.asarray(1 / ((near + far) / 2 + (near - far) / 2 * zeros))
