"""Blur: how much less the finest fringes move the light than white and black do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fringeworks.diagnose.look import Look, uniform_at
from fringeworks.diagnose.suspicion import Suspicion
from fringeworks.model import Capture, FloatMap

LEAST_TRANSFER = 0.55
"""Below exp(-1/2) = 0.61 a period is shorter than 2 pi times the blur, where noise is least."""

LEAST_BLUR_PX = 2.0
"""Fringes of 6 px are taken knowing that sharp devices, 1 px, leave them 0.6."""

EDGE_PERCENT = 99.7
SHARP_EDGE_PX = 7.0
"""Height over steepest slope of the white frame's edges: 2.5 px for a blur of 1 px."""


def find_blur(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Fringes that white and black say should be stronger."""
    sets = capture.sequence.sets
    for look in looks:
        exposure_ms = sets[look.place].exposure_ms
        uniform = uniform_at(capture, exposure_ms)
        lit = capture.at_exposure(exposure_ms).sequence
        alike = lit.sets[lit.white_set or 0].exposure_ms == exposure_ms
        if uniform is None or not (look.enough and alike):
            continue
        white, black = uniform
        ratio = look.modulation / np.maximum(0.5 * (white - black), 1)
        transfer = float(np.median(ratio[look.lit]))
        if transfer > LEAST_TRANSFER:
            continue
        period = look.fringe.period_px
        blur = period / (2 * np.pi) * np.sqrt(-2 * np.log(transfer))
        if blur < LEAST_BLUR_PX:
            continue
        of = _of_camera(white)
        yield Suspicion(
            "blur",
            look.noise_px(),
            f"{look.name} reach only {transfer:.0%} of the modulation of white and black: a blur "
            f"of {blur:.1f} projector px{of}.",
            "Focus projector and camera on the scene, stop the lens down, or take fringes of "
            f"{np.ceil(2 * np.pi * blur):.0f} px and more.",
            look.where,
            np.where(look.lit, ratio, np.nan).astype(np.float32),
            "modulation over that of white and black",
        )


def _of_camera(white: FloatMap) -> str:
    """That edges of the scene itself are soft, where there are some to see."""
    import cv2

    down, across = np.gradient(white.astype(np.float64))
    slope = np.hypot(down, across)
    kernel = np.ones((15, 15), np.uint8)
    height = np.asarray(cv2.dilate(white, kernel)) - np.asarray(cv2.erode(white, kernel))
    steep = slope > np.percentile(slope, EDGE_PERCENT)
    steep &= height > 0.3 * float(np.percentile(white, 99))
    if np.count_nonzero(steep) < 20:
        return ""
    width = float(np.median(height[steep] / slope[steep]))
    device = "camera" if width > SHARP_EDGE_PX else "projector"
    return f", the {device}'s by the edges of the scene"
