"""Models that others fit from phase to depth, without knowing the projector.

Each is fitted to the points of a calibration's planes: rays, coordinates, depths. The camera's
distortion is taken out of the rays, which their authors' papers do not do.

Du and Wang's governing equation (Optics Letters 32, 2438, 2007): with f = (1, X), X the
coordinate, ``z = (a f + b f x + c f y) / (d f + e f x + g f y)``, twelve numbers, eleven of them
free. Of a pinhole projector only ``a f`` remains above the line: eight, and at each pixel a linear
fraction in X. Neither has terms for a projector's distortion. A polynomial of its own for every
pixel has, and knows of no neighbour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import ShapeError

Array = NDArray[np.float64]

ROUNDS = 8
"""Of weighting the linear problem by its own denominator, which settles in four."""

DEGREE = 2
"""A cubic needs five planes at a pixel: of fourteen tilted checkerboards few pixels see as many."""


@dataclass(frozen=True, slots=True, eq=False)
class RationalModel:
    """A governing equation.

    Attributes
    ----------
    above, below
        Coefficients ``(2,)`` or ``(6,)``, and ``(6,)``, of 1, X, x, x X, y and y X.
    middle, half
        The coordinate X as it enters is less `middle` and over `half`, projector px.
    """

    above: Array
    below: Array
    middle: float
    half: float

    @classmethod
    def fit(cls, rays: Array, coordinate: Array, depth: Array, *, above: int) -> RationalModel:
        """Least squares of the depth, by `above` numerator terms: 6 Du and Wang, 2 the fraction.

        Parameters
        ----------
        rays, coordinate, depth
            ``(2, n)`` x and y of undistorted rays, ``(n,)`` projector px and ``(n,)`` mm; finite.

        Raises
        ------
        ShapeError
            Fewer points than coefficients, or `above` is neither 2 nor 6.
        """
        if above not in (2, 6):
            raise ShapeError(f"above must be 2 or 6 terms, got {above}")
        if len(coordinate) < above + 6:
            raise ShapeError(f"points must be at least {above + 6}, got {len(coordinate)}")
        middle = float((coordinate.max() + coordinate.min()) / 2)
        half = max(float(np.ptp(coordinate)) / 2, 1.0)
        terms, unit = _terms(rays, (coordinate - middle) / half), float(depth.mean())
        rows = np.concatenate([terms[:above], -terms * (depth / unit)]).T
        weights = np.ones(len(coordinate))
        for _ in range(ROUNDS):
            triangle = np.linalg.qr(rows * weights[:, None], mode="r")
            found = np.linalg.svd(triangle)[2][-1]
            weights = 1 / (found[above:] @ terms)
        return cls(found[:above] * unit, found[above:], middle, half)

    def depth(self, rays: Array, coordinate: Array) -> Array:
        """``(n,)`` z, mm, of rays ``(2, n)`` with coordinates ``(n,)``; NaN where these are."""
        terms = _terms(rays, (coordinate - self.middle) / self.half)
        return np.asarray((self.above @ terms[: len(self.above)]) / (self.below @ terms))


def _terms(rays: Array, scaled: Array) -> Array:
    """``(6, n)``; two by two 1 and X, of the ray's 1, x and y."""
    x, y = rays
    one = np.ones_like(scaled)
    return np.stack([one, scaled, x, x * scaled, y, y * scaled])


@dataclass(frozen=True, slots=True, eq=False)
class PixelPolynomials:
    """A polynomial from coordinate to depth at every camera pixel.

    Attributes
    ----------
    coefficients
        ``(3, H, W)`` mm, of powers of the coordinate less `middle` over `half`; NaN at pixels
        that fewer than four points fell on, or points of one coordinate.
    middle
        ``(H, W)`` projector px.
    half
        Projector px.
    """

    coefficients: Array
    middle: Array
    half: float

    @classmethod
    def fit(
        cls, pixels: NDArray[np.intp], coordinate: Array, depth: Array, *, shape: tuple[int, int]
    ) -> PixelPolynomials:
        """Least squares at each pixel by itself.

        Parameters
        ----------
        pixels
            ``(2, n)`` column and row of each point.
        coordinate, depth
            ``(n,)`` projector px and mm.
        shape
            Height and width of the camera's image.
        """
        size = shape[0] * shape[1]
        at = pixels[1] * shape[1] + pixels[0]
        count = np.bincount(at, minlength=size)
        with np.errstate(invalid="ignore"):
            middle = np.bincount(at, coordinate, size) / count
        half = max(float(np.ptp(coordinate)) / 2, 1.0)
        scaled = (coordinate - middle[at]) / half
        powers = [np.bincount(at, scaled**k, size) for k in range(2 * DEGREE + 1)]
        pulls = [np.bincount(at, depth * scaled**k, size) for k in range(DEGREE + 1)]
        normal = np.stack([np.stack(powers[k : k + DEGREE + 1], -1) for k in range(DEGREE + 1)], -1)
        known = (count > DEGREE + 1) & (np.linalg.matrix_rank(normal, hermitian=True) > DEGREE)
        found = np.full((size, DEGREE + 1), np.nan)
        pull = np.stack(pulls, -1)[known]
        found[known] = np.linalg.solve(normal[known], pull[..., None])[..., 0]
        return cls(found.T.reshape(-1, *shape), middle.reshape(shape), half)

    def depth(self, coordinate: NDArray[np.floating]) -> Array:
        """``(H, W)`` z, mm, of coordinates ``(H, W)``; NaN where these are, or nothing is known."""
        scaled = (coordinate - self.middle) / self.half
        out = np.zeros_like(scaled, dtype=np.float64)
        for coefficient in self.coefficients[::-1]:
            out = out * scaled + coefficient
        return out
