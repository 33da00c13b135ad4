"""Fits that search for their start: among many on a sample, the best of them on all points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.minimise import MOST_STEPS

Array = NDArray[np.float64]

SAMPLE = 1000
"""Points that the search looks at; all of them make the fit."""

LARGE_SAMPLE = 30_000
LAST_STEPS = 20
"""From the form through the large sample to that through all points. Other forms, as spheres of a
cylinder, give the fit a valley to wander in: on the sample that shows within seconds."""

_GOLDEN = (np.sqrt(5) - 1) / 2


class Surface(Protocol):
    """What has signed distances ``(n,)`` of points ``(n, 3)``."""

    def distances(self, points: Array) -> Array: ...


Found = TypeVar("Found", bound=Surface)


class Refine(Protocol[Found]):
    """The form of least squared weighted distances next to a start; None if none is reached."""

    def __call__(
        self, start: Found, points: Array, weights: Array, *, steps: int = MOST_STEPS
    ) -> Found | None: ...


def fit_in_stages(
    points: Array,
    weights: Array,
    *,
    search: Callable[[Array], Sequence[Found]],
    refine: Refine[Found],
) -> Found | None:
    """The form through points ``(n, 3)``: by a sample, a large sample, then all of them.

    Parameters
    ----------
    search
        Starts for a sample of the points.
    """
    chosen = spread_indices(len(points), SAMPLE)
    start = _best(search(points[chosen]), points[chosen], weights[chosen], refine=refine)
    if start is None:
        return None
    chosen = spread_indices(len(points), LARGE_SAMPLE)
    near = refine(start, points[chosen], weights[chosen])
    return None if near is None else refine(near, points, weights, steps=LAST_STEPS)


def _best(
    starts: Sequence[Found], points: Array, weights: Array, *, refine: Refine[Found]
) -> Found | None:
    """The best form that is reached from any of the starts."""
    refined = [refine(start, points, weights) for start in starts]
    reached = [surface for surface in refined if surface is not None]

    def loss(surface: Found) -> float:
        return float(np.sum((surface.distances(points) * weights) ** 2))

    return min(reached, key=loss, default=None)


def spread_indices(count: int, wanted: int) -> NDArray[np.intp]:
    """At most `wanted` of `count` indices, evenly but without a period that a grid could share."""
    if count <= wanted:
        return np.arange(count)
    places = count * np.mod(np.arange(wanted) * _GOLDEN, 1)
    return np.asarray(places, dtype=np.intp)


def half_sphere(count: int) -> Array:
    """``(count, 3)`` unit vectors spread over the half with z > 0, on Fibonacci's spiral."""
    z = (np.arange(count) + 0.5) / count
    angle = 2 * np.pi * _GOLDEN * np.arange(count)
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)
