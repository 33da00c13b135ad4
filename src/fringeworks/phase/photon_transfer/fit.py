"""The line of variance against mean: its slope is the gain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fringeworks.phase.photon_transfer.nouns import Array, CurvePoints, Estimate

ROUNDS = 6
LEAST_POINTS = 3


@dataclass(frozen=True, slots=True, eq=False)
class VarianceLine:
    """``variance = offset + gain level``, grey levels; covariance ``(2, 2)`` in that order.

    `misfit` is the rms deviation of the points beyond their scatter, as a share of the variance.
    """

    offset: float
    gain: float
    covariance: Array
    misfit: float

    @property
    def gain_sigma(self) -> float:
        return float(np.sqrt(self.covariance[1, 1]))

    def read_noise(self, black: Estimate) -> Estimate:
        """Noise at the black level; the black's own sigma counts where it has one.

        A variance that comes out below zero is none; its sigma is then that of the variance's root.
        """
        direction = np.array([1.0, black.value])
        variance = float(direction @ self.covariance @ direction)
        if np.isfinite(black.sigma):
            variance += (self.gain * black.sigma) ** 2
        square, sigma = self.offset + self.gain * black.value, float(np.sqrt(variance))
        read = float(np.sqrt(max(square, 0.0)))
        return Estimate(read, sigma / max(2 * read, float(np.sqrt(sigma)), 1e-12))


def fit_variance(points: CurvePoints, *, rounding: float) -> VarianceLine:
    """Weighted least squares over the points that are used.

    A variance of n degrees of freedom scatters by ``sqrt(2 / n)`` of itself and of the variance
    of rounding with it; the fitted one stands for it, since else the lowest of scattered points
    would count most. What scatters more than that widens the covariance.
    """
    level, variance = points.level[points.used], points.variance[points.used]
    sigma = points.sigma[points.used]
    share = sigma / (variance + rounding)
    middle = float(np.average(level, weights=sigma**-2))
    design = np.stack([np.ones_like(level), level - middle], axis=1)
    for _ in range(ROUNDS):
        weighted = design / sigma[:, np.newaxis]
        covariance = np.linalg.inv(weighted.T @ weighted)
        solved = covariance @ weighted.T @ (variance / sigma)
        fitted = design @ solved
        sigma = share * (np.maximum(fitted, 0.0) + rounding)
    left = variance - fitted
    chi_squared = float(np.sum(np.square(left / sigma))) / max(len(level) - 2, 1)
    turn = np.array([[1.0, -middle], [0.0, 1.0]])
    offset, gain = (turn @ solved).tolist()
    covariance = turn @ covariance @ turn.T * max(chi_squared, 1.0)
    return VarianceLine(offset, gain, covariance, _misfit(left * share / sigma, share))


def _misfit(relative: Array, share: Array) -> float:
    """Rms of relative deviations beyond the `share` that scatter makes of each."""
    beyond = np.average(np.square(relative) - np.square(share), weights=share**-2)
    return float(np.sqrt(max(beyond, 0.0)))
