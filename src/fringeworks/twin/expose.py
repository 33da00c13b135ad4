"""From light to grey levels: the camera's electronics, and what makes light unsteady.

Arriving electrons are taken as normal with their mean as variance (exact enough from some tens of
electrons on) and drawn together with the read noise, one number per pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.kernels.forming import read_out
from fringeworks.model import Frames, Sensor
from fringeworks.twin.effects import AmbientEffects, CameraEffects

Floats: TypeAlias = NDArray[np.float32]

NO_NOISE = np.empty((0, 0), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Chip:
    """One camera: its effects, and the gains and offsets of its own pixels.

    `gains` ``(H, W)`` are factors about one, `offsets` ``(H, W)`` grey levels about zero.
    """

    effects: CameraEffects
    gains: Floats
    offsets: Floats

    @property
    def sensor(self) -> Sensor:
        """See `sensor_of`."""
        return sensor_of(self.effects)

    def read(self, light: Floats, rng: np.random.Generator) -> Frames:
        """Grey levels ``(H, W)`` of light ``(H, W)``, 1 at full scale; uint8 up to 8 bits."""
        effects = self.effects
        noisy = effects.shot_noise or effects.read_noise_e > 0
        noise = rng.standard_normal(light.shape, dtype=np.float32) if noisy else NO_NOISE
        out: Frames = np.empty(light.shape, np.uint8 if effects.bits == 8 else np.uint16)
        electronics = (
            _full_scale(effects),
            effects.black_level,
            effects.full_well_e,
            effects.read_noise_e,
            float(effects.shot_noise),
        )
        read_out(light, (self.gains, self.offsets), noise, electronics, out)
        return out


def sensor_of(effects: CameraEffects) -> Sensor:
    """The truth of a camera's noise, grey levels; rounding to them is not in it."""
    full_scale = _full_scale(effects)
    per_electron = full_scale / effects.full_well_e
    return Sensor(
        full_scale,
        black_level=effects.black_level,
        gain=per_electron if effects.shot_noise else 0.0,
        read_noise=effects.read_noise_e * per_electron,
    )


def make_chip(effects: CameraEffects, *, width: int, height: int) -> Chip:
    """The camera whose pixels `effects.pixel_seed` says."""
    rng = np.random.default_rng(effects.pixel_seed)
    gains, offsets = rng.standard_normal((2, height, width), dtype=np.float32)
    gains = np.maximum(1 + np.float32(effects.prnu) * gains, 0)
    return Chip(effects, gains, np.float32(effects.dsnu * _full_scale(effects)) * offsets)


def _full_scale(effects: CameraEffects) -> float:
    return 2.0**effects.bits - 1


def ambient_exposure(effects: AmbientEffects, *, time_s: float, exposure_ms: float) -> float:
    """Ambient light on white from `time_s` on for `exposure_ms`, share of full scale.

    The ripple ``cos(4 pi mains_hz t)`` is averaged over the exposure: over whole periods it is
    gone.
    """
    steady = effects.light_per_ms * exposure_ms
    if effects.mains_hz == 0:
        return steady
    ripple_hz, duration_s = 2 * effects.mains_hz, exposure_ms / 1000
    middle = math.cos(2 * math.pi * ripple_hz * (time_s + duration_s / 2))
    return steady * (1 + effects.ripple * middle * float(np.sinc(ripple_hz * duration_s)))
