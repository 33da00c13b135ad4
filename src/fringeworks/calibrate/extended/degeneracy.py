"""What planes cannot tell of the paper's ten parameters.

Multiplied out, equation 4 has a numerator of two terms and a denominator of six, and the ten enter
them in fewer than ten ways. A shift of the camera's principal point (Ku0, Kv0) only moves C and D
by constants, which C3 and C4 do as well: two directions change no depth at all. Where fx = fy, Kfc
scales what it touches of the denominator, which C1 to C4 undo: a third. A projector turned purely
about the axis perpendicular to the phase axis leaves one more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.normal_equations import COLUMNS, slopes_of
from fringeworks.kernels.paper_model import Equation
from fringeworks.model import Extended

Array = NDArray[np.float64]

LOOK_AT = 4000
"""Points, evenly from all of them: enough to tell what no number of points tells."""

NULL_SHARE = 1e-11
"""Of the largest singular value; fx and fy that differ by 1e-6 of themselves have 1e-10."""

PIVOTS = ("Ku0", "Kv0", "Kfc", "Kphi", "Kfp", "Kz", "C1", "C2", "C3", "C4")
"""Which parameter a null direction is named by: the first of these that is free to be."""

USABLE_MM = 1e-3
"""A direction that moves no depth by as much as this is told by no camera, whatever the algebra."""

_NEGLIGIBLE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Degeneracy:
    """Directions in the ten parameters, by what they do to the depth.

    Attributes
    ----------
    singular_mm
        ``(10,)`` falling: root mean square change of the depth, mm, where a direction is gone
        along by one prior standard deviation.
    rank
        How many of them are not zero.
    nulls
        Parameter changes that together change no depth, one mapping per direction; each begins
        with the parameter it is named by, changed by one standard deviation of its prior.
    """

    singular_mm: Array
    rank: int
    nulls: tuple[Mapping[str, float], ...]

    @property
    def usable(self) -> int:
        """How many of them are of use, see `USABLE_MM`: fx and fy that differ a little are not."""
        return int(np.count_nonzero(self.singular_mm > USABLE_MM))

    @property
    def condition(self) -> float:
        """Largest over smallest singular value of those that are of use."""
        return float(self.singular_mm[0] / self.singular_mm[self.usable - 1])


def expand(equation: Equation) -> Array:
    """``(8, 10)`` by which slopes by `COLUMNS` become those by `Extended.NAMES`."""
    out = np.zeros((len(COLUMNS), len(Extended.NAMES)))
    for place, name in enumerate(COLUMNS):
        out[place, Extended.NAMES.index(name)] = 1
    shifts = (("Ku0", 0, equation.x_focal), ("Kv0", 1, equation.y_focal))
    for name, side, focal in shifts:
        column = Extended.NAMES.index(name)
        out[COLUMNS.index("C3"), column] = equation.along[side] / focal
        out[COLUMNS.index("C4"), column] = equation.ahead[side] / focal
    return out


def find_degeneracy(
    rays: Array, coordinate: Array, equation: Equation, priors: Mapping[str, float]
) -> Degeneracy:
    """Look at what the ten do to the depth of points.

    Parameters
    ----------
    rays, coordinate
        ``(2, n)`` and ``(n,)`` projector px, as `calibrate.extended.planes.PlanePoints` has them.
    equation
        About which parameters.
    priors
        Standard deviation of each by name: their common measure.
    """
    some = np.linspace(0, len(coordinate) - 1, min(LOOK_AT, len(coordinate))).astype(np.intp)
    slopes = slopes_of(np.ascontiguousarray(rays[:, some]), coordinate[some], equation)
    scale = np.array([priors[name] for name in Extended.NAMES])
    scaled = slopes @ expand(equation) * scale / np.sqrt(len(some))
    _, singular, directions = np.linalg.svd(scaled, full_matrices=False)
    rank = int(np.count_nonzero(singular > NULL_SHARE * singular[0]))
    return Degeneracy(singular, rank, _name_nulls(directions[rank:].T, scale))


def _name_nulls(directions: Array, scale: Array) -> tuple[Mapping[str, float], ...]:
    """A basis of the space that ``(10, k)`` spans, each member with a parameter of its own."""
    pivots: list[int] = []
    for name in PIVOTS:
        row = Extended.NAMES.index(name)
        chosen = directions[[*pivots, row]]
        if np.linalg.matrix_rank(chosen, tol=_NEGLIGIBLE) == len(chosen):
            pivots.append(row)
    basis = directions @ np.linalg.inv(directions[pivots])
    return tuple(
        _moves(column * scale, pivot, scale) for column, pivot in zip(basis.T, pivots, strict=True)
    )


def _moves(change: Array, pivot: int, scale: Array) -> Mapping[str, float]:
    order = [pivot, *(place for place in range(len(change)) if place != pivot)]
    return {
        Extended.NAMES[place]: float(change[place])
        for place in order
        if abs(change[place]) > _NEGLIGIBLE * scale[place]
    }
