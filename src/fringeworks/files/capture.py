"""Read a capture: a folder of images with a ``capture.toml`` that says what each one shows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from collections.abc import Sequence as Items
from pathlib import Path
from typing import Any

import numpy as np

from fringeworks.errors import FormatError
from fringeworks.files.capture_checks import check_sets, notice_spare_bits, place
from fringeworks.files.capture_images import (
    ImageFile,
    check_memory,
    decode_stacks,
    equal_frames,
    inspect_images,
    locate_images,
)
from fringeworks.files.capture_schema import CAPTURE_FORMAT, CameraTable, CaptureFile
from fringeworks.files.images import decode_image
from fringeworks.files.system import told
from fringeworks.files.validation import check_format, read_toml, validated
from fringeworks.model.capture import Capture, Frames, Sensor
from fringeworks.model.finding import Finding
from fringeworks.model.progress import Progress, no_progress
from fringeworks.model.sequence import Colour, Fringe, GrayCode, Pattern, PatternSet, Sequence
from fringeworks.patterns.checks import has_hues

CAPTURE_TOML = "capture.toml"

FULL_SCALES = (1023.0, 4095.0, 16383.0, 65535.0)
"""Grey levels of saturation that 16 bit images may have: 10, 12, 14 and 16 bit sensors."""


def read_capture(
    folder_or_toml: str | Path, *, group: str | None = None, progress: Progress | None = None
) -> Capture:
    """The sets of one group of a capture, as grey levels.

    Everything cheap is checked first, for all groups: the description, that each image exists
    inside the folder, its header. Only then are the images of `group` (None: the first there
    is) decoded, 8 or 16 bit, as they are in the file; colour becomes its luma, but for that of
    `Colour` sets and of the white and the black one (`Sequence.white_set`), which is kept.
    `progress` wraps the iteration over images.

    Raises
    ------
    FormatError
        The capture cannot be used; the message names file, set and key.
    UsageError
        The capture has no `group` of that name.
    """
    path = find_description(Path(folder_or_toml))
    folder = path.parent
    file = parse_capture(read_toml(path), path)
    sequence = describe_sequence(file)
    chosen = sequence.choose_group(group)
    images = _find_images(folder, file)
    used = [images[index] for index in chosen]
    check_memory(folder, [image for row in used for image in row])
    used_sequence = Sequence(
        sequence.width, sequence.height, tuple(sequence.sets[i] for i in chosen)
    )
    in_colour = _seen_in_colour(used_sequence, used)
    frames = decode_stacks(used, progress or no_progress, in_colour=in_colour)
    sensor, found = _sensor(file.camera, frames, path)
    return Capture(
        sequence=used_sequence,
        frames=frames,
        sensor=sensor,
        colour=_colour_of(used_sequence.white_set, used),
        dark_colour=_colour_of(used_sequence.black_set, used),
        name=folder.resolve().name,
        findings=(
            *notice_spare_bits(file),
            *_notice_images(used, file, chosen),
            *_notice_equal_frames(frames, file, chosen),
            *found,
            *_notice_half_noise(file.camera),
        ),
        provenance=file.provenance,
    )


def parse_capture(document: dict[str, Any], path: Path) -> CaptureFile:
    """A parsed ``capture.toml``, checked in itself; no image is looked at."""
    check_format(document, CAPTURE_FORMAT, path)
    file = validated(CaptureFile, document, path)
    check_sets(file, path)
    return file


def describe_sequence(file: CaptureFile) -> Sequence:
    """The nouns of all sets, of every group."""
    sets = tuple(
        PatternSet(
            pattern=item.pattern(),
            group=item.group,
            exposure_ms=item.exposure_ms,
            repeats=item.repeats,
            timestamps_s=None if item.timestamps_s is None else tuple(item.timestamps_s),
        )
        for item in file.set
    )
    return Sequence(file.projector.width, file.projector.height, sets)


def find_description(path: Path) -> Path:
    """The ``capture.toml`` of a folder, or `path` itself where it is a file.

    Raises
    ------
    FormatError
        There is none.
    """
    with told(path, "read"):
        if path.is_file():
            return path
        if not path.exists():
            raise FormatError(f"{path}: no such file or folder")
        described = (path / CAPTURE_TOML).is_file()
    if not described:
        raise FormatError(
            f"{path}: no {CAPTURE_TOML} in this folder; it says what each image shows (see "
            "docs/formats.md), and `fringeworks patterns` writes one with its patterns"
        )
    return path / CAPTURE_TOML


def _find_images(folder: Path, file: CaptureFile) -> list[list[ImageFile]]:
    """Headers of all images, set by set."""
    names = [item.all_images() for item in file.set]
    paths = iter(locate_images(folder, [name for row in names for name in row]))
    rows = [[next(paths) for _ in row] for row in names]
    found = inspect_images(path for row in rows for path in row)
    return [[found[path] for path in row] for row in rows]


def _sensor(
    camera: CameraTable, frames: Items[Frames], path: Path
) -> tuple[Sensor, tuple[Finding, ...]]:
    """The sensor, and what had to be assumed of its full scale."""
    limit = float(np.iinfo(frames[0].dtype).max)
    if camera.full_scale is None:
        return _assume_full_scale(camera, frames)
    if camera.full_scale > limit:
        raise FormatError(
            f"{path}: camera.full_scale must be at most {limit:g} for {frames[0].dtype} images, "
            f"got {camera.full_scale:g}"
        )
    brightest = _brightest(frames)
    found: tuple[Finding, ...] = ()
    if brightest > camera.full_scale:
        message = f"grey levels reach {brightest}, above full_scale = {camera.full_scale:g}."
        found = (Finding("warning", message, "Correct full_scale in [camera]."),)
    return camera.sensor(camera.full_scale), found


def _assume_full_scale(
    camera: CameraTable, frames: Items[Frames]
) -> tuple[Sensor, tuple[Finding, ...]]:
    if frames[0].dtype == np.uint8:
        return camera.sensor(255.0), ()
    brightest = _brightest(frames)
    assumed = next(scale for scale in FULL_SCALES if scale >= brightest)
    message = f"full_scale is not given: {assumed:g} assumed, as grey levels reach {brightest}."
    return camera.sensor(assumed), (Finding("note", message, "Set full_scale in [camera]."),)


def _brightest(frames: Items[Frames]) -> int:
    return max(int(stack.max()) for stack in frames)


def _seen_in_colour(sequence: Sequence, images: Items[Items[ImageFile]]) -> tuple[int, ...]:
    """Indices of the `Colour` sets all of whose images are in colour."""
    return tuple(
        index
        for index, (item, row) in enumerate(zip(sequence.sets, images, strict=True))
        if isinstance(item.pattern, Colour) and all(image.header.is_colour for image in row)
    )


def _colour_of(uniform: int | None, images: Items[Items[ImageFile]]) -> Frames | None:
    """RGB of the first image of a uniform set where the camera saw colour."""
    if uniform is None or not images[uniform][0].header.is_colour:
        return None
    image = images[uniform][0]
    colour = decode_image(image.path, image.header)
    grey = np.array_equal(colour[..., 0], colour[..., 1]) and np.array_equal(
        colour[..., 0], colour[..., 2]
    )
    return None if grey else colour


def _notice_images(
    images: Items[Items[ImageFile]], file: CaptureFile, chosen: Items[int]
) -> list[Finding]:
    every = [image for row in images for image in row]
    lossy = [image.path.name for image in every if image.header.lossy]
    colour = [
        image.path.name
        for row, index in zip(images, chosen, strict=True)
        for image in row
        if image.header.is_colour and not isinstance(file.set[index].pattern(), Colour)
    ]
    found = []
    if lossy:
        message = f"{len(lossy)} of {len(every)} images are JPEG (first: {lossy[0]})"
        found.append(
            Finding(
                "warning",
                f"{message}: compression has changed their grey levels.",
                "Record PNG or TIFF.",
            )
        )
    if colour:
        message = f"{len(colour)} of {len(every)} images are colour (first: {colour[0]})"
        found.append(Finding("note", f"{message}: converted to grey (BT.601 luma)."))
    for row, index in zip(images, chosen, strict=True):
        seen = all(image.header.is_colour for image in row)
        pattern = file.set[index].pattern()
        if isinstance(pattern, Colour) and has_hues(pattern) and not seen:
            what = f"{place(index, file.set[index])}: its images are grey."
            found.append(Finding("warning", what, "Record them with a colour camera."))
    return found


def _notice_equal_frames(
    frames: Items[Frames], file: CaptureFile, chosen: Items[int]
) -> Iterator[Finding]:
    """A warning for each pair of equal frames where a fringe or Gray set shows different ones."""
    for stack, index in zip(frames, chosen, strict=True):
        item = file.set[index]
        names, shown = item.all_images(), _shown(item.pattern(), len(stack) // item.repeats)
        for one, other in equal_frames(
            stack, [what for what in shown for _ in range(item.repeats)]
        ):
            message = f"{place(index, item)}: {names[one]} and {names[other]} are the same image."
            yield Finding("warning", message, "Was one copied over the other? Record it again.")


def _shown(pattern: Pattern, count: int) -> list[float]:
    """A number per frame; equal where frames may be equal, as those of no code may all be."""
    if isinstance(pattern, Fringe):
        return [round(math.degrees(shift) % 360, 6) % 360 for shift in pattern.shifts_rad]
    return (
        [float(index) for index in range(count)] if isinstance(pattern, GrayCode) else [0] * count
    )


def _notice_half_noise(camera: CameraTable) -> Iterator[Finding]:
    given = {"gain": camera.gain, "read_noise": camera.read_noise}
    missing = [key for key, value in given.items() if value is None]
    if len(missing) == 1:
        message = f"{missing[0]} is not given: gain and read_noise are both needed, so the noise "
        message += "is estimated from the images instead."
        yield Finding("note", message, f"Set {missing[0]} in [camera].")
