"""Levenberg-Marquardt with Huber's loss on normal equations that are summed block by block.

In a bundle a view's residuals depend on the shared parameters and on its own pose alone, so that
the blocks are small; a form is one block. `scipy.optimize.least_squares` finds the same minimum by
a singular value decomposition of the whole Jacobian at every step, ten times slower for 25 views.
The inverse of the normal matrix is the covariance of the parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Block: TypeAlias = tuple[Array, Array, NDArray[np.intp]]
"""Residuals ``(m,)`` in standard deviations, their Jacobian ``(m, k)``, and which of the
parameters its columns belong to ``(k,)``."""

Model: TypeAlias = Callable[[Array], Iterable[Block]]
"""The blocks at parameters ``(n,)``."""

MOST_STEPS = 300
_STEP = 1e-6
_GAIN = 1e-12
_HIDDEN_DROP = 1e-6
"""Where no step gains any more, the gradient is believed if Newton's step promises less."""

FIRST_DAMPING = 1e-3
NEAR_DAMPING = 1e-9
"""The first step's where the start is all but the minimum: Newton's step, and if that is worse the
damping grows faster with every try."""
_MOST_DAMPING = 1e12
_HARDLY_ANY = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """Where the loss is least, as far as it `converged`: parameters ``(n,)``.

    `normal` ``(n, n)`` is the matrix whose inverse is their covariance.
    """

    parameters: Array
    converged: bool
    normal: Array


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """Parameters with their loss, its gradient ``(n,)`` and normal matrix ``(n, n)``."""

    parameters: Array
    loss: float
    gradient: Array
    normal: Array


Evaluate: TypeAlias = Callable[[Array], Point]
"""What `descend` asks for at parameters ``(n,)``."""


def minimise(
    model: Model,
    start: Array,
    *,
    huber: float = math.inf,
    steps: int = MOST_STEPS,
    damping: float = FIRST_DAMPING,
) -> Minimum:
    """Least sum of Huber losses of the residuals, beyond `huber` linear; without it, of squares."""
    return descend(
        lambda parameters: _evaluate(model, parameters, huber),
        start,
        steps=steps,
        damping=damping,
    )


def descend(
    evaluate: Evaluate,
    start: Array,
    *,
    steps: int = MOST_STEPS,
    damping: float = FIRST_DAMPING,
) -> Minimum:
    """Where a loss that is a sum of squares, or nearly, is least; `damping` is the first step's.

    It ends where Newton's step would move the residuals by less than 1e-6 standard deviations in
    all, or lower the loss by less than 1e-12 of it, or where rounding hides any gain. Not
    converged: so many `steps` were not enough, or nothing lowers the loss though the gradient says
    so.
    """
    point = evaluate(start)
    growth = 2.0
    for _ in range(steps):
        if growth == 2.0 and _settled(point):
            return Minimum(point.parameters, True, point.normal)
        step = _damped_step(point, damping)
        expected = -float(step @ point.gradient) - 0.5 * float(step @ point.normal @ step)
        trial = evaluate(point.parameters + step)
        gained = point.loss - trial.loss
        if gained > 0:
            damping *= max(1 / 3, 1 - (2 * gained / expected - 1) ** 3)
            point, growth = trial, 2.0
        else:  # not a number counts as worse
            damping, growth = damping * growth, growth * 2
            if damping > _MOST_DAMPING:
                return Minimum(point.parameters, _drop(point) < _HIDDEN_DROP, point.normal)
    return Minimum(point.parameters, False, point.normal)


def _settled(point: Point) -> bool:
    drop = _drop(point)
    return drop < _STEP**2 or drop / 2 < _GAIN * point.loss


def _drop(point: Point) -> float:
    """Square of how far Newton's step moves the residuals: twice what it lowers the loss by."""
    return -float(_damped_step(point, _HARDLY_ANY) @ point.gradient)


def _scale(point: Point) -> Array:
    return np.sqrt(np.maximum(np.diag(point.normal), 1e-300))


def _damped_step(point: Point, damping: float) -> Array:
    """Marquardt's step, solved with the parameters scaled to a normal matrix of unit diagonal."""
    scale = _scale(point)
    matrix = point.normal / np.outer(scale, scale)
    matrix[np.diag_indices_from(matrix)] += damping
    try:
        return np.asarray(-np.linalg.solve(matrix, point.gradient / scale) / scale)
    except np.linalg.LinAlgError:
        return np.full_like(scale, np.nan)


def _evaluate(model: Model, parameters: Array, huber: float) -> Point:
    loss = 0.0
    gradient = np.zeros(len(parameters))
    normal = np.zeros((len(parameters), len(parameters)))
    for residuals, jacobian, columns in model(parameters):
        size = np.abs(residuals)
        far = size > huber
        loss += float(np.sum(np.where(far, huber * (size - huber / 2), size**2 / 2)))
        weights = np.ones_like(size)
        weights[far] = huber / size[far]
        weighted = jacobian * weights[:, None]
        gradient[columns] += weighted.T @ residuals
        # einsum, since BLAS would wake all its threads for each of these small products
        normal[np.ix_(columns, columns)] += np.einsum("ij,ik->jk", weighted, jacobian)
    return Point(parameters, loss, gradient, normal)
