"""Write a capture: images first, ``capture.toml`` last, so that half a capture is none."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fringeworks.errors import ShapeError, UsageError
from fringeworks.files.atomic import write_text
from fringeworks.files.capture import CAPTURE_TOML, parse_capture
from fringeworks.files.capture_schema import CAPTURE_FORMAT
from fringeworks.files.images import write_image
from fringeworks.files.system import told
from fringeworks.files.toml import lay_out_toml
from fringeworks.model.capture import Capture, Frames, Sensor
from fringeworks.model.progress import Progress, no_progress
from fringeworks.model.sequence import (
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    PatternSet,
    Picture,
    Sequence,
    Speckle,
    Staircase,
    Uniform,
)
from fringeworks.patterns import frame_names

KINDS: dict[type[Pattern], str] = {
    Fringe: "fringe",
    GrayCode: "gray",
    Uniform: "uniform",
    Codeword: "codeword",
    Checkerboard: "checkerboard",
    Staircase: "staircase",
    Colour: "colour",
    Speckle: "speckle",
    Picture: "image",
}


def write_capture(
    capture: Capture,
    folder: str | Path,
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write a capture's PNG images and ``capture.toml`` into `folder`; see `write_sequence`.

    The colours, where there are any, stand in the first files of the white and the black set
    (`Sequence.white_set`), and nowhere without one.
    """
    return write_sequence(
        capture.sequence,
        _images(capture),
        folder,
        sensor=capture.sensor,
        provenance=capture.provenance,
        overwrite=overwrite,
        progress=progress,
    )


def write_sequence(
    sequence: Sequence,
    stacks: Iterable[Items[Frames]],
    folder: str | Path,
    *,
    sensor: Sensor | None = None,
    provenance: Mapping[str, Any] | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write the images of each set, then the ``capture.toml`` that describes them.

    `stacks` yields the frames of one set after the other, ``(n, H, W[, 3])`` or a list; only
    one set need be in memory. A capture that is already there is only replaced with
    `overwrite`; its description goes first, so that no moment pairs old words with new images.
    Returns the path of ``capture.toml``.

    Raises
    ------
    UsageError
        `folder` holds a capture and `overwrite` is False, or the sequence is one that
        `read_capture` would refuse.
    ShapeError
        There are more or fewer stacks than sets, or a stack has not the set's number of images.
        What was written until then has no ``capture.toml``.
    FormatError
        A file cannot be written.
    """
    target = Path(folder) / CAPTURE_TOML
    text = describe_capture(sequence, sensor=sensor, provenance=provenance)
    make_room(target.parent, overwrite=overwrite)
    names, sources = frame_names(sequence), iter(stacks)
    for place in (progress or no_progress)(range(len(names)), "writing images"):
        images = _next_images(sources, place, expected=len(names[place]), sets=len(names))
        for name, image in zip(names[place], images, strict=True):
            write_image(target.parent / name, image)
    if next(sources, None) is not None:
        raise ShapeError(f"stacks must hold one per set, {len(names)}, got more")
    write_text(target, text)
    return target


def _next_images(
    sources: Iterator[Items[Frames]], place: int, *, expected: int, sets: int
) -> Items[Frames]:
    images = next(sources, None)
    if images is None:
        raise ShapeError(f"stacks must hold one per set, {sets}, got {place}")
    if len(images) != expected:
        raise ShapeError(f"stack {place + 1} must hold {expected} images, got {len(images)}")
    return images


def describe_capture(
    sequence: Sequence,
    *,
    sensor: Sensor | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> str:
    """Text of the ``capture.toml`` whose images are called `patterns.frame_names`.

    Raises
    ------
    UsageError
        A sequence that `read_capture` would refuse, or a provenance that TOML cannot hold.
    """
    document: dict[str, Any] = {
        "format": CAPTURE_FORMAT,
        "projector": {"width": sequence.width, "height": sequence.height},
    }
    if sensor is not None:
        document["camera"] = _given(asdict(sensor))
    if provenance:
        document["provenance"] = dict(provenance)
    names = frame_names(sequence)
    document["set"] = [
        _describe_set(item, row) for item, row in zip(sequence.sets, names, strict=True)
    ]
    return lay_out_toml(
        document, lambda again: parse_capture(again, Path(CAPTURE_TOML)), what="capture"
    )


def make_room(folder: Path, *, overwrite: bool) -> None:
    """Have no capture in `folder`: one that is there goes with `overwrite`, its images stay.

    Raises
    ------
    UsageError
        `folder` holds a capture and `overwrite` is False, or is no folder (`check_folder`).
    FormatError
        The capture cannot be removed.
    """
    check_folder(folder)
    target = folder / CAPTURE_TOML
    if not overwrite and target.exists():
        raise UsageError(
            f"{folder}: holds a capture already; choose another folder or overwrite it"
        )
    with told(target, "replaced"):
        target.unlink(missing_ok=True)


def check_folder(folder: Path) -> None:
    """Refuse what is no folder and cannot become one.

    Raises
    ------
    UsageError
        It, or what it would stand in, is a file.
    FormatError
        Its name is none that the system knows.
    """
    with told(folder, "written"):
        there = next((path for path in (folder, *folder.parents) if path.exists()), folder)
        if there.exists() and not there.is_dir():
            raise UsageError(f"{there}: must be a folder, but is a file")


def _images(capture: Capture) -> list[list[Frames]]:
    """All frames; the first one of the white and of the black set in colour where there is one."""
    images = [list(stack) for _, stack in capture]
    white, black = capture.sequence.white_set, capture.sequence.black_set
    for uniform, colour in ((white, capture.colour), (black, capture.dark_colour)):
        if colour is not None and uniform is not None:
            images[uniform][0] = colour
    return images


def _describe_set(item: PatternSet, names: Items[str]) -> dict[str, Any]:
    table = {"kind": KINDS[type(item.pattern)], **_describe_pattern(item.pattern)}
    if item.repeats != 1:
        table["repeats"] = item.repeats
    further = _given(
        {
            "group": item.group,
            "exposure_ms": item.exposure_ms,
            "timestamps_s": None if item.timestamps_s is None else list(item.timestamps_s),
        }
    )
    return {**table, **further, **_describe_images(item, names)}


def _describe_pattern(pattern: Pattern) -> dict[str, Any]:
    """Keys of a pattern: its fields under the same names, angles in degrees."""
    fields = asdict(pattern)
    if isinstance(pattern, Picture):
        return {}
    for counted in ("bits", "inverted", "complementary") if isinstance(pattern, GrayCode) else ():
        del fields[counted]
    if "shifts_rad" in fields:
        fields["shifts_deg"] = [_degrees(value) for value in fields.pop("shifts_rad")]
    return _given(
        {key: list(value) if isinstance(value, tuple) else value for key, value in fields.items()}
    )


def _describe_images(item: PatternSet, given: Items[str]) -> dict[str, Any]:
    names = list(given)
    if not isinstance(item.pattern, GrayCode):
        return {"images": names}
    bits = item.pattern.bits * item.repeats
    halves = bits + item.pattern.complementary * item.repeats
    complement = names[bits:halves]
    return _given(
        {
            "images": names[:bits],
            "complementary": complement[0] if len(complement) == 1 else complement or None,
            "inverted": names[halves:] or None,
        }
    )


def _given(table: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in table.items() if value is not None}


def _degrees(radians: float) -> float:
    """The shortest decimal number of degrees that is this angle to within rounding."""
    degrees = math.degrees(radians)
    for digits in range(6, 15):
        short = round(degrees, digits)
        if math.isclose(math.radians(short), radians, rel_tol=4e-16, abs_tol=1e-300):
            return short
    return degrees
