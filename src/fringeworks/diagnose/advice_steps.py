"""How many steps: what the noise asks for, and what the harmonics of the response forbid.

Light ``((1 + cos Phi) / 2)^gamma`` has harmonics ``a2 / a1 = (gamma - 1) / (gamma + 2)`` and
``a(k+1) / a(k) = (gamma - k) / (gamma + k + 1)``, so the second tells gamma and gamma all others.
N steps let the harmonics N - 1 and N + 1 into the phase (Bruning et al. 1974); a blur of s px
leaves harmonic k of fringes of period p ``exp(-2 pi^2 s^2 (k^2 - 1) / p^2)`` of its share.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fringeworks.diagnose.frame_errors import fit_frame_errors
from fringeworks.diagnose.look import Look

STEPS = (4, 5, 6, 8, 10, 12, 16, 24, 32, 48, 64)
"""Numbers of steps that are proposed: three leave no residual in which faults would show."""

USUAL_GAMMA = 2.2
MOST_SECOND_HARMONIC = 0.8


@dataclass(frozen=True, slots=True)
class Steps:
    """How many steps, and why.

    Attributes
    ----------
    steps
        The least of `STEPS` whose noise and ripple together keep `wanted_px`; else the most.
    wanted_px, reached_px
        Standard deviation of a projector coordinate, px: wanted, and expected with `steps` at the
        median pixel.
    by_noise
        What the noise alone asks for.
    by_harmonics
        What the ripple alone asks for.
    gamma
        Exponent that the second harmonic tells; None where no set has four steps or more.
    """

    steps: int
    wanted_px: float
    reached_px: float
    by_noise: int
    by_harmonics: int
    gamma: float | None


def choose_steps(
    *, noise_px: float, gamma: float | None, period_px: float, sigma_px: float, wanted_px: float
) -> Steps:
    """The steps that keep a wanted sigma.

    `noise_px` is the coordinate's noise, px, of one step: ``p / (2 pi) sqrt(2) sigma_I / B``.
    `sigma_px` is the blur. A gamma that is not known is taken as 2.2, which most
    projectors have unless it was switched off.
    """

    def ripple(steps: int) -> float:
        return ripple_px(steps, USUAL_GAMMA if gamma is None else gamma, period_px, sigma_px)

    def noise(steps: int) -> float:
        return noise_px / math.sqrt(steps)

    def least(error: list[float]) -> int:
        kept = [n for n, px in zip(STEPS, error, strict=True) if px <= wanted_px]
        return min(kept, default=STEPS[-1])

    both = [math.hypot(noise(n), ripple(n)) for n in STEPS]
    steps = least(both)
    return Steps(
        steps,
        wanted_px,
        both[STEPS.index(steps)],
        least([noise(n) for n in STEPS]),
        least([ripple(n) for n in STEPS]),
        gamma,
    )


def ripple_px(steps: int, gamma: float, period_px: float, sigma_px: float) -> float:
    """Ripple that N steps leave, px rms: ``P / 2 pi (h(N-1) + h(N+1)) / sqrt 2``."""
    left = sum(
        abs(harmonic(k, gamma)) * _kept(k, period_px, sigma_px) for k in (steps - 1, steps + 1)
    )
    return period_px / (2 * math.pi) * left / math.sqrt(2)


def harmonic(order: int, gamma: float) -> float:
    """Share ``a_k / a_1`` of a harmonic, k >= 1, in the light of a sinusoid shown with a gamma."""
    share = 1.0
    for k in range(1, order):
        share *= (gamma - k) / (gamma + k + 1)
    return share


def find_gamma(looks: Sequence[Look]) -> float | None:
    """The exponent, by the coarsest fringes of four steps or more; None without any."""
    told = [look for look in looks if look.fringe.frame_count >= 4 and look.enough]
    for look in sorted(told, key=lambda item: -item.fringe.period_px):
        second = _second_harmonic(look)
        if second is not None:
            second = min(second, MOST_SECOND_HARMONIC)
            return (1 + 2 * second) / (1 - second)
    return None


def _second_harmonic(look: Look) -> float | None:
    """Of the light, positive where bright parts are narrow (gamma above one).

    Five equal steps and more have it as the second term of their Fourier series, averaged over the
    lit pixels along the phase of the first; four show it in their residual, without its sign.
    """
    shifts = np.asarray(look.fringe.shifts_rad)
    if look.fringe.frame_count < 5:
        errors = fit_frame_errors(look)
        return None if errors is None else errors.harmonic
    frames = look.frames[:, look.lit]
    twice = np.tensordot(np.exp(2j * shifts), frames, axes=1) * (2 / len(shifts))
    along = np.real(twice * np.exp(-2j * look.phase[look.lit]))
    return float(np.sum(along) / np.sum(look.modulation[look.lit]))


def _kept(order: int, period_px: float, sigma_px: float) -> float:
    return math.exp(-2 * (math.pi * sigma_px / period_px) ** 2 * (order**2 - 1))
