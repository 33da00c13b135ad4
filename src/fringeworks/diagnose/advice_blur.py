"""The blur of projector and camera together, and the period at which phase noise is least.

A Gaussian blur of s projector px (1 sd) leaves fringes of period p the modulation
``B(p) = B0 exp(-2 pi^2 s^2 / p^2)``. A coordinate's noise ``p / (2 pi) sqrt(2 / N) sigma_I / B(p)``
goes as ``p exp(2 pi^2 s^2 / p^2)``, whose logarithm has the slope ``1/p - 4 pi^2 s^2 / p^3``: it is
least at ``p = 2 pi s``, where B is exp(-1/2) of B0. Two periods give s, as
``s^2 = log(B1 / B2) / (2 pi^2 (1/p2^2 - 1/p1^2))``; s holds the pixels' own width too, for
``sinc(1/p)`` is to fourth order a Gaussian of variance 1/12.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fringeworks.diagnose.look import Look
from fringeworks.model import AXES, Axis, Capture, FloatMap

LEAST_TRANSFER = 0.12
"""Fainter fringes are measured by their noise; coarser ones tell the blur then."""

MOST_TRANSFER, LONGEST_PX = 0.95, 40.0
"""Fringes that lose less, or are longer, tell no blur: gamma under three steps and light that
bounces change their modulation by some percent too."""

STEADY_RATIO = 1.3
"""Two periods must differ by this factor to tell a blur."""

SHORTEST_PX = 4.0
"""Even periods from here on are proposed: their Gray code's half cells are two pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Blur:
    """What fringes along one axis lose.

    Attributes
    ----------
    axis
        Along which the phase runs.
    sigma_px
        Standard deviation of the point spread of both devices, projector px: the median.
    low_px, high_px
        The tenth and the ninetieth percentile over the image.
    transfer
        Modulation of the fringes of `period_px` over that of the coarser light: the median.
    period_px
        Whose modulation told.
    against
        What it was compared with.
    picture
        ``(H, W)`` sigma, projector px; NaN where it is not known.
    """

    axis: Axis
    sigma_px: float
    low_px: float
    high_px: float
    transfer: float
    period_px: float
    against: str
    picture: FloatMap

    @property
    def best_period_px(self) -> float:
        """Where noise is least: ``2 pi s``."""
        return 2 * math.pi * self.sigma_px


@dataclass(frozen=True, slots=True, eq=False)
class Ratio:
    """Modulation ``(H, W)`` over that of coarser light, NaN outside what both see."""

    fringes: Look
    coarse_px: float
    picture: FloatMap
    against: str

    @property
    def median(self) -> float:
        return float(np.nanmedian(self.picture)) if np.isfinite(self.picture).any() else math.nan


def measure_blurs(capture: Capture, looks: Sequence[Look]) -> dict[Axis, Blur]:
    """The blur along each axis that has fringes to compare; none where nothing tells."""
    found = {}
    for axis in AXES:
        ratios = [
            item for item in compare_periods(capture, looks) if item.fringes.fringe.axis == axis
        ]
        told = [
            item
            for item in ratios
            if LEAST_TRANSFER <= item.median <= MOST_TRANSFER
            and item.fringes.fringe.period_px <= LONGEST_PX
        ]
        if told:
            found[axis] = _blur(min(told, key=lambda item: item.median))
    return found


def compare_periods(capture: Capture, looks: Sequence[Look]) -> list[Ratio]:
    """Every set of fringes against the coarsest of its axis, of any axis, or white and black.

    White and black stand for an endless period; gamma makes them wrong by some percent, so they
    are asked only where there is one period alone.
    """
    lit = [look for look in looks if look.enough]
    compared = []
    for look in looks:
        coarser = [
            other for other in lit if other.fringe.period_px > STEADY_RATIO * look.fringe.period_px
        ]
        same = [other for other in coarser if other.fringe.axis == look.fringe.axis]
        if coarser:
            compared.append(_against(look, max(same + coarser, key=lambda o: o.fringe.period_px)))
        elif look.enough and look.fringe.period_px < 64:
            compared += _against_flats(capture, look)
    return compared


def transfer_of(sigma_px: float, period_px: float) -> float:
    """Share of the modulation that a blur leaves: ``exp(-2 pi^2 s^2 / p^2)``."""
    return math.exp(-2 * (math.pi * sigma_px / period_px) ** 2)


def noise_over_least(period_px: float, sigma_px: float) -> float:
    """Noise of a coordinate at this period over that at ``2 pi s``: ``r exp((1/r^2 - 1) / 2)``."""
    ratio = period_px / (2 * math.pi * sigma_px)
    return ratio * math.exp((ratio**-2 - 1) / 2)


def best_even_period(sigma_px: float) -> float:
    """The even whole number above ``2 pi s``: a complementary code takes no other.

    A step too long costs little where one too short loses the fringes of a deeper scene.
    """
    return max(2.0 * math.ceil(math.pi * sigma_px - 1e-9), SHORTEST_PX)


def _against(look: Look, coarse: Look) -> Ratio:
    ratio = look.modulation / np.maximum(coarse.modulation, 1e-3)
    period = coarse.fringe.period_px
    picture = np.where(coarse.lit & ~look.clipped, ratio, np.nan).astype(np.float32)
    return Ratio(look, period, picture, coarse.name)


def _against_flats(capture: Capture, look: Look) -> list[Ratio]:
    white, black = capture.white(), capture.black()
    if white is None or black is None:
        return []
    half = np.maximum(0.5 * (white - black), 1e-3)
    usable = look.lit & (white < capture.sensor.saturation)
    picture = np.where(usable, look.modulation / half, np.nan).astype(np.float32)
    return [Ratio(look, math.inf, picture, "white and black")]


def _blur(ratio: Ratio) -> Blur:
    period = ratio.fringes.fringe.period_px
    per_px2 = 2 * math.pi**2 * (period**-2 - ratio.coarse_px**-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = -np.log(ratio.picture) / np.float32(per_px2)
    sigma = np.sqrt(np.maximum(variance, 0)).astype(np.float32)
    middle, low, high = np.nanpercentile(sigma[np.isfinite(sigma)], (50, 10, 90))
    return Blur(
        ratio.fringes.fringe.axis,
        float(middle),
        float(low),
        float(high),
        ratio.median,
        period,
        ratio.against,
        np.where(np.isfinite(sigma), sigma, np.nan).astype(np.float32),
    )
