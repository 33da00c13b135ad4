"""Light that bounces between surfaces: what coarse fringes show of it and fine ones do not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fringeworks.diagnose.suspicion import Suspicion
from fringeworks.model import Capture, CodedAxis, Fringe, ProjectorMap
from fringeworks.phase.demodulate import MaskRules
from fringeworks.phase.exposures import demodulate_fringe
from fringeworks.phase.gloss import compare_modulations

LEAST_SHARE = 0.01
"""Of the pixels; edges and noise reach 0.001 on clean scenes of the twin."""

REMEDY = (
    "Take a finer period, void those pixels (--other-light), turn surfaces that face each other "
    "apart, or dull them."
)


def find_other_light(capture: Capture, decoded: ProjectorMap) -> Iterator[Suspicion]:
    """Coarse fringes of an axis against what the finest ones say they should be."""
    for axis in decoded.axes:
        yield from _of_axis(capture, axis)


def _of_axis(capture: Capture, axis: CodedAxis) -> Iterator[Suspicion]:
    shown = dict.fromkeys(item for item, *_ in capture.find(Fringe) if item.axis == axis.axis)
    if len(shown) < 2:
        return
    rules = MaskRules()
    phases = [demodulate_fringe(item, capture, None, rules=rules, raw=capture) for item in shown]
    found = compare_modulations(phases, axis.coordinate)
    if found is None or found.share < LEAST_SHARE:
        return
    finest = min(item.period_px for item in shown)
    size = float(np.sqrt(np.mean(found.change[found.lifted] ** 2)))
    yield Suspicion(
        "other light",
        np.sqrt(found.share) * size * finest / (2 * np.pi),
        f"{found.share:.0%} of the pixels along {axis.axis} get light by way of other surfaces, "
        f"{size:.0%} of the coarse fringes' own there; fine fringes carry less of it.",
        REMEDY,
        f"fringes of {finest:.4g} px along {axis.axis}",
        found.change,
        "other light's share of the coarse fringes",
    )
