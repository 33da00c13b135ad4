"""The images of a capture: where they are, whether they fit together, and their pixels.

All headers are read before the first pixel is, so that a capture of a hundred images fails in
milliseconds and not after a minute.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from fringeworks.errors import FormatError
from fringeworks.files.image_header import ImageHeader, inspect_image
from fringeworks.files.images import decode_image, quiet_opencv
from fringeworks.files.inside import locate_inside
from fringeworks.files.validation import SHOWN, clip
from fringeworks.model.capture import Frames, to_grey
from fringeworks.model.progress import Progress, no_progress

MAX_CAPTURE_BYTES = 8 * 2**30
"""Largest capture that is held in memory: all grey frames of the chosen group, bytes."""

MAX_THREADS = 4
"""Decoding releases the interpreter: two threads save a third of the time, more add little."""

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class ImageFile:
    """An image of a capture whose header has been read."""

    path: Path
    header: ImageHeader


def locate_images(folder: Path, names: Iterable[str]) -> list[Path]:
    """Paths of images named in ``capture.toml``, every one inside `folder`.

    Raises
    ------
    FormatError
        A name leaves the folder (absolute, ``..``, a link to elsewhere), or files are missing:
        the message counts them and names the first few.
    """
    wanted = list(names)
    paths = [locate_inside(folder, name, what="image", whose="capture") for name in wanted]
    missing = [name for name, path in zip(wanted, paths, strict=True) if not _is_file(path)]
    if missing:
        missing = list(dict.fromkeys(missing))
        shown = ", ".join(missing[:SHOWN]) + (", ..." if len(missing) > SHOWN else "")
        raise FormatError(
            f"{folder}: {len(missing)} of {len(set(wanted))} images are missing: {clip(shown)}; "
            "record them, or correct the names in capture.toml"
        )
    return paths


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:
        return False


def inspect_images(paths: Iterable[Path]) -> dict[Path, ImageFile]:
    """Headers of all images, which must have one size and one depth.

    Raises
    ------
    FormatError
        As `inspect_image`; or naming the two images that differ.
    """
    found = {path: ImageFile(path, inspect_image(path)) for path in dict.fromkeys(paths)}
    first = next(iter(found.values()))
    for image in found.values():
        _check_alike(image, first)
    return found


def _check_alike(image: ImageFile, first: ImageFile) -> None:
    one, other = image.header, first.header
    if (one.width, one.height) != (other.width, other.height):
        raise FormatError(
            f"{image.path}: {one.width}x{one.height}, but {first.path.name} is "
            f"{other.width}x{other.height}; all images of a capture have one camera's size"
        )
    if one.bits != other.bits:
        raise FormatError(
            f"{image.path}: {one.bits} bit, but {first.path.name} is {other.bits} bit; "
            "record all images of a capture with one depth"
        )


def check_memory(folder: Path, images: Sequence[ImageFile]) -> None:
    """Refuse what would not fit into `MAX_CAPTURE_BYTES` before anything is allocated."""
    needed = sum(image.header.grey_bytes for image in images)
    if needed > MAX_CAPTURE_BYTES:
        raise FormatError(
            f"{folder}: {len(images)} images need {needed / 2**30:.1f} GiB, at most "
            f"{MAX_CAPTURE_BYTES / 2**30:g} GiB are read at once; split the capture into groups"
        )


def decode_stacks(
    sets: Sequence[Sequence[ImageFile]],
    progress: Progress = no_progress,
    *,
    in_colour: Collection[int] = (),
) -> tuple[Frames, ...]:
    """One grey stack ``(n, H, W)`` per set, uint8 or uint16; colour becomes its luma.

    Sets whose index is `in_colour` keep their three channels, ``(n, H, W, 3)``.
    """
    stacks = tuple(
        _empty_stack(images, (3,) if index in in_colour else ())
        for index, images in enumerate(sets)
    )
    jobs = [
        (stack, index, image)
        for stack, images in zip(stacks, sets, strict=True)
        for index, image in enumerate(images)
    ]

    def decode(job: tuple[Frames, int, ImageFile]) -> None:
        stack, index, image = job
        pixels = decode_image(image.path, image.header)
        stack[index] = pixels if stack.ndim == 4 else to_grey(pixels)

    with quiet_opencv():
        _run_all(decode, jobs, progress)
    return stacks


def _empty_stack(images: Sequence[ImageFile], channels: tuple[int, ...]) -> Frames:
    header = images[0].header
    shape = (len(images), header.height, header.width, *channels)
    return np.empty(shape, np.uint8) if header.bits == 8 else np.empty(shape, np.uint16)


def _run_all(work: Callable[[Item], None], jobs: Sequence[Item], progress: Progress) -> None:
    with ThreadPoolExecutor(min(MAX_THREADS, os.cpu_count() or 1)) as pool:
        futures = [pool.submit(work, job) for job in jobs]
        try:
            for future in progress(futures, "reading images"):
                future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def equal_frames(stack: Frames, shown: Sequence[float]) -> Iterator[tuple[int, int]]:
    """Pairs of frames that are equal pixel for pixel, though they show different things.

    `shown` has a number per frame, equal where frames show the same. Frames of one grey level
    all over are left out: spare bits of a Gray code are dark everywhere.
    """
    first: dict[int, int] = {}
    for index, frame in enumerate(stack):
        earlier = first.setdefault(zlib.crc32(frame), index)
        if (
            shown[earlier] != shown[index]
            and np.array_equal(stack[earlier], frame)
            and frame.min() != frame.max()
        ):
            yield earlier, index
