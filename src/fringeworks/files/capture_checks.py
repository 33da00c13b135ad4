"""What the keys of ``capture.toml`` must agree on; cheap, and before any image is opened.

Each check yields sentences, so that one reading tells everything that is wrong.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from fringeworks.errors import FormatError
from fringeworks.files.capture_schema import (
    CaptureFile,
    CodewordSet,
    FringeSet,
    GraySet,
    ImageSet,
    ProjectorTable,
    StaircaseSet,
)
from fringeworks.files.validation import format_problems
from fringeworks.model.finding import Finding
from fringeworks.model.sequence import gray_bits, pixel_on_edge

MIN_CONDITION = 1e-3
"""Smallest over largest singular value of the shifts' design matrix that is still solvable."""


def check_sets(file: CaptureFile, path: Path) -> None:
    """Raise a FormatError that lists what is wrong within sets and between them."""
    problems = [
        f"{place(index, item)}: {problem}"
        for index, item in enumerate(file.set)
        for check in (*_OF_EVERY_SET, *_OF_KIND.get(type(item), ()))
        for problem in check(item, file)
    ]
    if problems:
        raise FormatError(format_problems(path, problems))


def place(index: int, item: ImageSet) -> str:
    """How messages call a set: counted from 1, with its kind."""
    return f"set {index + 1} ({_kind(item)})"


def notice_spare_bits(file: CaptureFile) -> list[Finding]:
    """A note for each Gray code with more bits than the projector needs."""
    found = []
    for index, item in enumerate(file.set):
        if isinstance(item, GraySet):
            bits, needed = _bits(item), _needed_bits(item, file.projector)
            if bits > needed:
                found.append(
                    Finding(
                        "note",
                        f"{place(index, item)}: {bits} bits where {needed} cover the projector; "
                        "the first ones must be dark everywhere.",
                        "Check projector size and cell_px if the decode looks wrong.",
                    )
                )
    return found


def _kind(item: ImageSet) -> str:
    return str(getattr(item, "kind", "set"))


def _check_counts(item: ImageSet, _: CaptureFile) -> Iterator[str]:
    repeats = f" x {item.repeats} repeats" if item.repeats > 1 else ""
    if isinstance(item, GraySet):
        yield from _check_gray_counts(item)
        return
    expected = item.pattern().frame_count * item.repeats
    if len(item.images) != expected:
        shifts = getattr(item, "shifts_deg", None)
        why = f"{len(shifts)} shifts{repeats}" if shifts else f"1 frame{repeats}"
        if _kind(item) == "image":
            why = f"a multiple of {item.repeats} repeats"
        yield f"images must be {expected} ({why}), got {len(item.images)}"


def _check_gray_counts(item: GraySet) -> Iterator[str]:
    if len(item.images) % item.repeats:
        yield f"images must be a multiple of repeats = {item.repeats}, got {len(item.images)}"
    if item.inverted is not None and len(item.inverted) != len(item.images):
        yield f"inverted must be as many as images, {len(item.images)}, got {len(item.inverted)}"
    if item.complementary is not None and len(item.complementary_images()) != item.repeats:
        given = len(item.complementary_images())
        yield f"complementary must be {item.repeats} (one per repeat), got {given}"


def _check_duplicates(item: ImageSet, _: CaptureFile) -> Iterator[str]:
    twice = [name for name, count in Counter(item.all_images()).items() if count > 1]
    if twice:
        yield f"image '{twice[0]}' is used {item.all_images().count(twice[0])} times"


def _check_timestamps(item: ImageSet, _: CaptureFile) -> Iterator[str]:
    given, images = item.timestamps_s, len(item.all_images())
    if given is not None and len(given) != images:
        yield f"timestamps_s must be one per image, {images}, got {len(given)}"


def _check_shifts(item: ImageSet, _: CaptureFile) -> Iterator[str]:
    """N >= 3 shifts that separate offset, cosine and sine."""
    assert isinstance(item, FringeSet | StaircaseSet)
    shifts = np.radians(item.shifts_deg)
    if len(shifts) < 3:
        yield f"shifts_deg must be at least 3 shifts, got {len(shifts)}"
        return
    design = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    values = np.linalg.svd(design, compute_uv=False)
    if values[-1] < MIN_CONDITION * values[0]:
        yield (
            f"shifts_deg must hold three that differ clearly modulo 360, got {item.shifts_deg[:12]}"
        )


def _bits(item: GraySet) -> int:
    return len(item.images) // item.repeats


def _needed_bits(item: GraySet, projector: ProjectorTable) -> int:
    return gray_bits(_extent(item.axis, projector), item.cell_px)


def _extent(axis: str, projector: ProjectorTable) -> int:
    return projector.width if axis == "x" else projector.height


def _check_bits(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    assert isinstance(item, GraySet)
    bits, needed = _bits(item), _needed_bits(item, file.projector)
    if bits < needed:
        yield (
            f"{bits} bits of {item.cell_px:g} px cells cover {2**bits * item.cell_px:g} px, but "
            f"the projector has {_extent(item.axis, file.projector)} along {item.axis}: "
            f"{needed} bits are needed; are images missing, or is projector size or cell_px wrong?"
        )


def _check_gray_edges(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    assert isinstance(item, GraySet)
    step = item.cell_px if item.complementary is None else item.cell_px / 2
    extent = _extent(item.axis, file.projector)
    met = pixel_on_edge(extent, step)
    if met is not None:
        kind = "cells" if item.complementary is None else "half cells (complementary)"
        yield (
            f"{kind} of {step:g} px put an edge on the pixel centre {item.axis} = {met}; "
            f"use a cell_px that is a whole{'' if item.complementary is None else ', even'} number"
        )


def _check_code_edges(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    """Codewords change half a period from zero: an odd period changes on a pixel centre."""
    assert isinstance(item, CodewordSet)
    extent = _extent(item.axis, file.projector)
    met = pixel_on_edge(extent, item.period_px, edge_px=item.zero_px + item.period_px / 2)
    if met is not None:
        yield (
            f"period_px = {item.period_px:g} with zero_px = {item.zero_px:g} changes codeword on "
            f"the pixel centre {item.axis} = {met}; use an even period and zero_px = -0.5"
        )


def _check_code_sequence(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    assert isinstance(item, CodewordSet)
    if item.sequence is None:
        return
    last = len(item.codewords_px) - 1
    wrong = [index for index in item.sequence if not 0 <= index <= last]
    if wrong:
        yield f"sequence must be indices into codewords_px, 0 to {last}, got {wrong[0]}"
    orders = [_order(item, 0), _order(item, _extent(item.axis, file.projector) - 1)]
    if orders[0] < 0:
        yield f"sequence starts at fringe order 0, but zero_px = {item.zero_px:g} makes lower ones"
    elif orders[1] >= len(item.sequence):
        yield (
            f"sequence must give a codeword for each fringe order, 0 to {orders[1]}, "
            f"got {len(item.sequence)} entries"
        )


def _order(item: CodewordSet, pixel: int) -> int:
    """Fringe k spans phases in (2 pi k - pi, 2 pi k + pi]."""
    return math.ceil((pixel - item.zero_px) / item.period_px - 0.5)


def _check_code_fringes(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    assert isinstance(item, CodewordSet)
    for group in _groups_of(item, file):
        fringes = [
            other
            for other in file.set
            if isinstance(other, FringeSet) and other.group in (None, group)
        ]
        if not any(_carries(fringe, item) for fringe in fringes):
            within = f" in group '{group}'" if group is not None else ""
            yield (
                "the code frame is read along the wrapped phase of fringes with "
                f"axis '{item.axis}', period_px = {item.period_px:g}, zero_px = {item.zero_px:g}: "
                f"no such set{within}"
            )


def _groups_of(item: ImageSet, file: CaptureFile) -> list[str | None]:
    """Groups that a set is used in; a set without one is used in all."""
    if item.group is not None:
        return [item.group]
    return list(dict.fromkeys(one.group for one in file.set if one.group is not None)) or [None]


def _carries(fringe: FringeSet, code: CodewordSet) -> bool:
    return (
        fringe.axis == code.axis
        and math.isclose(fringe.period_px, code.period_px, rel_tol=1e-9)
        and math.isclose(fringe.zero_px, code.zero_px, abs_tol=1e-9)
    )


Check = Callable[[ImageSet, CaptureFile], Iterator[str]]

_OF_EVERY_SET: tuple[Check, ...] = (_check_counts, _check_duplicates, _check_timestamps)
_OF_KIND: dict[type[ImageSet], tuple[Check, ...]] = {
    FringeSet: (_check_shifts,),
    StaircaseSet: (_check_shifts,),
    GraySet: (_check_bits, _check_gray_edges),
    CodewordSet: (_check_code_edges, _check_code_sequence, _check_code_fringes),
}
