"""From a few test frames: exposures, period and steps to take, and what to change before."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fringeworks.diagnose.advice_blur import (
    Blur,
    Ratio,
    best_even_period,
    compare_periods,
    measure_blurs,
    noise_over_least,
    transfer_of,
)
from fringeworks.diagnose.advice_complaints import (
    Complaint,
    find_defocus,
    find_gloss,
    find_light,
)
from fringeworks.diagnose.advice_light import (
    WANTED_COVERAGE,
    Ladder,
    Reach,
    choose_ladder,
    find_reach,
    noise_of,
)
from fringeworks.diagnose.advice_projector import find_scaling, find_sharpening
from fringeworks.diagnose.advice_steps import Steps, choose_steps, find_gamma
from fringeworks.diagnose.look import Look, look_at
from fringeworks.errors import DecodeError, UsageError
from fringeworks.model import Axis, Capture, FloatMap, Fringe

USUAL_PERIOD_PX = 16.0
"""Of preset measure: taken where no frame tells the blur."""

WANTED_SIGMA_PX = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Advice:
    """What to take next.

    Attributes
    ----------
    name
        Of the capture with the test frames.
    width, height
        Of the projector, px.
    ladder
        One exposure or several.
    blurs
        Of each axis whose frames told it.
    period_px
        The even number above 2 pi times the larger blur; that of preset measure without a blur.
    noise_loss
        Noise at that period over the least, less one; None without a blur.
    steps
        How many, and why.
    complaints
        What to change before.
    sight
        ``(H, W)``: the exposure's number, 1 the shortest, that sees a lit pixel best, 0 none, NaN
        where no fringes fall.
    """

    name: str
    width: int
    height: int
    ladder: Ladder
    blurs: Mapping[Axis, Blur]
    period_px: float
    noise_loss: float | None
    steps: Steps
    complaints: tuple[Complaint, ...]
    sight: FloatMap


def advise(
    capture: Capture,
    *,
    group: str | None = None,
    exposure_ms: float | None = None,
    mains_hz: float = 50.0,
    wanted_px: float = WANTED_SIGMA_PX,
) -> Advice:
    """What to take next, from test frames: one set of fringes or more, best with white and black.

    Parameters
    ----------
    exposure_ms
        Of the test frames, where the capture does not say.
    mains_hz
        Frequency of the mains, in whose half periods exposures are counted where light flickers.
    wanted_px
        Standard deviation of the coordinate, projector px, that the steps shall keep.

    Raises
    ------
    DecodeError
        There are no fringes, or none that could be seen.
    UsageError
        There is no such group; or the capture says another exposure than `exposure_ms`.
    """
    chosen = _at_best_exposure(capture.select(group))
    looks = look_at(chosen)
    coarse = _coarsest(chosen, looks)
    ratios = compare_periods(chosen, looks)
    blurs = measure_blurs(chosen, looks)
    sigma = max((blur.sigma_px for blur in blurs.values()), default=0.0)
    period = best_even_period(sigma) if sigma > 0 else USUAL_PERIOD_PX
    complaints = tuple(_complaints(chosen, looks, coarse, ratios=ratios, blurs=blurs))
    transfer = transfer_of(sigma, period)
    reach = find_reach(chosen, coarse, transfer=transfer)
    taken = _exposure_of(chosen, coarse, exposure_ms)
    flickers = any(item.name == "flicker" for item in complaints)
    ladder = choose_ladder(
        reach, exposure_ms=taken, half_period_ms=500 / mains_hz if flickers else None
    )
    complaints += tuple(_uncovered(reach, ladder))
    noise = _noise_of_one_step(reach, ladder, noise_of(coarse, chosen.sensor))
    steps = choose_steps(
        noise_px=noise * period / transfer,
        gamma=find_gamma(looks),
        period_px=period,
        sigma_px=sigma,
        wanted_px=wanted_px,
    )
    return Advice(
        capture.name,
        chosen.sequence.width,
        chosen.sequence.height,
        ladder,
        blurs,
        period,
        noise_over_least(period, sigma) - 1 if sigma > 0 else None,
        steps,
        complaints,
        _sight(reach, ladder),
    )


def _at_best_exposure(capture: Capture) -> Capture:
    """Of frames at several exposures those that see most pixels."""
    sets = capture.sequence.sets
    exposures = {item.exposure_ms for item in sets if isinstance(item.pattern, Fringe)}
    if len(exposures) < 2:
        return capture

    def only(exposure_ms: float | None) -> Capture:
        kept = [n for n, item in enumerate(sets) if item.exposure_ms == exposure_ms]
        sequence = replace(capture.sequence, sets=tuple(sets[n] for n in kept))
        return replace(capture, sequence=sequence, frames=tuple(capture.frames[n] for n in kept))

    def seen(alone: Capture) -> int:
        return max(int(np.count_nonzero(look.lit)) for look in look_at(alone))

    return max(map(only, exposures), key=seen)


def _exposure_of(capture: Capture, look: Look, told_ms: float | None) -> float | None:
    """That of the test, ms, by the capture or by who asks."""
    said = capture.sequence.sets[look.place].exposure_ms
    if said is not None and told_ms is not None and said != told_ms:
        raise UsageError(
            f"exposure_ms must be the {said:g} of {capture.name}'s own capture.toml, or left out, "
            f"got {told_ms:g}"
        )
    return said or told_ms


def _coarsest(capture: Capture, looks: Sequence[Look]) -> Look:
    """The fringes that blur takes least from."""
    if not looks:
        kinds = ", ".join(sorted({type(item.pattern).__name__ for item in capture.sequence.sets}))
        raise DecodeError(
            f"{capture.name} has no fringes to advise from (its sets: {kinds}); take the frames of "
            "`fringeworks patterns test`"
        )
    look = max(looks, key=lambda item: item.fringe.period_px)
    if not (look.lit | look.clipped).any():
        raise DecodeError(
            f"{capture.name}: no pixel sees the {look.name}; lengthen the exposure, and see that "
            "the camera looks where the projector shines"
        )
    return look


def _complaints(
    capture: Capture,
    looks: Sequence[Look],
    coarse: Look,
    *,
    ratios: Sequence[Ratio],
    blurs: Mapping[Axis, Blur],
) -> Iterator[Complaint]:
    """Unsteady or clipped light makes modulation beat too: scaling is not looked for in it."""
    light = [*find_light(capture, looks, coarse)]
    yield from light
    yield from find_gloss(capture, coarse)
    yield from find_defocus(capture, looks, {axis: b.sigma_px for axis, b in blurs.items()})
    yield from find_sharpening(capture, looks, ratios)
    if not {item.name for item in light} & {"flicker", "saturation"}:
        yield from find_scaling(ratios)


def _uncovered(reach: Reach, ladder: Ladder) -> Iterator[Complaint]:
    if ladder.coverage >= WANTED_COVERAGE:
        return
    unknown = float(np.mean(reach.longest[reach.lit] == 0)) if reach.lit.any() else 0.0
    yield Complaint(
        "range",
        f"the exposures proposed see {ladder.coverage:.0%} of the lit pixels; {unknown:.0%} are "
        "saturated in so many test frames that nothing tells how bright they are.",
        "Take the test again at a quarter of the exposure, then follow its advice."
        if unknown > 1 - WANTED_COVERAGE
        else "Spray what is darkest or brightest matt, or measure the rest without it.",
        "test frames",
        np.where(reach.lit, reach.longest, np.nan).astype(np.float32),
        "longest exposure, times the test's",
    )


def _noise_of_one_step(reach: Reach, ladder: Ladder, noise: float) -> float:
    """Noise, periods, that one step leaves the median pixel at the exposure that sees it best.

    ``sqrt(2) sigma_I / (2 pi B)``; `noise` is that of the test, and grows with the root of the
    exposure, as light's own does.
    """
    brightest = np.zeros(reach.lit.shape)
    for factor in ladder.factors:
        brightest[reach.longest >= factor] = factor
    seen = reach.lit & (brightest > 0)
    if not seen.any():
        return math.nan
    light = float(np.median(reach.modulation[seen] * np.sqrt(brightest[seen])))
    return math.sqrt(2) * noise / (2 * math.pi * max(light, 1e-6))


def _sight(reach: Reach, ladder: Ladder) -> FloatMap:
    best = np.where(reach.lit, 0, np.nan).astype(np.float32)
    for number, factor in enumerate(ladder.factors, start=1):
        sees = reach.lit & (reach.shortest <= factor) & (factor <= reach.longest)
        best[sees] = number
    return best
