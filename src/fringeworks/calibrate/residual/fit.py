"""One polynomial through what a model leaves: weighted, robust, and held where nothing was seen.

Each coefficient is zero to within the residuals' own size before any site is looked at. Where
sites are many this says nothing; the terms that only the image's corners would tell of, where no
board was, it keeps from growing there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.local_fit import robust_scale, tukey_weights
from fringeworks.calibrate.residual.left import Left
from fringeworks.calibrate.sites import together
from fringeworks.kernels.residual import Polynomial, residuals_at
from fringeworks.model import Camera
from fringeworks.model.residual import Three, count_terms

Array = NDArray[np.float64]

ROUNDS = 4
"""Of reweighting."""

BOUND = 3.0
"""Scales at which a site is clipped, so that a wrong code does not speak for its neighbours."""


@dataclass(frozen=True, slots=True)
class Domain:
    """Where a field is fitted: `middle`, `low` and `high` of `ResidualField`.

    All of the camera's image, though boards seldom reach its corners: held at the outermost site,
    the pinhole's residuals were six times as large on a wall over the whole view.
    """

    middle: Three
    low: Three
    high: Three

    @classmethod
    def of(cls, left: Left, camera: Camera) -> Domain:
        """All its image, the plane nearest to the sites' coordinates, and as far off it as they."""
        u, v, coordinate = left.places.T
        image = np.column_stack([np.ones(len(left)), u, v])
        plane, *_ = np.linalg.lstsq(image, coordinate, rcond=None)
        off = coordinate - image @ plane
        low, high = float(off.min()), float(off.max())
        return cls(_three(plane), (0.0, 0.0, low), (camera.width - 1.0, camera.height - 1.0, high))

    def polynomial(self, order: int, coefficients: Array) -> Polynomial:
        return Polynomial(order, self.middle, self.low, self.high, coefficients)

    def design(self, places: Array, order: int) -> Array:
        """``(n, k)`` every term at places ``(n, 3)``."""
        terms = np.eye(count_terms(order))
        out = np.empty((len(terms), len(places)))
        for column, alone in zip(out, terms, strict=True):
            residuals_at(places, self.polynomial(order, alone), column)
        return np.ascontiguousarray(out.T)


@dataclass(frozen=True, slots=True, eq=False)
class PolynomialFit:
    """Coefficients ``(k,)``, px; what each site's square weighs, ``(n,)``, and each term's."""

    coefficients: Array
    weights: Array
    prior: float


def fit_polynomial(left: Left, design: Array) -> PolynomialFit:
    """Fit what is left by a design ``(n, k)``.

    By Tukey's biweight on residuals over their sigma; sites that err together, see
    `sites.together`, count as one.
    """
    sharp = 1 / left.sigma
    prior = robust_scale(left.residual) ** -2.0
    coefficients = np.zeros(design.shape[1])
    for _ in range(ROUNDS):
        score = (left.residual - design @ coefficients) * sharp
        scale = robust_scale(score)
        counts = scale**2 * _alike(score / scale, left)
        weights = tukey_weights(score, scale) * sharp**2 / counts
        normal, pull = _normal(left.residual, design, weights)
        coefficients = np.linalg.solve(normal + prior * np.eye(len(pull)), pull)
    return PolynomialFit(coefficients, weights, prior)


def fits_without(left: Left, design: Array, fit: PolynomialFit) -> Array:
    """``(views, k)`` coefficients without one view after the other, the weights as they are."""
    parts = []
    for view in np.unique(left.view):
        own = left.view == view
        parts.append(_normal(left.residual[own], design[own], fit.weights[own]))
    whole = sum(normal for normal, _ in parts) + fit.prior * np.eye(design.shape[1])
    pull = sum(pull for _, pull in parts)
    return np.array([np.linalg.solve(whole - normal, pull - own) for normal, own in parts])


def _normal(residual: Array, design: Array, weights: Array) -> tuple[Array, Array]:
    weighted = design * weights[:, None]
    return weighted.T @ design, weighted.T @ residual


def _alike(score: Array, left: Left) -> float:
    """How many neighbouring sites say as much as one."""
    clipped = np.clip(score, -BOUND, BOUND)[:, None]
    views = (left.view == view for view in range(left.view.max() + 1))
    seen = [together(clipped[view], left.places[view, :2]) for view in views if view.any()]
    return max(float(np.mean(seen)), 1.0)


def _three(values: Array) -> Three:
    a, b, c = values.tolist()
    return a, b, c
