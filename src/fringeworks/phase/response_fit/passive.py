"""The passive way: phases held against what is known to be true, or smooth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import DecodeError
from fringeworks.model import AXES, Capture, Fringe, ImageExponent, PhaseTerms
from fringeworks.phase.response import rms, wave_terms
from fringeworks.phase.response_fit.seen import (
    Seen,
    against,
    check_phases,
    coordinate_of,
    make_terms,
    sample,
    see_sets,
    solve_robustly,
)

Array: TypeAlias = NDArray[np.float64]

LARGEST_ERROR_RAD = 1.0
"""Beyond it a pixel's order or code is wrong."""

EXPONENTS = (0.05, 8.0)
DEGREE = 5
ROUGHEST_RAD = 0.15
"""Rms of what a smooth surface and the waves leave: of a wall it is noise."""

LEAST_FRINGES = 4.0
"""Periods that a plane must show: fewer, and its own shape is taken for a wave."""


def fit_terms(seen: Iterable[Seen]) -> tuple[PhaseTerms, ...]:
    """Terms of each set against its true phase; a constant error is none of theirs.

    Raises
    ------
    DecodeError
        Too few pixels or too little of a period, or terms that fold the phase over.
    """
    return tuple(_fit(one) for one in seen)


def _fit(seen: Seen) -> PhaseTerms:
    phase, error = _samples(seen)
    waves = wave_terms(phase, seen.fringe.frame_count)
    found, used = solve_robustly(np.column_stack([waves, np.ones(len(waves))]), error)
    terms = make_terms(seen, found[:-1])
    left = error - waves @ found[:-1]
    return replace(terms, before=rms(error[used]), after=rms(left[used]))


def _samples(seen: Seen) -> tuple[Array, Array]:
    error = seen.error()
    places = sample(np.abs(error) < LARGEST_ERROR_RAD, what=f"axis {seen.fringe.axis}")
    phase = seen.wrapped.phase.ravel()[places].astype(np.float64)
    check_phases(phase, seen.fringe)
    return phase, error.ravel()[places]


def see_by_plane(capture: Capture) -> Iterator[Seen]:
    """Sets of fringes against a polynomial of the pixel through their own coordinates.

    For a scene that is one smooth surface: a wall, a board. Polynomial and waves are fitted
    together, so that neither takes the other's part.

    Raises
    ------
    DecodeError
        An axis has no absolute phase, or the surface shows too few fringes.
    """
    for axis in AXES:
        sets = see_sets(capture, axis)
        if sets:
            coordinate = coordinate_of(capture, axis)
            for wrapped in sets:
                yield _smooth(against(wrapped, coordinate))


def _smooth(seen: Seen) -> Seen:
    """`seen` with its true phase by the smooth surface."""
    fringe = seen.fringe
    absolute = seen.true + seen.error()  # this set's own phase, in the order of the finest
    places = sample(np.isfinite(absolute), what=f"axis {fringe.axis}")
    values = absolute.ravel()[places]
    turns = float(np.ptp(np.percentile(values, [1, 99]))) / (2 * np.pi)
    if turns < LEAST_FRINGES:
        raise DecodeError(
            f"the plane shows {turns:.1f} fringes of {fringe.period_px:.4g} px along "
            f"{fringe.axis}, at least {LEAST_FRINGES:g} are needed: fill the image with it"
        )
    surface = _polynomial(places, absolute.shape)
    phase = seen.wrapped.phase.ravel()[places].astype(np.float64)
    waves = wave_terms(phase, fringe.frame_count)
    found, used = solve_robustly(design := np.column_stack([surface, waves]), values)
    left = rms((values - design @ found)[used])
    if left > ROUGHEST_RAD:
        raise DecodeError(
            f"{left:.2f} rad of the {fringe.period_px:.4g} px fringes along {fringe.axis} are "
            "neither a smooth surface nor waves of a response: is the scene one plane?"
        )
    true = np.full(absolute.size, np.nan, np.float32)
    true[places] = surface @ found[: surface.shape[1]]
    return replace(seen, true=true.reshape(absolute.shape))


def _polynomial(places: NDArray[np.intp], shape: tuple[int, ...]) -> Array:
    """Chebyshev terms up to a total degree at flat indices of an image."""
    height, width = shape
    rows, columns = np.divmod(places, width)
    y, x = 2 * rows / height - 1, 2 * columns / width - 1
    across, down = (np.polynomial.chebyshev.chebvander(v, DEGREE) for v in (x, y))
    return np.stack(
        [across[:, i] * down[:, j] for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)],
        axis=1,
    )


def fit_exponent(capture: Capture, seen: Iterable[Seen]) -> ImageExponent:
    """The exponent of the images that leaves the least phase error, over all sets together.

    Raises
    ------
    DecodeError
        Too few pixels or too little of a period.
    """
    from scipy.optimize import minimize_scalar

    samples = [(_sparse(capture, one), one) for one in seen]
    if not samples:
        raise DecodeError(f"{capture.name} has no fringes that a reference tells the phase of")

    def error(logarithm: float) -> float:
        exponent = float(np.exp(logarithm))
        return rms(np.concatenate([_error_at(few, one, exponent) for few, one in samples]))

    low, high = map(math.log, EXPONENTS)
    best = minimize_scalar(error, bounds=(low, high), method="bounded")
    return ImageExponent(float(np.exp(best.x)), error(0.0), float(best.fun))


def _sparse(capture: Capture, seen: Seen) -> tuple[Array, Array]:
    """Levels ``(N, n)`` of a set's frames above black, shares of full scale, and true phases."""
    good = np.abs(seen.error()) < LARGEST_ERROR_RAD
    places = sample(good, what=f"axis {seen.fringe.axis}")[::4]
    stack = next(frames for item, frames, _ in capture.find(Fringe) if item == seen.fringe)
    count = seen.fringe.frame_count
    means = stack.reshape(count, len(stack) // count, -1)[:, :, places].mean(axis=1)
    black = capture.sensor.black_level
    shares = np.maximum(means - black, 0) / (capture.sensor.full_scale - black)
    check_phases(seen.wrapped.phase.ravel()[places].astype(np.float64), seen.fringe)
    return shares, seen.true.ravel()[places].astype(np.float64)


def _error_at(few: tuple[Array, Array], seen: Seen, exponent: float) -> Array:
    shares, true = few
    shifts = np.array(seen.fringe.shifts_rad)
    basis = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    _, cosine, sine = np.linalg.pinv(basis) @ shares**exponent
    return np.asarray(np.angle((cosine + 1j * sine) * np.exp(-1j * true)))
