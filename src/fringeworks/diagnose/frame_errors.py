"""What the residual of a set of fringes says of its frames: their light, their shifts, a harmonic.

Four frames or more leave a residual ``r = (1 - H) dI``, H the hat matrix of the shifts. To first
order a frame whose light is off by a share g and whose shift is off by s has
``dI = g (A + B cos psi) + s B sin psi`` with ``psi = Phi - delta``; a curved response adds
``B (p cos 2 psi + q sin 2 psi)``, the same in all frames. All of them follow together by linear
least squares over the pixels. What they leave is the scene's: it moved, or it glitters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.look import Look
from fringeworks.phase.demodulate import solve_shifts

Array = NDArray[np.float64]

MOST_PIXELS = 3000
KEPT_PERCENT = 90.0
"""Pixels of larger residuals look across edges, and do not decide what the frames have."""

ONE_SIDED = 0.4
"""Length of the mean of exp(i phase), 0 where all phases are seen alike."""

LEAST_RATIO = 1e-3
"""Directions of the unknowns that the residual does not show are left at zero."""


@dataclass(frozen=True, slots=True, eq=False)
class FrameErrors:
    """What is the same at all pixels.

    Attributes
    ----------
    gains
        ``(N,)`` light of each frame less one.
    shifts_rad
        ``(N,)`` by how much each shift is off.
    harmonic
        Second harmonic over the first.
    power
        Mean square residual per degree of freedom, grey levels squared, of all pixels looked at.
    by_light, by_shifts, by_harmonic
        Shares of it that each of the three explains.
    light_rad, shifts_phase_rad
        Error of the phase, rms, that gains and shifts make.
    """

    gains: Array
    shifts_rad: Array
    harmonic: float
    power: float
    by_light: float
    by_shifts: float
    by_harmonic: float
    light_rad: float
    shifts_phase_rad: float


def fit_frame_errors(look: Look) -> FrameErrors | None:
    """The errors of a set of four frames or more; None where too few pixels tell."""
    count = look.fringe.frame_count
    if count < 4 or not look.enough or _one_sided(look):
        return None
    shifts = np.asarray(look.fringe.shifts_rad, np.float64)
    solution = solve_shifts(shifts)
    solve = solution.solve.astype(np.float64)
    rest = np.eye(count) - solution.basis.astype(np.float64) @ solve
    frames, offset, modulation, psi = _pixels(look, rest)
    light = offset[:, None] + modulation[:, None] * np.cos(psi)
    slope = modulation[:, None] * np.sin(psi)
    twice = [modulation[:, None] * wave(2 * psi) for wave in (np.cos, np.sin)]
    columns = [
        (rest * light[:, None, :]).reshape(-1, count),
        (rest * slope[:, None, :]).reshape(-1, count),
        np.stack([(wave @ rest.T).ravel() for wave in twice], axis=1),
    ]
    left = (frames @ rest.T).ravel()
    (gains, wrong, twofold), shares = _solve(columns, left)
    gains, wrong = gains - gains.mean(), wrong - wrong.mean()
    return FrameErrors(
        gains=gains,
        shifts_rad=wrong,
        harmonic=float(np.hypot(*twofold)),
        power=float(left @ left) / (len(frames) * (count - 3)),
        by_light=shares[0],
        by_shifts=shares[1],
        by_harmonic=shares[2],
        light_rad=_phase_error(solve, light * gains, psi, shifts, modulation),
        shifts_phase_rad=_phase_error(solve, slope * wrong, psi, shifts, modulation),
    )


def _solve(columns: list[Array], left: Array) -> tuple[list[Array], list[float]]:
    """Unknowns of each lot of columns, and the share of the residual that each lot explains."""
    design = np.concatenate(columns, axis=1)
    weights = 1 / np.maximum(np.linalg.norm(design, axis=0), 1e-9)
    solved, *_ = np.linalg.lstsq(design * weights, left, rcond=LEAST_RATIO)
    ends = np.cumsum([part.shape[1] for part in columns])
    unknowns = np.split(solved * weights, ends[:-1])
    total = max(float(left @ left), 1e-12)
    shares = [
        float(np.clip(part @ unknown @ left / total, 0, 1))
        for part, unknown in zip(columns, unknowns, strict=True)
    ]
    return unknowns, shares


def _one_sided(look: Look) -> bool:
    """Whether a part of a fringe alone is seen, on which light and phase cannot be told apart."""
    return bool(abs(np.mean(np.exp(1j * look.phase[look.lit]))) > ONE_SIDED)


def _pixels(look: Look, rest: Array) -> tuple[Array, Array, Array, Array]:
    """Frames ``(n, N)``, offset and modulation ``(n,)`` and psi ``(n, N)`` of lit pixels."""
    y, x = np.nonzero(look.lit)
    step = 1 + len(y) // MOST_PIXELS
    y, x = y[::step], x[::step]
    frames = look.frames[:, y, x].T.astype(np.float64)
    size = np.sqrt(np.mean((frames @ rest.T) ** 2, axis=1)) / look.modulation[y, x]
    kept = size <= np.percentile(size, KEPT_PERCENT)
    y, x, frames = y[kept], x[kept], frames[kept]
    psi = look.phase[y, x].astype(np.float64)[:, None] - np.asarray(look.fringe.shifts_rad)
    return frames, look.offset[y, x].astype(float), look.modulation[y, x].astype(float), psi


def _phase_error(
    solve: Array, change: Array, psi: Array, shifts: Array, modulation: Array
) -> float:
    """Root mean square error of the phase that changes ``(n, N)`` of the frames make."""
    phase = psi[:, 0] + shifts[0]
    _, cosine, sine = solve @ change.T
    return float(
        np.sqrt(np.mean(((sine * np.cos(phase) - cosine * np.sin(phase)) / modulation) ** 2))
    )
