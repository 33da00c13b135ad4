"""How wide the range of pure noise is: order statistics of the normal distribution.

A range is a statistic of noise. Of n independent deviations of standard deviation one it is
``integral of 1 - Phi^n - (1 - Phi)^n`` on average (Tippett 1925), and grows without end. With the
k farthest left out, the farthest that stays lies at t = |x|_(n-k), whose share of the half normal
distribution is Beta(n - k, k + 1), and the n - k - 1 others lie within +-t, of which the one
farthest on the other side ends the range.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import UsageError

REACH = 12.0
"""In standard deviations: beyond, nothing is found of any number of points that a camera has."""

STEPS = 4001
NODES = 64

Array = NDArray[np.float64]


def expected_range(count: int, left_out: int = 0) -> float:
    """Mean range of `count` normal deviations of sigma one, the farthest `left_out` aside.

    Raises
    ------
    UsageError
        Fewer than two would stay, or a negative number is left out.
    """
    if left_out < 0 or count - left_out < 2:
        raise UsageError(f"left_out must be 0 to {count - 2} of {count} deviations, got {left_out}")
    return _whole(count) if left_out == 0 else _trimmed(count, left_out)


def rms_range(rms_mm: float, count: int, left_out: int) -> float:
    """Mean range, mm, of noise whose standard deviation is known without those left out.

    `rms_mm` is that of the deviations that stay, which is smaller than that of all of them.
    """
    return rms_mm / trimmed_rms(count, left_out) * expected_range(count, left_out)


def trimmed_rms(count: int, left_out: int) -> float:
    """Root mean square of normal deviations within the quantile that leaves so many out.

    Of a normal variable within +-t it is ``1 - 2 t phi(t) / (2 Phi(t) - 1)``, squared.
    """
    from scipy.special import ndtri

    if left_out == 0:
        return 1.0
    inside = 1 - left_out / count
    end = float(-ndtri((1 - inside) / 2))
    density = float(np.exp(-(end**2) / 2) / np.sqrt(2 * np.pi))
    return float(np.sqrt(1 - 2 * end * density / inside))


def _whole(count: int) -> float:
    from scipy.special import log_ndtr

    x = np.linspace(-REACH, REACH, STEPS)
    within = 1 - np.exp(count * log_ndtr(x)) - np.exp(count * log_ndtr(-x))
    return float(np.trapezoid(within, x))


def _trimmed(count: int, left_out: int) -> float:
    from scipy.special import betaincinv, ndtri

    stay = count - left_out
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    beyond = betaincinv(left_out + 1, stay, (nodes + 1) / 2)  # 1 - v: v itself would round to 1
    ends = -ndtri(beyond / 2)
    return float(sum(w / 2 * _spanned(t, stay - 1) for w, t in zip(weights, ends, strict=True)))


def _spanned(end: float, others: int) -> float:
    """Mean range of one deviation at `end` and `others` drawn from within +-`end`."""
    from scipy.special import ndtr

    x = np.linspace(-end, end, STEPS)
    share = (ndtr(x) - ndtr(-end)) / math.erf(end / math.sqrt(2))
    farthest = end - float(np.trapezoid(np.clip(share, 0, 1) ** others, x))
    return end + farthest
