"""The residual field: what a model leaves of the projector coordinate, as a smooth function."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

from fringeworks.model.sequence import Axis

ModelName: TypeAlias = Literal["geometric", "extended", "full"]
"""The paper's equations 1 to 3, its 4 to 7, and the one with both lenses' distortion."""

Three: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ResidualField:
    """A polynomial to be taken from the measured projector coordinate before it is triangulated.

    Attributes
    ----------
    model, axis
        Whose residuals it is: those of this model, along this projector axis.
    order
        Largest total degree in the three variables, one or more.
    middle
        A plane over the camera's image, px and px per px: the third variable is the coordinate
        less ``middle[0] + middle[1] u + middle[2] v``, which depth alone moves much.
    low, high
        Corners of the box in which it was fitted: u, v and third variable. Outside, the
        polynomial stays what it is on the box's faces.
    coefficients
        Projector px, of products of Chebyshev polynomials, see `kernels.residual`.
    gain, gain_sigma
        Share of the mean squared residual of views that the fit had not seen which it took away,
        and its standard error.
    """

    model: ModelName
    axis: Axis
    order: int
    middle: Three
    low: Three
    high: Three
    coefficients: tuple[float, ...]
    gain: float
    gain_sigma: float


def count_terms(order: int) -> int:
    """How many products of three variables have a total degree up to `order`."""
    return math.comb(order + 3, 3)
