"""What one check suspects, before it is known what a pixel is worth in mm."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

from fringeworks.model import FloatMap

Kind: TypeAlias = Literal["frames", "exposure", "light", "scene", "optics", "code", "rig"]

FAULTS: dict[str, Kind] = {
    "missing frame": "frames",
    "repeated frame": "frames",
    "frame order": "frames",
    "wrong shifts": "frames",
    "inverted bit": "frames",
    "bit order": "frames",
    "saturation": "exposure",
    "too dark": "exposure",
    "ambient light": "exposure",
    "flicker": "light",
    "light drift": "light",
    "gamma": "optics",
    "blur": "optics",
    "motion": "scene",
    "other light": "scene",
    "gray margin": "code",
    "axes swapped": "rig",
    "mirrored": "rig",
    "epipolar": "rig",
    "not decodable": "code",
}
"""Every fault that is looked for, and what it is a fault of."""


@dataclass(frozen=True, slots=True, eq=False)
class Suspicion:
    """A fault, what it costs, and the picture that shows it.

    Attributes
    ----------
    name
        One of `FAULTS`.
    cost_px
        Error that it makes in the projector coordinate, px rms; a pixel that it loses counts
        as one that is known to a period alone (`lost_px`).
    message, remedy, where
        As those of a finding.
    picture
        ``(H, W)`` what shows it, NaN where there is nothing to show.
    label
        What the picture's colours mean, with the unit.
    """

    name: str
    cost_px: float
    message: str
    remedy: str
    where: str
    picture: FloatMap
    label: str

    @property
    def kind(self) -> Kind:
        return FAULTS[self.name]


def lost_px(share: float, period_px: float) -> float:
    """What it costs to lose a share of the pixels: each is then known to a period alone."""
    return math.sqrt(max(share, 0.0)) * period_px / math.sqrt(12)


def wrong_order_px(share: float, period_px: float) -> float:
    """What it costs where a share of the pixels is at least a fringe off."""
    return math.sqrt(max(share, 0.0)) * period_px
