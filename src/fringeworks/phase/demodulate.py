"""From shifted frames to wrapped phase, offset, modulation, residual and sigma.

Least squares for any shifts, equal or not; for equal ones this is the usual
``phi = arg sum I_n exp(i delta_n)`` (Bruning et al. 1974; the paper's equations 9 and 10 for
N = 3), and its sigma ``sqrt(2 / N) sigma_I / B`` is the Cramer-Rao bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import ShapeError, UsageError
from fringeworks.kernels import demodulate as kernels
from fringeworks.model import FloatMap, Frames, Fringe, Noise, Sensor, Void, WrappedPhase
from fringeworks.phase.noise import LEAST_PIXELS, image_noise, residual_noise


@dataclass(frozen=True, slots=True)
class MaskRules:
    """What makes a pixel void.

    Attributes
    ----------
    modulation_sigmas, modulation_share
        Modulation must reach both this many sigma of the noise and this share of full scale.
    residual_sigmas
        The fit's residual may not exceed this many sigma of the noise (four frames or more).
    """

    modulation_sigmas: float = 5.0
    modulation_share: float = 8 / 255
    residual_sigmas: float = 5.0


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
    phase, offset, modulation, residual, spread = _fit_sinusoid(frames, shifts, sensor.saturation)
    least = rules.modulation_share * sensor.full_scale
    lit = (modulation >= least) & np.isfinite(phase)
    noise = _noise_of(frames, residual, use=lit, sensor=sensor)
    sigma, void = spread, np.full(phase.shape, Void.VALID, np.uint8)
    kernels.apply_rules(
        phase,
        sigma,
        offset,
        modulation,
        residual,
        (noise.read, noise.gain, noise.black_level),
        (least, rules.modulation_sigmas, rules.residual_sigmas),
        (Void.SATURATED, Void.MODULATION, Void.RESIDUAL),
        void,
    )
    return WrappedPhase(fringe, phase, offset, modulation, residual, sigma, noise, void)


def _fit_sinusoid(
    frames: Frames, shifts: NDArray[np.float64], saturation: float
) -> tuple[FloatMap, FloatMap, FloatMap, FloatMap, FloatMap]:
    """Phase, offset, modulation, residual, and sigma of the phase per grey level of noise."""
    basis = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    normal = basis.T @ basis
    if np.linalg.cond(normal) > 1e8:
        degrees = ", ".join(f"{value:g}" for value in np.rad2deg(shifts))
        raise UsageError(f"shifts must contain three distinct angles, got {degrees} degrees")
    inverse = np.linalg.inv(normal)
    covariance = np.array([inverse[1, 1], inverse[1, 2], inverse[2, 2]], np.float32)
    outputs = tuple(np.empty(frames.shape[1:], np.float32) for _ in range(5))
    kernels.demodulate(
        np.ascontiguousarray(frames),
        basis.astype(np.float32),
        (inverse @ basis.T).astype(np.float32),
        covariance,
        saturation,
        *outputs,
    )
    phase, offset, modulation, residual, spread = outputs
    return phase, offset, modulation, residual, spread


def _noise_of(
    frames: Frames, residual: FloatMap, *, use: NDArray[np.bool_], sensor: Sensor
) -> Noise:
    """The camera's own figures, else the residual of four frames or more, else high pass."""
    freedom = len(frames) - 3
    if freedom > 0 and not sensor.noise_is_known:
        used = np.where(use, residual, np.float32(np.nan))
        if np.count_nonzero(np.isfinite(used)) >= LEAST_PIXELS:
            return residual_noise(used, freedom=freedom, black_level=sensor.black_level)
    return image_noise(frames, use, sensor=sensor)
