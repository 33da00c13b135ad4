"""What photon transfer finds, and what it was found from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Finding, Sensor

Array: TypeAlias = NDArray[np.float64]
BlackWay: TypeAlias = Literal["dark", "exposures", "assumed"]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number with its standard deviation; NaN where it was taken over and not measured."""

    value: float
    sigma: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class CurvePoints:
    """Variance against mean, one point per range of grey levels; arrays ``(K,)``.

    Attributes
    ----------
    level
        Mean grey level.
    variance, sigma
        Variance of the noise, grey levels squared, without that of rounding; its 1 sd.
    used
        Whether the fit sees the point: not clipped, and rounding can be told from noise.
    """

    level: Array
    variance: Array
    sigma: Array
    used: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Linearity:
    """Mean grey level above black against exposure (EMVA 1288); arrays ``(M,)``.

    Attributes
    ----------
    exposure_ms, signal
        One point per exposure.
    slope, offset
        The line ``signal = slope exposure_ms + offset`` of least relative deviation.
    deviation
        ``signal / line - 1``.
    used
        Points from 5 to 95 % of the way from black to full scale: these make the line.
    """

    exposure_ms: Array
    signal: Array
    slope: float
    offset: float
    deviation: Array
    used: NDArray[np.bool_]

    @property
    def least(self) -> float:
        """Smallest relative deviation, LE_min, a share."""
        return float(self.deviation[self.used].min())

    @property
    def most(self) -> float:
        """Largest relative deviation, LE_max, a share."""
        return float(self.deviation[self.used].max())


@dataclass(frozen=True, slots=True, eq=False)
class PhotonTransfer:
    """A camera's figures, grey levels.

    Attributes
    ----------
    gain
        Grey level of variance per grey level of signal.
    read_noise
        1 sd without light; rounding is not in it. With an assumed black level it holds for that.
    black_level, black_way
        Grey level without light, and how it was found.
    full_scale, saturates
        Grey level of saturation; whether frames were seen to reach it.
    step
        Grey levels from one possible value to the next: 1, or 16 for 12 bits on top of 16.
    points, offset, misfit
        The curve; variance of the line at grey level 0; rms deviation of the points from the line
        beyond their scatter, as a share.
    moved_share
        Share of the tiles that changed between repeats; they are left out.
    linearity
        None without five exposures.
    """

    gain: Estimate
    read_noise: Estimate
    black_level: Estimate
    black_way: BlackWay
    full_scale: float
    saturates: bool
    step: int
    points: CurvePoints
    offset: float
    misfit: float
    moved_share: float
    linearity: Linearity | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def sensor(self) -> Sensor:
        """The same as a capture keeps it; steps above 1 round more, which is read noise there."""
        further = (self.step**2 - 1) / 12
        return Sensor(
            self.full_scale,
            black_level=self.black_level.value,
            gain=max(self.gain.value, 0.0),
            read_noise=math.hypot(self.read_noise.value, math.sqrt(further)),
        )

    @property
    def full_well_e(self) -> float:
        """Electrons at full scale; infinite without shot noise."""
        return (self.full_scale - self.black_level.value) * self._electrons

    @property
    def read_noise_e(self) -> float:
        """Read noise, electrons."""
        return self.read_noise.value * self._electrons

    @property
    def _electrons(self) -> float:
        """Of one grey level."""
        return 1 / self.gain.value if self.gain.value > 0 else math.inf
