"""The random search behind `measure.found`: one form after the other, on a sample of points.

RANSAC (Fischler and Bolles 1981) with patches in the place of minimal sets: about a random point
its neighbours, few or many, give one guess of each form in closed form, and the guess that most
points agree with, in distance and in normal, is fitted to them by least squares.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError
from fringeworks.geometry.forms.named import (
    FITS,
    FormFit,
    FormName,
    Shape,
    guess_shape,
    shape_of,
)
from fringeworks.geometry.forms.search import spread_indices
from fringeworks.geometry.neighbours import local_planes, spacing_of, tree_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Places = NDArray[np.intp]

SLOPE_NOISE = 0.035
"""rad: neighbourhoods are made so large that normals are known to this."""

FEWEST_NEIGHBOURS, MOST_NEIGHBOURS = 16, 150
FACING = float(np.cos(np.deg2rad(20.0)))
"""A point's normal and its form's agree within 20 degrees."""

PATCHES = 250
SMALLEST_PATCH, LARGEST_PATCH = 40, 3_000
PATCH_POINTS = 200
"""Points of a patch, in the sample, and how many of them make its guesses."""

JUDGES = 1_500
FOLLOWED, ROUNDS = 2, 2
"""Points that vote on guesses; how many of each form's best guesses are fitted, and how often."""

FIT_POINTS = 1_000
TIGHT = 0.35
"""Of the tolerance, a form's rms distance at most: a quarter is noise, evenly spread is 0.58."""

SIMPLER = 1.1
"""A simpler form is taken if its rms distance is at most so many times the richer one's."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """What the search looks at, and what it looks for.

    Attributes
    ----------
    points, normals
        ``(n, 3)`` mm, and of length one; a normal's sign has no meaning.
    neighbours
        ``(n, k)`` places of the next points, the point itself first.
    tolerance_mm
        ``(n,)`` how far a point may lie from its form.
    fewest
        Points that make a form.
    names
        Which forms are looked for.
    """

    points: Array
    normals: Array
    neighbours: Places
    tolerance_mm: Array
    fewest: float
    names: tuple[FormName, ...]

    def agree(self, shape: Shape, places: Places) -> Places:
        """Those of the places whose points lie on a form in distance and in normal."""
        points = self.points[places]
        facing = np.einsum("ni,ni->n", shape.normals(points), self.normals[places])
        near = np.abs(shape.distances(points)) <= self.tolerance_mm[places]
        return np.asarray(places[near & (np.abs(facing) >= FACING)])

    def members(self, shape: Shape, free: Places) -> Mask:
        """``(n,)``: free points that agree with a form and most of whose neighbours do.

        Where a form cuts another one, a line of points agrees by chance: they have few such
        neighbours.
        """
        agree = np.zeros(len(self.points), dtype=np.bool_)
        agree[self.agree(shape, free)] = True
        return np.asarray(agree & (np.mean(agree[self.neighbours], axis=1) >= 0.5))


def orient(points: Array, noise: float) -> tuple[Array, Places]:
    """Normals ``(n, 3)`` and next neighbours ``(n, k)`` of points ``(n, 3)``.

    Normals come from as many neighbours as the noise, mm, asks for.
    """
    tree = tree_of(points)
    spacing = max(spacing_of(points, tree), 1e-300)
    # A slope from n points within r is known to 2 noise / (r sqrt n), n = pi (r / spacing)^2.
    wanted = 2 * np.sqrt(np.pi) * noise / (SLOPE_NOISE * spacing)
    count = int(np.clip(wanted, FEWEST_NEIGHBOURS, MOST_NEIGHBOURS))
    normals, _ = local_planes(points, tree, count=count)
    _, neighbours = tree.query(points, FEWEST_NEIGHBOURS)
    return normals, np.asarray(neighbours, dtype=np.intp)


def search(sample: Sample, rng: np.random.Generator) -> Iterator[tuple[Shape, Mask]]:
    """Forms and their points ``(n,)``, each among what those before it leave."""
    free = np.arange(len(sample.points))
    while len(free) >= max(sample.fewest, SMALLEST_PATCH):
        best = _best_shape(sample, free, rng)
        if best is None:
            return
        members = sample.members(best, free)
        if np.count_nonzero(members) < sample.fewest:
            return
        yield best, members
        free = free[~members[free]]


def _best_shape(sample: Sample, free: Places, rng: np.random.Generator) -> Shape | None:
    """The form that most free points agree with, the simplest that fits them."""
    judges = rng.permutation(free)[:JUDGES]
    guesses = sorted(
        _guesses(sample, free, rng), key=lambda shape: -len(sample.agree(shape, judges))
    )
    followed = [
        guess
        for name in sample.names
        for guess in [one for one in guesses if one.name == name][:FOLLOWED]
    ]
    refined = [_refined(guess, sample, free) for guess in followed]
    reached = [agreed for agreed in refined if agreed is not None]
    if not reached:
        return None
    shape, members = max(reached, key=lambda agreed: len(agreed[1]))
    return _simplest(shape, sample.points[members], sample.names)


def _guesses(sample: Sample, free: Places, rng: np.random.Generator) -> Iterator[Shape]:
    """Forms through patches of the free points."""
    tree = tree_of(sample.points[free])
    largest = min(LARGEST_PATCH, len(free))
    for _ in range(PATCHES):
        seed = sample.points[rng.choice(free)]
        size = int(np.exp(rng.uniform(np.log(min(SMALLEST_PATCH, largest)), np.log(largest))))
        _, near = tree.query(seed, size)
        patch = free[rng.permutation(near)[:PATCH_POINTS]]
        normals = sample.normals[patch]
        # A patch looks one way on the whole, so that its normals' signs can be agreed on.
        turned = normals * np.where(normals @ normals[0] < 0, -1.0, 1.0)[:, None]
        for shape in _guess_all(sample.points[patch], turned):
            if shape.name in sample.names:
                yield shape


def _guess_all(points: Array, normals: Array) -> Iterator[Shape]:
    """A patch's forms, each only if no simpler one fits the patch about as well."""
    best = np.inf
    for name in FITS:
        shape = guess_shape(name, points, normals)
        rms = np.inf if shape is None else _rms(shape, points)
        if shape is not None and SIMPLER * rms < best:
            yield shape
        best = min(best, rms)


def _refined(shape: Shape, sample: Sample, free: Places) -> tuple[Shape, Places] | None:
    """The form fitted to the free points that agree with it, and those that do in the end.

    None where they define no form, or fill the tolerance: they belong to something else, of which
    every patch is nearly such a form.
    """
    members = sample.agree(shape, free)
    for _ in range(ROUNDS):
        fit = _try_fit(shape.name, sample.points[members])
        if fit is None:
            return None
        shape = shape_of(fit)
        members = sample.agree(shape, free)
    if not len(members):
        return None
    filled = shape.distances(sample.points[members]) / sample.tolerance_mm[members]
    return (shape, members) if np.sqrt(np.mean(filled**2)) <= TIGHT else None


def _rms(shape: Shape, points: Array) -> float:
    return float(np.sqrt(np.mean(shape.distances(points) ** 2)))


def _try_fit(name: FormName, points: Array) -> FormFit | None:
    """The fit to a spread of points ``(n, 3)``; None where they do not define it."""
    try:
        return FITS[name](points[spread_indices(len(points), FIT_POINTS)])
    except MeasurementError:
        return None


def _simplest(shape: Shape, points: Array, names: tuple[FormName, ...]) -> Shape:
    """The simplest form that fits a form's points ``(n, 3)`` about as well as it does."""
    most = SIMPLER * _rms(shape, points)
    for name in FITS:
        if name == shape.name:
            break
        fit = _try_fit(name, points) if name in names else None
        if fit is not None and fit.form_rms_mm <= most:
            return shape_of(fit)
    return shape
