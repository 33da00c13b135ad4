"""What the keys of ``capture.toml`` must agree on; cheap, and before any image is opened.

Each check yields sentences, so that one reading tells everything that is wrong.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath

from fringeworks.errors import FormatError, UsageError
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
from fringeworks.model.sequence import gray_bits
from fringeworks.patterns.checks import check_coding, has_carrier


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
    for name, count in Counter(_names(item)).items():
        if count > 1:
            yield f"image '{name}' is used {count} times"
            return


def _names(item: ImageSet) -> list[str]:
    """Image names, in the one way of writing that all ways to one file share."""
    return [str(PurePosixPath(name)) for name in item.all_images()]


def _check_shared(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    """An image that two sets decode would be two patterns at once."""
    mine = _names(item)
    for index, other in _earlier(item, file):
        shared = set(mine) & set(_names(other)) if isinstance(other, _CODED) else ()
        if shared:
            name = next(name for name in mine if name in shared)
            yield f"image '{name}' is in {place(index, other)} as well, which shows another pattern"


def _check_gray_twice(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    assert isinstance(item, GraySet)
    for index, other in _earlier(item, file):
        if isinstance(other, GraySet) and _shown_as(other) == _shown_as(item):
            yield (
                f"Gray codes with axis '{item.axis}', cell_px = {item.cell_px:g} stand twice in "
                f"one group, here and in {place(index, other)}; give them different groups, or "
                "each the `exposure_ms` it was taken with"
            )


def _shown_as(item: GraySet) -> tuple[str, float, float | None]:
    """What two Gray codes of one group may not share: at other exposures they are one code."""
    return item.axis, item.cell_px, item.exposure_ms


def _earlier(item: ImageSet, file: CaptureFile) -> Iterator[tuple[int, ImageSet]]:
    """Sets before this one, with their index, that are decoded together with it."""
    for index, other in enumerate(file.set):
        if other is item:
            return
        if other.group == item.group or None in (other.group, item.group):
            yield index, other


def _check_timestamps(item: ImageSet, _: CaptureFile) -> Iterator[str]:
    given, images = item.timestamps_s, len(item.all_images())
    if given is not None and len(given) != images:
        yield f"timestamps_s must be one per image, {images}, got {len(given)}"


def _check_coding(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    """What `patterns` refuses to draw could not be decoded either: its rules, in its words."""
    try:
        check_coding(item.pattern(), width=file.projector.width, height=file.projector.height)
    except UsageError as error:
        few = isinstance(item, GraySet) and _bits(item) < _needed_bits(item, file.projector)
        hint = "; are images missing, or is projector size or cell_px wrong?" if few else ""
        yield f"{error}{hint}"


def _bits(item: GraySet) -> int:
    return len(item.images) // item.repeats


def _needed_bits(item: GraySet, projector: ProjectorTable) -> int:
    return gray_bits(_extent(item.axis, projector), item.cell_px)


def _extent(axis: str, projector: ProjectorTable) -> int:
    return projector.width if axis == "x" else projector.height


def _check_code_fringes(item: ImageSet, file: CaptureFile) -> Iterator[str]:
    assert isinstance(item, CodewordSet)
    for group in _groups_of(item, file):
        shown = (other.pattern() for other in file.set if other.group in (None, group))
        if not has_carrier(item.pattern(), shown):
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


Check = Callable[[ImageSet, CaptureFile], Iterator[str]]

_OF_EVERY_SET: tuple[Check, ...] = (
    _check_counts,
    _check_duplicates,
    _check_timestamps,
    _check_coding,
)
_CODED = (FringeSet, GraySet, CodewordSet, StaircaseSet)
_OF_KIND: dict[type[ImageSet], tuple[Check, ...]] = {
    FringeSet: (_check_shared,),
    GraySet: (_check_shared, _check_gray_twice),
    CodewordSet: (_check_shared, _check_code_fringes),
    StaircaseSet: (_check_shared,),
}
