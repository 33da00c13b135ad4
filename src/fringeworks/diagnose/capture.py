"""All checks of one capture, and what they found in the order of its cost."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fringeworks.diagnose.blur import find_blur
from fringeworks.diagnose.epipolar import find_misses, mm_per_px
from fringeworks.diagnose.exposure import find_ambient, find_darkness, find_saturation
from fringeworks.diagnose.frame_errors import FrameErrors, fit_frame_errors
from fringeworks.diagnose.frames import find_misplaced, find_repeated
from fringeworks.diagnose.gray import find_margin
from fringeworks.diagnose.hypotheses import without_code_frames
from fringeworks.diagnose.interreflection import find_other_light
from fringeworks.diagnose.light import find_drift, find_flicker, find_offset_wave
from fringeworks.diagnose.look import Look, look_at, one_per_fringe
from fringeworks.diagnose.motion import find_moves, find_unrest
from fringeworks.diagnose.ripple import find_harmonic, find_ripple, tile_span
from fringeworks.diagnose.suspicion import Suspicion, lost_px
from fringeworks.diagnose.tiles import cut_tiles
from fringeworks.diagnose.unseen import find_unseen
from fringeworks.errors import FringeworksError
from fringeworks.model import Capture, Finding, FloatMap, ProjectorMap, Rig
from fringeworks.phase.decode import decode_phases
from fringeworks.phase.window import volume_of
from fringeworks.reconstruct.full import check_size

OF_WRONG_LIGHT = frozenset(
    {"gamma", "light drift", "blur", "gray margin", "motion", "flicker", "other light", "epipolar"}
)
"""What too much light imitates, or too little."""

OUTDONE: Mapping[str, frozenset[str]] = {
    "saturation": OF_WRONG_LIGHT,
    "too dark": OF_WRONG_LIGHT,
    "gamma": frozenset({"flicker", "light drift", "other light", "epipolar"}),
    "motion": frozenset({"gamma", "flicker", "light drift", "other light", "epipolar"}),
    "flicker": frozenset({"light drift", "gray margin", "other light", "epipolar"}),
    "blur": frozenset({"gray margin", "gamma", "other light", "epipolar"}),
    "gray margin": frozenset({"gamma", "epipolar"}),
    "axes swapped": frozenset({"epipolar"}),
}
"""What a fault makes look like faults that are none: those are not told beside it."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A finding with the picture ``(H, W)`` that shows it, and what its colours mean."""

    finding: Finding
    picture: FloatMap
    label: str


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What is wrong with a capture, the costliest first.

    Attributes
    ----------
    name
        Of the capture.
    found
        One per fault, sorted by cost.
    unseen
        What could not be looked for, with the reason.
    mm_per_px
        Depth that a projector px is worth; None without a rig, and then costs are projector px.
    """

    name: str
    found: tuple[Found, ...]
    unseen: tuple[str, ...]
    mm_per_px: float | None

    @property
    def findings(self) -> tuple[Finding, ...]:
        return tuple(item.finding for item in self.found)


def check_capture(
    capture: Capture, rig: Rig | None = None, *, group: str | None = None
) -> Diagnosis:
    """Look for every fault of `suspicion.FAULTS` in one group of a capture.

    A rig turns costs into mm and adds the epipolar check. A capture that cannot be decoded is
    checked as far as its frames go.

    Raises
    ------
    ShapeError
        The capture is not of the size of the rig's camera.
    UsageError
        There is no such group.
    """
    chosen = capture.select(group)
    looks = look_at(chosen)
    decoded, refusal = _decode(chosen, rig)
    if rig is not None and decoded is not None:
        check_size(decoded, rig)
    worth = None if rig is None or decoded is None else mm_per_px(decoded, rig)
    suspected = list(_suspect(chosen, looks, decoded, rig))
    if refusal and not suspected:
        suspected.append(_not_decodable(chosen, refusal))
    kept = _one_of_each(_not_outdone(suspected))
    found = tuple(_found(item, worth) for item in kept)
    return Diagnosis(capture.name, found, tuple(find_unseen(chosen, looks, decoded, rig)), worth)


def _decode(capture: Capture, rig: Rig | None) -> tuple[ProjectorMap | None, str]:
    """The coordinates; or, where there should be some and are none, the reason.

    A code frame is read inside the rig's volume, and left out without one.
    """
    bare = without_code_frames(capture)
    volume = volume_of(rig) if rig is not None and bare is not capture else None
    readable = bare if volume is None else capture
    try:
        decoding = decode_phases(readable, volume=volume)
        if not decoding.coded:
            return None, ""
        return decoding.projector_map(), ""
    except FringeworksError as error:
        return None, str(error)


def _not_decodable(capture: Capture, refusal: str) -> Suspicion:
    extent = max(capture.sequence.width, capture.sequence.height)
    spread = [stack.std(axis=0, dtype=np.float32) for stack in capture.frames if stack.ndim == 3]
    return Suspicion(
        "not decodable",
        lost_px(1.0, extent),
        f"no check names the cause, but nothing can be decoded: {refusal.rstrip('.')}.",
        "Look at the images themselves, and at what capture.toml says of them.",
        "capture",
        np.max(spread, axis=0) if spread else np.full(capture.shape, np.nan, np.float32),
        "largest spread of a set's frames, grey levels",
    )


def _suspect(
    capture: Capture, looks: Sequence[Look], decoded: ProjectorMap | None, rig: Rig | None
) -> Iterator[Suspicion]:
    """Frames first: where they are not what they are listed as, nothing else can be told."""
    frames = [*find_repeated(capture, looks)] or [*find_misplaced(capture, looks)]
    yield from frames
    if frames:
        return
    yield from find_saturation(capture, looks)
    yield from find_darkness(capture, looks)
    best = one_per_fringe(looks, lambda look: float(look.lit.mean()))
    errors = {look.place: found for look in best if (found := fit_frame_errors(look))}
    yield from find_ambient(capture, best)
    yield from find_blur(capture, best)
    yield from find_margin(capture, best)
    yield from find_flicker(best, errors)
    yield from find_drift(capture, best)
    yield from find_moves(capture, best)
    yield from find_unrest(best, errors)
    yield from find_harmonic(best, errors)
    if decoded is not None:
        yield from _of_surfaces(best, errors, decoded)
        yield from find_other_light(capture, decoded)
        yield from () if rig is None else find_misses(decoded, rig)


def _of_surfaces(
    looks: Sequence[Look], errors: Mapping[int, FrameErrors], decoded: ProjectorMap
) -> Iterator[Suspicion]:
    """What is seen against surfaces that are smooth, tile by tile."""
    for axis in decoded.axes:
        if axis.phase is None:
            continue
        yield from find_ripple(axis, cut_tiles(axis, span_px=tile_span(axis)))
        fringe = axis.phase.wrapped.fringe
        wide = cut_tiles(axis, span_px=2 * fringe.period_px)
        for look in looks:
            if look.fringe == fringe and look.place not in errors:
                yield from find_offset_wave(look, wide)


def _not_outdone(suspected: Sequence[Suspicion]) -> list[Suspicion]:
    names = {item.name for item in suspected}
    hidden: set[str] = set()
    for name, others in OUTDONE.items():
        if name in names - hidden:
            hidden |= others
    return [item for item in suspected if item.name not in hidden]


def _one_of_each(suspected: Iterable[Suspicion]) -> list[Suspicion]:
    """The costliest of each name, costliest first."""
    best: dict[str, Suspicion] = {}
    for item in suspected:
        if item.name not in best or item.cost_px > best[item.name].cost_px:
            best[item.name] = item
    return sorted(best.values(), key=lambda item: -item.cost_px)


def _found(item: Suspicion, worth: float | None) -> Found:
    cost = float(item.cost_px) if worth is None else float(item.cost_px * worth)
    finding = Finding(
        "warning",
        item.message,
        item.remedy,
        name=item.name,
        cost=cost if np.isfinite(cost) else None,
        unit="px" if worth is None else "mm",
        where=item.where,
    )
    return Found(finding, item.picture, item.label)
