"""Light that changes: from frame to frame (flicker), and from set to set (drift)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fringeworks.diagnose.frame_errors import FrameErrors
from fringeworks.diagnose.look import Look
from fringeworks.diagnose.suspicion import Suspicion
from fringeworks.diagnose.tiles import Tile
from fringeworks.model import Capture, FloatMap

LEAST_FLICKER = 0.008
"""Share, 1 sd, of the light from frame to frame; lamps have up to 0.005."""

FOUR_SEEN = 1.6
"""Four frames leave one number per pixel, which shows that part of their light's scatter."""

LEAST_EXPLAINED = 0.5
"""Of a set's residual beyond the noise that its frames' light must explain."""

LEAST_OFFSET_WAVE = 0.006
"""Wave of one period in the mean of three frames, share of their modulation: where their
light scatters by g it is about 0.4 g."""

LEAST_TILES = 12
SIGMAS = 6.0
"""Of the median over the tiles, by their scatter: shading is no flicker."""

LEAST_DRIFT = 0.03
"""Share by which the mean light of two sets of fringes may differ."""


def find_flicker(looks: Sequence[Look], errors: Mapping[int, FrameErrors]) -> Iterator[Suspicion]:
    """Sets of four frames or more in which the light of single frames is off."""
    for look in looks:
        found = errors.get(look.place)
        if found is None:
            continue
        seen = FOUR_SEEN if look.fringe.frame_count == 4 else 1.0
        spread = seen * float(np.std(found.gains))
        beyond_noise = max(found.power - look.noise**2, 0.0)
        if spread > LEAST_FLICKER and found.by_light * found.power > LEAST_EXPLAINED * beyond_noise:
            worst = int(np.argmax(np.abs(found.gains)))
            yield _flicker(look, spread, worst, found.light_rad, _rms(look.residual()))


def find_offset_wave(look: Look, tiles: Sequence[Tile]) -> Iterator[Suspicion]:
    """The same of three frames, which have no residual: their mean shows the fringes then."""
    waves = []
    for tile in tiles:
        y, x = tile.y, tile.x
        places = np.column_stack([np.ones_like(x), x - x.mean(), y - y.mean()]).astype(float)
        turned = look.phase[y, x]
        strength = look.modulation[y, x]
        bend = places[:, 1:] ** 2
        design = np.column_stack(
            [places, bend, strength * np.cos(turned), strength * np.sin(turned)]
        )
        solved, *_ = np.linalg.lstsq(design, look.offset[y, x].astype(float), rcond=None)
        waves.append(solved[-2:])
    if len(waves) < LEAST_TILES:
        return
    middle = np.median(waves, axis=0)
    scatter = float(np.median(np.abs(waves - middle))) / 0.6745
    wave = float(np.hypot(*middle))
    if wave > max(LEAST_OFFSET_WAVE, SIGMAS * scatter / np.sqrt(len(waves))):
        shade = np.where(look.lit, look.offset / np.maximum(look.modulation, 1), np.nan)
        visible = float(np.nanmedian(shade))
        yield _flicker(look, wave / 0.4, None, np.sqrt(2) * wave * visible, look.offset)


def _flicker(
    look: Look, spread: float, frame: int | None, rad: float, picture: FloatMap
) -> Suspicion:
    which = "" if frame is None else f", most in frame {frame + 1}"
    return Suspicion(
        "flicker",
        rad * look.fringe.period_px / (2 * np.pi),
        f"the light of {look.name} changes by {spread:.1%} from frame to frame{which}: the phase "
        f"is off by {rad:.3f} rad rms.",
        "Expose for whole periods of mains and projector (20 ms at 50 Hz), trigger the camera by "
        "the projector, let the lamp warm up, and darken the room.",
        look.where,
        np.where(look.lit, picture, np.nan).astype(np.float32),
        "grey levels that no sinusoid fits" if frame is not None else "mean of the frames",
    )


def find_drift(capture: Capture, looks: Sequence[Look]) -> Iterator[Suspicion]:
    """Sets of fringes, one after the other, that are lit differently as a whole."""
    for first, second in pairwise(looks):
        items = capture.sequence.sets[first.place], capture.sequence.sets[second.place]
        if items[0].exposure_ms != items[1].exposure_ms or not (first.enough and second.enough):
            continue
        both = first.lit & second.lit
        if np.count_nonzero(both) < 100:
            continue
        ratio = second.offset / np.maximum(first.offset, 1)
        change = float(np.median(ratio[both])) - 1
        if abs(change) > LEAST_DRIFT:
            rad = abs(change) / max(first.fringe.frame_count, 1)
            yield Suspicion(
                "light drift",
                rad * first.fringe.period_px / (2 * np.pi),
                f"{second.name} are {abs(change):.1%} {'brighter' if change > 0 else 'darker'} "
                f"than {first.name} before them.",
                "Let the lamp warm up, switch automatic exposure, gain and brightness off.",
                second.where,
                np.where(both, ratio, np.nan).astype(np.float32),
                "mean light of the later set over the earlier one",
            )


def _rms(residual: NDArray[np.float32]) -> FloatMap:
    return np.asarray(np.sqrt(np.mean(residual**2, axis=0)), np.float32)
