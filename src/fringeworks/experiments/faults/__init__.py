"""Captures of the twin with one thing wrong, each in three strengths, and clean ones.

A fault is a function of a strength and a seed; it gives the capture, the rig that is told, and the
name that `check` must put first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from fringeworks.experiments.faults import listed, shown
from fringeworks.experiments.faults.base import Case, Strength, clean, good, half_rig

__all__ = ["FAULTS", "Case", "Strength", "clean", "good", "half_rig"]

FAULTS: Mapping[str, Callable[[Strength, int], Case]] = MappingProxyType(
    {
        "overexposed": shown.overexposed,
        "underexposed": shown.underexposed,
        "ambient": shown.ambient,
        "lamp flicker": shown.lamp_flicker,
        "mains": shown.mains,
        "light drift": shown.lamp_drift,
        "bumped": shown.bumped,
        "moving": shown.moving,
        "frames swapped": listed.frames_swapped,
        "frames reversed": listed.frames_reversed,
        "frames rotated": listed.frames_rotated,
        "other shifts": listed.other_shifts,
        "frame repeated": listed.frame_repeated,
        "frame missing": listed.frame_missing,
        "gamma": shown.gamma,
        "projector blur": shown.projector_blur,
        "camera blur": shown.camera_blur,
        "bits swapped": listed.bits_swapped,
        "bit inverted": listed.bit_inverted,
        "code darker": shown.code_darker,
        "rig moved": listed.rig_moved,
        "camera flipped": listed.camera_flipped,
        "axes exchanged": listed.axes_exchanged,
    }
)
