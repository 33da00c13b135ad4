"""From shifted frames to wrapped phase, offset, modulation, residual and sigma.

Least squares for any shifts, equal or not; for equal ones this is the usual
``phi = arg sum I_n exp(i delta_n)`` (Bruning et al. 1974; the paper's equations 9 and 10 for
N = 3), and its sigma ``sqrt(2 / N) sigma_I / B`` is the Cramer-Rao bound.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import ShapeError, UsageError
from fringeworks.kernels import demodulate as kernels
from fringeworks.model import FloatMap, Frames, Fringe, Noise, Sensor, Void, WrappedPhase
from fringeworks.phase.noise import (
    LEAST_PIXELS,
    camera_noise,
    image_noise,
    noise_rows,
    residual_noise,
)


@dataclass(frozen=True, slots=True)
class MaskRules:
    """What makes a pixel void.

    Attributes
    ----------
    modulation_sigmas, modulation_share
        Modulation must reach both this many sigma of the noise and this share of full scale.
    residual_sigmas
        The fit's residual may not exceed this many sigma of the noise (four frames or more).
    other_light
        Whether pixels are void that get light by way of other surfaces (`phase.gloss`).
    """

    modulation_sigmas: float = 5.0
    modulation_share: float = 8 / 255
    residual_sigmas: float = 5.0
    other_light: bool = False

    def least_modulation(self, sensor: Sensor) -> float:
        """Grey levels that the modulation must reach whatever the noise."""
        return self.modulation_share * sensor.full_scale


def wrap_three_steps(frames: Frames, *, out: FloatMap | None = None) -> FloatMap:
    """Wrapped phase, rad, ``(H, W)``, of frames shifted by 120, 0 and -120 degrees (10).

    Phase and nothing else, at the memory's pace: no masks, no sigma. `frames` is ``(3, H, W)``.
    A stream gives `out`, its last map, back: fresh memory takes longer than the arithmetic.
    """
    if frames.ndim != 3 or frames.shape[0] != 3:
        raise ShapeError(f"frames must be (3, H, W), got {frames.shape}")
    phase = np.empty(frames.shape[1:], np.float32) if out is None else out
    if phase.shape != frames.shape[1:] or phase.dtype != np.float32:
        raise ShapeError(f"out must be float32 {frames.shape[1:]}, got {phase.dtype} {phase.shape}")
    kernels.wrap_three_steps(frames, phase)
    return phase


def demodulate(
    frames: Frames,
    fringe: Fringe,
    sensor: Sensor,
    *,
    repeats: int = 1,
    rules: MaskRules | None = None,
) -> WrappedPhase:
    """Wrapped phase of one set of fringes.

    Parameters
    ----------
    frames
        ``(N * repeats, H, W)`` grey levels, the repeats of a shift next to each other.
    fringe, sensor
        What was projected, and full scale and noise of the camera.
    rules
        Masks; saturated frames are left out where three or more remain.

    Raises
    ------
    ShapeError
        The number of frames is not that of the shifts.
    UsageError
        The shifts do not determine a sinusoid (fewer than three distinct ones).
    """
    rules = rules or MaskRules()
    shifts = np.repeat(fringe.shifts_rad, repeats)
    if frames.ndim != 3 or len(frames) != len(shifts):
        raise ShapeError(f"frames must be ({len(shifts)}, H, W), got {frames.shape}")
    maps = _fit_frames(frames, solve_shifts(shifts), sensor.saturation)
    phase, offset, modulation, residual, sigma = maps
    rows = noise_rows(phase.shape)
    noise = _noise_of(frames[:, rows], [item[rows] for item in maps], sensor=sensor, rules=rules)
    void = np.full(phase.shape, Void.VALID, np.uint8)
    kernels.apply_rules(
        phase,
        sigma,
        offset,
        modulation,
        residual,
        (noise.read, noise.gain, noise.black_level),
        (rules.least_modulation(sensor), rules.modulation_sigmas, rules.residual_sigmas),
        (Void.SATURATED, Void.MODULATION, Void.RESIDUAL),
        void,
    )
    return WrappedPhase(fringe, phase, offset, modulation, residual, sigma, noise, void)


@dataclass(frozen=True, slots=True, eq=False)
class ShiftSolution:
    """What takes frames of given shifts to their sinusoid, in single precision.

    Attributes
    ----------
    basis
        ``(N, 3)``: 1, cos, sin of each shift.
    solve
        ``(3, N)``: its pseudo-inverse.
    covariance
        ``(3,)``: elements cc, cs, ss of the inverse normal matrix.
    """

    basis: FloatMap
    solve: FloatMap
    covariance: FloatMap


def solve_shifts(shifts_rad: NDArray[np.float64]) -> ShiftSolution:
    """Least squares for the shifts ``(N,)`` of as many frames.

    Raises
    ------
    UsageError
        They do not determine a sinusoid (fewer than three distinct ones).
    """
    basis = np.stack([np.ones_like(shifts_rad), np.cos(shifts_rad), np.sin(shifts_rad)], axis=1)
    normal = basis.T @ basis
    if np.linalg.cond(normal) > 1e8:
        degrees = ", ".join(f"{value:g}" for value in np.rad2deg(shifts_rad))
        raise UsageError(f"shifts must contain three distinct angles, got {degrees} degrees")
    inverse = np.linalg.inv(normal)
    return ShiftSolution(
        basis.astype(np.float32),
        (inverse @ basis.T).astype(np.float32),
        np.array([inverse[1, 1], inverse[1, 2], inverse[2, 2]], np.float32),
    )


def estimate_noise(
    frames: Frames, solution: ShiftSolution, sensor: Sensor, rules: MaskRules
) -> Noise:
    """The noise that `demodulate` finds in frames ``(N, H, W)``, without the maps."""
    if sensor.noise_is_known:
        return camera_noise(sensor)
    sample = frames[:, noise_rows(frames.shape[1:])]
    maps = _fit_frames(sample, solution, sensor.saturation)
    return _noise_of(sample, maps, sensor=sensor, rules=rules)


def _fit_frames(frames: Frames, solution: ShiftSolution, saturation: float) -> list[FloatMap]:
    """Phase, offset, modulation, residual, and sigma of the phase per grey level of noise."""
    maps = [np.empty(frames.shape[1:], np.float32) for _ in range(5)]
    kernels.demodulate(
        np.ascontiguousarray(frames),
        solution.basis,
        solution.solve,
        solution.covariance,
        saturation,
        *maps,
    )
    return maps


def _noise_of(frames: Frames, maps: Items[FloatMap], *, sensor: Sensor, rules: MaskRules) -> Noise:
    """The camera's own figures, else the residual of four frames or more, else high pass."""
    phase, _, modulation, residual, _ = maps
    lit = (modulation >= rules.least_modulation(sensor)) & np.isfinite(phase)
    freedom = len(frames) - 3
    if freedom > 0 and not sensor.noise_is_known:
        used = np.where(lit, residual, np.float32(np.nan))
        if np.count_nonzero(np.isfinite(used)) >= LEAST_PIXELS:
            return residual_noise(used, freedom=freedom, black_level=sensor.black_level)
    return image_noise(frames, lit, sensor=sensor)
