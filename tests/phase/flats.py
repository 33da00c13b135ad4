"""Repeated flat levels seen by a camera of the twin whose figures are known."""

from __future__ import annotations

from collections.abc import Sequence as Items
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Capture, Frames, PatternSet, Sensor, Sequence, Uniform
from fringeworks.twin.effects import CameraEffects
from fringeworks.twin.expose import make_chip

WIDTH, HEIGHT = 160, 112
AMBIENT, WHITE = 0.04, 0.8
"""Shares of full scale; levels then run from 4 to 84 % of it."""

LEVELS = tuple(np.linspace(0, 1, 16).tolist())


def shade(vignetting: float) -> NDArray[np.float32]:
    """Light of an even wall, ``(H, W)``: `vignetting` is lost in the corners."""
    rows, columns = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j]
    return np.asarray(1 - vignetting * (rows**2 + columns**2) / 2, np.float32)


def see_flats(
    effects: CameraEffects,
    seed: int,
    *,
    levels: Items[float] = LEVELS,
    exposures: Items[float] = (1.0,),
    repeats: int = 4,
    flicker: float = 0.003,
    light: float = 1.0,
    vignetting: float = 0.3,
) -> Capture:
    """A capture of levels whose `Sensor` knows full scale alone."""
    rng = np.random.default_rng(seed)
    chip = make_chip(effects, width=WIDTH, height=HEIGHT)
    even = light * shade(vignetting)
    sets: list[PatternSet] = []
    frames: list[Any] = []
    for exposure in exposures:
        for level in levels:
            lamp = 1 + flicker * rng.standard_normal(repeats)
            seen = [exposure * (AMBIENT + WHITE * level * now) * even for now in lamp]
            frames.append(np.stack([chip.read(one.astype(np.float32), rng) for one in seen]))
            sets.append(PatternSet(Uniform(level), exposure_ms=exposure, repeats=repeats))
    return as_capture(sets, frames, chip.sensor.full_scale)


def see_dark(effects: CameraEffects, seed: int) -> Capture:
    """Eight frames with the lens capped."""
    return see_flats(effects, seed, levels=(0.0,), repeats=8, light=0.0)


def as_capture(sets: Items[PatternSet], frames: Items[Frames], full_scale: float) -> Capture:
    return Capture(Sequence(64, 48, tuple(sets)), tuple(frames), Sensor(full_scale), name="flats")
