"""Why a preset takes the number of steps that it takes: harmonics and noise, in a sentence.

N equal steps let the harmonics ``m N - 1`` and ``m N + 1`` of the fringes into the phase and reject
all others, so 2 to N - 2 among the low ones that gamma makes; the phase's noise is
``sqrt(2 / N) sigma_I / B`` (Bruning et al. 1974).
"""

from __future__ import annotations

import math
from types import MappingProxyType

from fringeworks.patterns.presets import PRESETS, Preset

REASONS: MappingProxyType[Preset, str] = MappingProxyType(
    {
        "paper": "the paper's own; correct the response, or its ripple stays",
        "calibrate": "dark squares stay clear of ripple, and the residual shows what is clipped",
        "measure": "ripple far below the noise, even with gamma, at a third of the paper's error",
        "multi-frequency": "fewest frames that reject the second harmonic",
        "paper-calibrate": "the paper's own",
        "double-three-step": "either half is a set of three steps, both together are six",
    }
)


def noise_factor(steps: int) -> float:
    """Phase noise of N steps, rad, per unit of sigma_I / B: ``sqrt(2 / N)``."""
    return math.sqrt(2 / steps)


def explain_steps(steps: int) -> str:
    """What N steps reject and what they leave of the noise."""
    rejected = {3: "no harmonic below 3", 4: "harmonic 2"}.get(steps, f"harmonics 2 to {steps - 2}")
    return (
        f"{steps} steps reject {rejected} and let {steps - 1} and {steps + 1} through; "
        f"phase noise {noise_factor(steps):.2f} sigma_I / B"
    )


def explain_preset(preset: Preset) -> str:
    """A sentence on the number of steps of a preset."""
    return f"{explain_steps(PRESETS[preset].steps)}: {REASONS[preset]}."
