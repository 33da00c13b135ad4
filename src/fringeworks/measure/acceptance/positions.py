"""One position of an artefact: what was measured on it, and why it may not count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.geometry.forms import PlaneFit, SphereFit, fit_plane, fit_sphere
from fringeworks.measure.acceptance.artefacts import CalibratedLength, Form, Warmth
from fringeworks.measure.acceptance.everyday import Planarity, find_planarity
from fringeworks.measure.acceptance.extremes import rms_range
from fringeworks.measure.acceptance.rectangle import rectangle_of
from fringeworks.measure.acceptance.trimming import MOST_PER_MILLE, Trimmed, fit_trimmed
from fringeworks.measure.region import Region, chosen_pixels, select_points
from fringeworks.model import Cloud

LEAST_POINTS = 1000
LEAST_CAP_DEG = 90.0
CAP_PERCENT = 99.0
"""Of the points that a cap's angle holds: a few astray do not make a cap wide."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """How points lie about the form fitted to them, mm.

    Attributes
    ----------
    rms_mm, band95_mm
        Root mean square, per degree of freedom, and the width that holds 95 % (the manner of
        ISO 10360-13): both stay as they are where points become more.
    range_mm
        Largest less smallest deviation: what PF and F are.
    noise_range_mm
        The range that as many independent normal deviations of this rms have on average.
    points, left_out
        Used, and left out as the farthest.
    """

    rms_mm: float
    band95_mm: float
    range_mm: float
    noise_range_mm: float
    points: int
    left_out: int

    @classmethod
    def of(cls, trimmed: Trimmed[PlaneFit] | Trimmed[SphereFit]) -> Surface:
        fit, out = trimmed.fit, trimmed.left_out
        rms = fit.form_rms_mm
        return cls(
            rms_mm=rms,
            band95_mm=fit.band95_mm,
            range_mm=float(np.ptp(fit.deviations_mm)),
            noise_range_mm=rms_range(rms, len(trimmed.stay), out),
            points=len(fit.deviations_mm),
            left_out=out,
        )


@dataclass(frozen=True, slots=True, eq=False)
class BallFound:
    """A ball at one position: PF is its surface's range, PS fitted less calibrated diameter.

    Attributes
    ----------
    cap_deg
        Angle at the ball's centre over which it was seen.
    faults
        Why it does not count.
    """

    name: str
    centre_mm: Array
    diameter_mm: float
    ps_mm: float
    pf_u95_mm: float
    ps_u95_mm: float
    surface: Surface
    cap_deg: float
    faults: tuple[str, ...]

    @property
    def pf_mm(self) -> float:
        return self.surface.range_mm


@dataclass(frozen=True, slots=True, eq=False)
class BarFound:
    """A ball bar at one position: SD is the distance of its centres less the calibrated one."""

    name: str
    centres_mm: Array
    distance_mm: float
    sd_mm: float
    sd_u95_mm: float
    points: tuple[int, int]
    faults: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class FlatFound:
    """A flat at one position: F is its surface's range.

    Attributes
    ----------
    corners_mm
        ``(4, 3)`` of the least rectangle that holds its points.
    size_mm
        Longer and shorter side of that.
    """

    name: str
    corners_mm: Array
    size_mm: tuple[float, float]
    f_u95_mm: float
    surface: Surface
    planarity: Planarity
    faults: tuple[str, ...]

    @property
    def f_mm(self) -> float:
        return self.surface.range_mm


def measure_ball(
    points: Array,
    ball: CalibratedLength,
    *,
    form: Form,
    warmth: Warmth,
    name: str,
    trim_per_mille: float = MOST_PER_MILLE,
) -> BallFound:
    """PF and PS of points ``(n, 3)``, mm, on a ball of calibrated diameter.

    Centre and radius are free, all points count alike.

    Raises
    ------
    MeasurementError
        The points are no ball: see `fit_sphere`.
    """
    trimmed = fit_trimmed(points, fit_sphere, per_mille=trim_per_mille)
    fit, cap = trimmed.fit, cap_angle(points[trimmed.stay], trimmed.fit.centre_mm)
    return BallFound(
        name=name,
        centre_mm=fit.centre_mm,
        diameter_mm=2 * fit.radius_mm,
        ps_mm=2 * fit.radius_mm - ball.at(warmth),
        pf_u95_mm=form.test_u95_mm,
        ps_u95_mm=ball.u95_at(warmth),
        surface=Surface.of(trimmed),
        cap_deg=cap,
        faults=_ball_faults(len(points), cap),
    )


def measure_bar(
    ends: tuple[Array, Array],
    bar: CalibratedLength,
    *,
    warmth: Warmth,
    name: str,
    trim_per_mille: float = MOST_PER_MILLE,
) -> BarFound:
    """SD of the points ``(n, 3)``, mm, on both balls of a bar; fails as `measure_ball`."""
    found = [fit_trimmed(points, fit_sphere, per_mille=trim_per_mille) for points in ends]
    centres = np.array([one.fit.centre_mm for one in found])
    distance = float(np.linalg.norm(centres[1] - centres[0]))
    faults = [
        f"ball {place}: {fault}"
        for place, (points, one) in enumerate(zip(ends, found, strict=True), start=1)
        for fault in _ball_faults(len(points), cap_angle(points[one.stay], one.fit.centre_mm))
    ]
    return BarFound(
        name=name,
        centres_mm=centres,
        distance_mm=distance,
        sd_mm=distance - bar.at(warmth),
        sd_u95_mm=bar.u95_at(warmth),
        points=(len(ends[0]), len(ends[1])),
        faults=tuple(faults),
    )


def measure_flat(
    cloud: Cloud,
    region: Region,
    *,
    flat: Form,
    name: str,
    trim_per_mille: float = MOST_PER_MILLE,
) -> FlatFound:
    """F, and how flat in everyday words, of a region of a cloud.

    Raises
    ------
    MeasurementError
        The region has no point, or its points no plane.
    """
    points = select_points(cloud, region)
    trimmed = fit_trimmed(points, fit_plane, per_mille=trim_per_mille)
    stay = chosen_pixels(cloud, region)
    stay[stay] = trimmed.stay
    corners = rectangle_of(points[trimmed.stay])
    sides = [float(np.linalg.norm(corners[i + 1] - corners[i])) for i in (0, 1)]
    return FlatFound(
        name=name,
        corners_mm=corners,
        size_mm=(sides[0], sides[1]),
        f_u95_mm=flat.test_u95_mm,
        surface=Surface.of(trimmed),
        planarity=find_planarity(cloud.xyz, stay, trimmed.fit, corners=corners),
        faults=_few(len(points)),
    )


def cap_angle(points: Array, centre: Array) -> float:
    """Angle at the centre, degrees, of the cone about the mean direction that holds 99 %."""
    directions = points - centre
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    mean = directions.mean(axis=0)
    towards = directions @ (mean / max(float(np.linalg.norm(mean)), 1e-12))
    half = np.percentile(np.degrees(np.arccos(np.clip(towards, -1, 1))), CAP_PERCENT)
    return float(2 * half)


def _ball_faults(points: int, cap_deg: float) -> tuple[str, ...]:
    narrow = f"seen over {cap_deg:.0f} degrees, at least {LEAST_CAP_DEG:.0f} are needed"
    return (*_few(points), *([narrow] if cap_deg < LEAST_CAP_DEG else []))


def _few(points: int) -> tuple[str, ...]:
    few = f"{points} points, at least {LEAST_POINTS} are needed"
    return (few,) if points < LEAST_POINTS else ()
