"""The fit of the paper's ten parameters (its equation 8), on the planes of a calibration.

The sum of squares of ``z of the plane - z of the model`` is least, by Levenberg-Marquardt on normal
equations summed in one pass over the points. The ten are not independent (`degeneracy`): a plain
fit of all drifts along what it cannot see. So the fit is a maximum a posteriori one, each parameter
having a Gaussian prior of the size that calibrations err by; or the paper's, of the six parameters
that it found to be other than zero, without priors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.calibrate.extended.degeneracy import Degeneracy, expand, find_degeneracy
from fringeworks.calibrate.extended.planes import PlanePoints
from fringeworks.errors import CalibrationError, ShapeError, UsageError
from fringeworks.geometry.minimise import Minimum, Point, descend
from fringeworks.kernels.normal_equations import COLUMNS, sum_normal_equations, sum_squares
from fringeworks.kernels.paper_model import paper_depths
from fringeworks.model import Axis, Extended, Rig
from fringeworks.reconstruct.geometric import equation_of

Array = NDArray[np.float64]
Mode: TypeAlias = Literal["map", "paper"]

PRIORS: Mapping[str, float] = MappingProxyType(
    {
        "C1": 1.0,
        "C2": 1.0,
        "C3": 2e-3,
        "C4": 2e-3,
        "Kfp": 5.0,
        "Kphi": 0.3,
        "Ku0": 5.0,
        "Kv0": 5.0,
        "Kfc": 5.0,
        "Kz": 1.0,
    }
)
"""Standard deviations about zero, in the parameters' units: what a calibration may err by."""

PAPER_FREE = ("C1", "C2", "Kphi", "Ku0", "Kfc", "Kz")
"""Those that the paper reports as other than zero."""

LEAST_POINTS = 30
ROUNDS = 4
"""Fits in which the noise is found; it settles in two."""

ALIKE_COUNTED = 0.5
"""How far the fit believes that neighbours err alike. Were it all of it, the ten would stay too far
from what the priors do not expect, at both ends of the paper's range; none of it, a million pixels
would say so much that the priors said nothing. Chosen by ``fringeworks bench extended``."""

SETTLED = 0.01
LAST_STEPS, HIDDEN = 5, 3e-8
"""How many more steps, at most, and how far, in standard deviations, the last of them goes."""

FIRST_DAMPING = 1e-12
"""The depth is nearly linear in the ten: Newton's step is right from the start, or soon damped."""


@dataclass(frozen=True, slots=True, eq=False)
class ExtendedFit:
    """What a fit has found.

    Attributes
    ----------
    extended
        The ten; those that were not free are zero.
    mode
        "map" with priors, "paper" six parameters without.
    free
        Names of those fitted.
    sigma, prior
        By name of those fitted: standard deviation after the fit and before; infinite before in
        paper mode. After it, neighbours that err alike count once.
    effective_dof
        How many of them the points determine rather than the priors: the trace of
        ``H (H + P)^-1``.
    degeneracy
        Of all ten on these planes, whatever was free.
    rms_before_mm, rms_mm
        Of the depth, over all points, with all ten zero and with those found.
    noise_mm
        Standard deviation of one point in `sigma`: neighbours err alike, so that it is larger than
        what the fit leaves.
    points, planes
        How many.
    """

    extended: Extended
    mode: Mode
    free: tuple[str, ...]
    sigma: Mapping[str, float]
    prior: Mapping[str, float]
    effective_dof: float
    degeneracy: Degeneracy
    rms_before_mm: float
    rms_mm: float
    noise_mm: float
    points: int
    planes: int


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Points with weights of mean one, and which parameters are free with what priors."""

    points: PlanePoints
    rig: Rig
    start: Extended
    weights: Array
    free: NDArray[np.intp]
    precision: Array

    def extended(self, free: Array) -> Extended:
        ten = np.zeros(len(Extended.NAMES))
        ten[self.free] = free
        return Extended.from_vector(ten, axis=self.start.axis, period_px=self.start.period_px)

    def evaluate(self, free: Array, noise_mm: float) -> Point:
        """Half the sum of squares in standard deviations, priors with it."""
        squares, gradient, normal = self.sums(free)
        information = 1 / noise_mm**2
        pull = self.precision * free
        return Point(
            parameters=free,
            loss=0.5 * (squares * information + float(pull @ free)),
            gradient=gradient * information + pull,
            normal=normal * information + np.diag(self.precision),
        )

    def scores(self, free: Array) -> Array:
        """``(n,)`` residuals, mm, times the roots of their weights."""
        points, equation = self.points, equation_of(self.rig, self.extended(free))
        depth, _ = paper_depths(points.rays, points.coordinate, equation)
        return np.asarray((points.depth - depth) * np.sqrt(self.weights))

    def sums(self, free: Array) -> tuple[float, Array, Array]:
        """Sum of squares, mm^2, half its gradient, and its normal matrix, of the free ones."""
        equation = equation_of(self.rig, self.extended(free))
        points, size = self.points, len(COLUMNS)
        lower = sum_normal_equations(
            points.rays, points.coordinate, points.depth, self.weights, equation
        )
        spread = expand(equation)[:, self.free]
        inner = lower[:size, :size] + np.tril(lower[:size, :size], -1).T
        gradient = -spread.T @ lower[size, :size]
        return float(lower[size, size]), gradient, spread.T @ inner @ spread


def fit_extended(
    points: PlanePoints,
    rig: Rig,
    *,
    axis: Axis,
    period_px: float,
    mode: Mode = "map",
    weighted: bool = False,
    noise_mm: float | None = None,
) -> ExtendedFit:
    """Fit the extended parameters of a rig.

    Parameters
    ----------
    points
        On planes of a calibration with this rig, of fringes of `period_px` along `axis`.
    mode
        "map" or "paper", see `ExtendedFit`.
    weighted
        Weigh points by 1 / sigma^2 of the depth that their coordinates' sigma gives; else all
        count the same, as in the paper.
    noise_mm
        Standard deviation of one point's depth (of an average one, where weighted); by default
        what the fit itself leaves, see `ALIKE_COUNTED`.

    Raises
    ------
    ShapeError
        Fewer than 30 points, or not all finite.
    UsageError
        No such mode.
    CalibrationError
        The fit does not settle.
    """
    _check(points, mode)
    start = Extended(axis, period_px)
    names = Extended.NAMES if mode == "map" else PAPER_FREE
    free = np.array([Extended.NAMES.index(name) for name in names])
    prior = {name: PRIORS[name] if mode == "map" else np.inf for name in names}
    problem = _Problem(
        points,
        rig,
        start,
        _weights(points, rig, start) if weighted else np.ones(1),
        free,
        np.array([prior[name] ** -2.0 for name in names]),
    )
    found, noise = _fit(problem, noise_mm)
    prior_information = np.diag(problem.precision)
    data = found.normal - prior_information
    alone = noise_mm or _noise(problem, found.parameters, counted=1.0)
    covariance = np.linalg.inv(data * (noise / alone) ** 2 + prior_information)
    extended = problem.extended(found.parameters)
    return ExtendedFit(
        extended=extended,
        mode=mode,
        free=names,
        sigma=dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True)),
        prior=prior,
        effective_dof=float(np.trace(np.linalg.solve(found.normal, data))),
        degeneracy=find_degeneracy(
            points.rays, points.coordinate, equation_of(rig, extended), PRIORS
        ),
        rms_before_mm=_rms(points, rig, start),
        rms_mm=_rms(points, rig, extended),
        noise_mm=alone,
        points=len(points),
        planes=int(np.count_nonzero(np.bincount(points.plane))),
    )


def _check(points: PlanePoints, mode: str) -> None:
    if mode not in ("map", "paper"):
        raise UsageError(f"mode must be map or paper, got '{mode}'")
    if len(points) < LEAST_POINTS:
        raise ShapeError(f"points must be at least {LEAST_POINTS}, got {len(points)}")
    parts = (points.rays, points.coordinate, points.depth, points.sigma)
    if not all(np.isfinite(part).all() for part in parts):
        raise ShapeError("points must be finite: leave void ones out")


def _fit(problem: _Problem, noise_mm: float | None) -> tuple[Minimum, float]:
    """The minimum, and the noise that it was found with."""
    free = np.zeros(len(problem.free))
    noise = noise_mm or _noise(problem, free)
    for _ in range(1 if noise_mm else ROUNDS):
        found, last = _descend(problem, free, noise), noise
        free, noise = found.parameters, noise_mm or _noise(problem, found.parameters)
        if abs(noise / last - 1) < SETTLED:
            break
    return found, last


def _descend(problem: _Problem, free: Array, noise_mm: float) -> Minimum:
    """The minimum, and Newton's steps beyond its own rule until they move nothing any more."""
    found = descend(lambda at: problem.evaluate(at, noise_mm), free, damping=FIRST_DAMPING)
    free = found.parameters
    for _ in range(LAST_STEPS):
        last = problem.evaluate(free, noise_mm)
        step = _newton_step(last)
        free = free - step
        if float(step @ last.normal @ step) < HIDDEN**2:
            break
    if not (found.converged and np.isfinite(free).all()):
        raise CalibrationError(
            "the extended parameters do not settle: do the captures belong to this rig, and are "
            "their fringe orders right?"
        )
    return replace(found, parameters=free, normal=last.normal)


def _newton_step(point: Point) -> Array:
    try:
        return np.asarray(np.linalg.solve(point.normal, point.gradient), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.full_like(point.parameters, np.nan)


def _noise(problem: _Problem, free: Array, *, counted: float = ALIKE_COUNTED) -> float:
    """Standard deviation, mm, of one point as if all erred by themselves.

    Root mean square of the weighted residuals, times how far neighbours err alike, so far as that
    is counted.
    """
    scores = problem.scores(free)
    left = float(np.sqrt(np.sum(scores**2) / (len(scores) - len(free))))
    return left * max(1.0, counted * float(np.sqrt(problem.points.alike(scores))))


def _weights(points: PlanePoints, rig: Rig, start: Extended) -> Array:
    """``(n,)`` 1 / sigma_z^2 over its mean."""
    _, slope = paper_depths(points.rays, points.coordinate, equation_of(rig, start))
    weights = 1 / (slope * points.sigma) ** 2
    return np.asarray(weights / weights.mean())


def _rms(points: PlanePoints, rig: Rig, extended: Extended) -> float:
    equation = equation_of(rig, extended)
    squares = sum_squares(points.rays, points.coordinate, points.depth, equation)
    return float(np.sqrt(squares / len(points)))
