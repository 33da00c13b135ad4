"""Too much light, too little, or the wrong one: saturation, modulation, ambient light."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.look import LEAST_PIXELS, Look, one_per_fringe
from fringeworks.diagnose.suspicion import Suspicion, lost_px
from fringeworks.model import Capture, FloatMap

NOTABLE_CLIPPED = 0.03
"""Of the pixels that see fringes; highlights on glossy things clip fewer."""

HIDDEN_SHARE = 0.5
"""Of the image that is white in all frames: a lamp in the picture is smaller."""

DARK_SHARE = 0.075
"""Modulation, share of full scale, that the brightest twentieth of the image should reach."""

BRIGHT_PERCENT = 95.0

LEAST_THING = 0.01
"""Of the image: so large a thing counts by itself, whatever is dark or empty about it."""

AMBIENT_SHARE = 0.35
"""Of the white frame; the twin's default scene has 0.1, real ones in a lit room 0.2."""


def find_saturation(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Sets in which frames are clipped where fringes are seen; of several exposures the shortest.

    Where no fringes are seen at all: sets that are white all over the image.
    """
    for look in one_per_fringe(looks, lambda look: -look.light):
        over = (look.frames >= capture.sensor.saturation).sum(axis=0)
        clipped = look.clipped | _blown(look, over)
        seen = look.lit | clipped
        if np.count_nonzero(seen) < LEAST_PIXELS:
            continue
        share = float(clipped[seen].mean())
        if share <= NOTABLE_CLIPPED:
            continue
        left = look.fringe.frame_count - over
        lost = float((clipped & (left < 3))[seen].mean())
        yield Suspicion(
            "saturation",
            lost_px(lost, look.fringe.period_px) + np.sqrt(share) * look.noise_px(frames=3),
            f"{share:.0%} of the pixels that see {look.name} are saturated in at least one frame, "
            f"{lost:.0%} keep fewer than three frames.",
            "Shorten the exposure or dim the projector; for shining and dull parts in one scene "
            "take two exposures.",
            look.where,
            np.where(seen, over, np.nan).astype(np.float32),
            "saturated frames",
        )


def _blown(look: Look, over: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Pixels that are white in all frames, where they are most of the image and hide the rest."""
    white = over == look.fringe.frame_count
    return white if white.mean() > HIDDEN_SHARE else np.zeros_like(white)


def find_darkness(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Sets whose fringes are faint all over the image; of several exposures the longest."""
    black = capture.black()
    for look in one_per_fringe(looks, lambda look: look.light):
        if np.count_nonzero(look.clipped) > look.lit.sum():
            continue
        if np.median(look.offset) >= capture.sensor.saturation:
            continue
        bright = float(np.percentile(look.modulation, BRIGHT_PERCENT))
        share = bright / capture.sensor.full_scale
        if max(bright, _of_small_thing(look)) >= DARK_SHARE * capture.sensor.full_scale:
            continue
        if black is not None and _faded(look, black, bright):
            continue
        lost = 1 - np.count_nonzero(look.lit) / look.lit.size
        yield Suspicion(
            "too dark",
            lost_px(lost, look.fringe.period_px) + look.noise_px(),
            f"{look.name} are faint: even in the brightest twentieth of the image their "
            f"modulation is {bright:.1f} grey levels, {share:.1%} of full scale.",
            "Lengthen the exposure, open the lens, or move nearer; matt white spray on dark or "
            "glossy things. If nothing at all is seen: is the projector on, the lens cap off?",
            look.where,
            look.modulation,
            "modulation, grey levels",
        )


def _of_small_thing(look: Look) -> float:
    """Modulation, grey levels, of the median pixel that sees fringes; 0 where next to none does."""
    return float(np.median(look.modulation[look.lit])) if look.lit.mean() > LEAST_THING else 0.0


def _faded(look: Look, black: FloatMap, bright: float) -> bool:
    """Whether the projector's light would be enough, and blur takes the fringes out of it."""
    light = float(np.percentile(look.offset - black, BRIGHT_PERCENT))
    return light > max(2 * bright, DARK_SHARE * look.full_scale)


def find_ambient(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Light that is there while the projector shows black."""
    white, black = capture.white(), capture.black()
    if white is None or black is None or not looks:
        return
    level = capture.sensor.black_level
    lit = np.logical_or.reduce([look.lit | look.clipped for look in looks])
    if not lit.any():
        return
    ratio = (black - level) / np.maximum(white - level, 1)
    share = float(np.median(ratio[lit]))
    if share > AMBIENT_SHARE:
        look = looks[0]
        yield Suspicion(
            "ambient light",
            look.noise_px(),
            f"other light than the projector's makes {share:.0%} of the white frame: it takes the "
            "room that the fringes need, and flickers with the mains.",
            "Darken the room, shade the scene, or put a filter before the camera; expose for whole "
            "periods of the mains.",
            "black frame",
            np.where(lit, ratio, np.nan).astype(np.float32),
            "black frame over white frame",
        )
