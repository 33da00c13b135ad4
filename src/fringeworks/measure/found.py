"""Which forms a cloud shows: planes, spheres, cylinders and cones, found one after the other.

A random search on a sample (`measure.form_search`) finds the form that most points agree with; what
a simpler form fits about as well is the simpler form. Its points are taken away, and the search
goes on until what is left holds no form large enough. Every point of the cloud then belongs to the
form that it lies on and that its neighbours in the sample belong to, and the forms are fitted to
all of their points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import MeasurementError, UsageError
from fringeworks.geometry.forms.named import FITS, FormFit, FormName, Shape, name_of, shape_of
from fringeworks.geometry.forms.search import spread_indices
from fringeworks.geometry.neighbours import local_planes, tree_of
from fringeworks.measure.form_search import Sample, orient, search
from fringeworks.measure.region import Region, chosen_pixels, select_points
from fringeworks.model import Cloud

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Places = NDArray[np.intp]

SAMPLE = 12_000
"""Points that the search looks at."""

NOISE_NEIGHBOURS = 25
TOLERANCE_NOISES = 4.0
"""Distance within which a point lies on a form, in standard deviations of the local noise."""

COARSE = 2.0
"""So many times the local noise, a cloud's own sigma is believed instead: steps of a Gray code are
as wide as neighbourhoods, and each looks smooth."""

NOISY_QUANTILE, NOISIEST = 0.9, 1.5
"""Noise is at most so many times that of nine tenths of the points: more is an edge or a crease."""

LEAST_POINTS = 100
ALLOWING, ASSIGNMENTS = 3, 2
"""A point may belong to the forms of so many nearest points of the sample; so often forms are
fitted and points assigned."""


@dataclass(frozen=True, slots=True)
class SearchRules:
    """What counts as a form.

    Attributes
    ----------
    tolerance_mm
        How far its points may lie from it; None takes four times the noise.
    least_share
        Of all points, what a form must hold to be one.
    names
        Which forms are looked for.
    most
        The search ends with so many forms; None goes on.

    Raises
    ------
    UsageError
        A tolerance that is not positive, a share outside (0, 1].
    """

    tolerance_mm: float | None = None
    least_share: float = 0.03
    names: tuple[FormName, ...] = tuple(FITS)
    most: int | None = None

    def __post_init__(self) -> None:
        if self.tolerance_mm is not None and not 0 < self.tolerance_mm < np.inf:
            raise UsageError(f"tolerance_mm must be positive, got {self.tolerance_mm:g}")
        if not 0 < self.least_share <= 1:
            raise UsageError(f"least_share must be in (0, 1], got {self.least_share:g}")


@dataclass(frozen=True, slots=True)
class FoundForm:
    """One form of a cloud and which points ``(n,)`` lie on it."""

    fit: FormFit
    members: Mask

    @property
    def name(self) -> FormName:
        return name_of(self.fit)

    @property
    def share(self) -> float:
        """Of all points, those that lie on it."""
        return float(np.mean(self.members))


@dataclass(frozen=True, slots=True)
class FoundForms:
    """The forms of a cloud, the one with most points first.

    Attributes
    ----------
    noise_mm
        Scatter of the points about planes through few neighbours, its median, or their own sigma
        where that is far larger: what no form explains.
    tolerance_mm
        How far a form's points may lie from it, where the noise is `noise_mm`.
    """

    forms: tuple[FoundForm, ...]
    noise_mm: float
    tolerance_mm: float

    @property
    def labels(self) -> Places:
        """``(n,)`` place of each point's form in `forms`; -1 of points that lie on none."""
        every = np.stack([form.members for form in self.forms])
        return np.where(every.any(axis=0), np.argmax(every, axis=0), -1)


def find_forms(
    points: Array,
    *,
    rules: SearchRules | None = None,
    sigma_mm: Array | None = None,
    rng: np.random.Generator,
) -> FoundForms:
    """The planes, spheres, cylinders and cones that points ``(n, 3)``, mm, lie on.

    Where the points' sigma ``(n,)``, mm, NaN where unknown, is given and beyond twice the local
    noise in the median, it is the noise.

    Raises
    ------
    MeasurementError
        Fewer than 100 points, some of them not finite, all of them one, or no form among them.
    """
    rules = rules or SearchRules()
    _check(points)
    least = max(rules.least_share, LEAST_POINTS / len(points))
    seen = spread_indices(len(points), SAMPLE)
    noises = noise_at(points[seen], points)
    if sigma_mm is not None:
        noises = _believed(noises, sigma_mm[seen])
    noise = float(np.median(noises))
    sample = _sample_of(points[seen], noises, rules, least * len(seen))
    tolerance = rules.tolerance_mm or TOLERANCE_NOISES * noise
    pieces = list(islice(search(sample, rng), rules.most))
    kept = [form for form in _fit_all(points, sample, pieces) if form.share >= least]
    if not kept:
        raise MeasurementError(
            f"no form ({', '.join(rules.names)}) holds {least:.1%} of the {len(points)} points "
            f"well within {tolerance:.3g} mm: choose a box that holds little else, or allow "
            "a larger tolerance (measure auto)"
        )
    kept.sort(key=lambda form: -form.share)
    return FoundForms(tuple(kept), noise, tolerance)


def keep_largest(
    cloud: Cloud, region: Region, name: FormName, *, rng: np.random.Generator
) -> Cloud:
    """The cloud with nothing but the region's points on its largest plane, sphere...; others void.

    Raises
    ------
    MeasurementError
        As `find_forms`.
    """
    rules = SearchRules(names=(name,), most=1)
    chosen = chosen_pixels(cloud, region)
    found = find_forms(
        select_points(cloud, region),
        rules=rules,
        sigma_mm=cloud.sigma_mm[chosen].astype(np.float64),
        rng=rng,
    )
    kept = np.zeros(chosen.shape, dtype=np.bool_)
    kept[chosen] = found.forms[0].members
    return replace(cloud, xyz=np.where(kept[..., None], cloud.xyz, np.float32(np.nan)))


def _sample_of(seen: Array, noises: Array, rules: SearchRules, fewest: float) -> Sample:
    """What the search looks at: points ``(m, 3)`` with their noise ``(m,)``, mm."""
    normals, neighbours = orient(seen, float(np.median(noises)))
    reach = TOLERANCE_NOISES * np.median(noises[neighbours], axis=1)
    if rules.tolerance_mm is not None:
        reach = np.full(len(seen), rules.tolerance_mm)
    return Sample(seen, normals, neighbours, reach, fewest, rules.names)


def _believed(noises: Array, sigma: Array) -> Array:
    """Local noise, or the points' own sigma ``(m,)``, mm, where neighbours share their errors."""
    known = sigma > 0
    if not known.any() or np.median(sigma[known]) <= COARSE * np.median(noises):
        return noises
    most = NOISIEST * float(np.quantile(sigma[known], NOISY_QUANTILE))
    return np.fmax(noises, np.minimum(sigma, most))


def noise_at(seen: Array, points: Array) -> Array:
    """``(m,)`` rms distance of neighbours of `seen` ``(m, 3)`` among `points` from planes, mm."""
    _, rms = local_planes(seen, tree_of(points), count=NOISE_NEIGHBOURS)
    resolution = float(np.spacing(np.float32(np.abs(points).max())))  # what files keep
    most = NOISIEST * float(np.quantile(rms, NOISY_QUANTILE))
    return np.clip(rms, resolution, max(most, resolution))


def _check(points: Array) -> None:
    if len(points) < LEAST_POINTS:
        raise MeasurementError(
            f"a search for forms needs at least {LEAST_POINTS} points, got {len(points)}"
        )
    void = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
    if void:
        raise MeasurementError(
            f"{void} of the {len(points)} points are not finite: leave void points out"
        )
    if not np.ptp(points, axis=0).any():
        raise MeasurementError(f"the {len(points)} points are one point: no form is defined")


def _fit_all(points: Array, sample: Sample, pieces: list[tuple[Shape, Mask]]) -> list[FoundForm]:
    """The forms fitted to all of their points; a point lies on one form at most."""
    if not pieces:
        return []
    _, places = tree_of(sample.points).query(points, ALLOWING)
    near = np.asarray(places)
    allowed = np.stack([members[near].any(axis=1) for _, members in pieces])
    shapes = [shape for shape, _ in pieces]
    for _ in range(ASSIGNMENTS):
        label = _assign(shapes, points, np.where(allowed, sample.tolerance_mm[near[:, 0]], -1.0))
        fits = [FITS[shape.name](points[label == i]) for i, shape in enumerate(shapes)]
        shapes = [shape_of(fit) for fit in fits]
    return [FoundForm(fit, label == i) for i, fit in enumerate(fits)]


def _assign(shapes: list[Shape], points: Array, reach: Array) -> Places:
    """``(n,)`` the next of the forms within reach ``(forms, n)``, mm; -1 where none is."""
    distances = np.stack([np.abs(shape.distances(points)) for shape in shapes])
    distances[distances > reach] = np.inf
    nearest = np.argmin(distances, axis=0)
    return np.where(np.isfinite(distances.min(axis=0)), nearest, -1)
