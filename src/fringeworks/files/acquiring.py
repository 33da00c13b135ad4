"""``.acquiring.json``: how far an acquisition has come, beside the images that it has taken.

It is there from the first image until ``capture.toml`` is written, so that a folder with it is an
unfinished capture.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from fringeworks.errors import FormatError
from fringeworks.files.atomic import write_text
from fringeworks.files.inside import locate_inside
from fringeworks.files.system import check_file, told
from fringeworks.files.validation import Table, check_format, read_json, validated

ACQUIRING_JSON = ".acquiring.json"
ACQUIRING_FORMAT = "fringeworks-acquiring/1"

Setting = str | int | float
Count = Annotated[int, Field(ge=0)]


@dataclass(frozen=True, slots=True)
class Taken:
    """An image that is done: digest of its file, start of its exposure in seconds."""

    sha256: str
    time_s: float


@dataclass(frozen=True, slots=True)
class Tally:
    """Frames that were not used, and waits in vain.

    Attributes
    ----------
    stale
        Exposed before the image that was to be seen had settled, or among the `drop_frames` after.
    repeated
        Delivered again under the same number.
    dropped
        Missing in the camera's count: lost, or not fetched in time.
    timeouts
        Waits in vain, after each of which the image was shown again.
    misplaced
        Whose corner code was not that of the image that was to be seen.
    """

    stale: int = 0
    repeated: int = 0
    dropped: int = 0
    timeouts: int = 0
    misplaced: int = 0


@dataclass(frozen=True, slots=True)
class Acquiring:
    """What an acquisition is, and how far it has come.

    Attributes
    ----------
    sequence
        Text of the ``capture.toml`` of the sequence, without times.
    settings
        All that must stay the same for the images to belong together.
    images
        The images that are done, by name.
    resumed_at
        First images of the runs after the first.
    frames
        Of all runs.
    """

    sequence: str
    settings: Mapping[str, Setting]
    images: Mapping[str, Taken] = field(default_factory=dict)
    resumed_at: tuple[str, ...] = ()
    frames: Tally = Tally()


class TakenTable(Table):
    """See `Taken`."""

    sha256: str
    time_s: float


class TallyTable(Table):
    """See `Tally`."""

    stale: Count
    repeated: Count
    dropped: Count
    timeouts: Count
    misplaced: Count = 0


class AcquiringFile(Table):
    """The whole ``.acquiring.json``."""

    format: Literal["fringeworks-acquiring/1"]
    sequence: str
    settings: dict[str, Setting]
    images: dict[str, TakenTable]
    resumed_at: list[str]
    frames: TallyTable


def read_acquiring(folder: Path) -> Acquiring | None:
    """How far the acquisition into `folder` has come; None where none is unfinished.

    Raises
    ------
    FormatError
        The file is damaged.
    """
    path = folder / ACQUIRING_JSON
    with told(path, "read"):
        if not path.exists():
            return None
    try:
        file = _read(path)
    except FormatError as error:
        raise FormatError(f"{error}; begin anew with --overwrite") from None
    return Acquiring(
        sequence=file.sequence,
        settings=file.settings,
        images={name: Taken(**item.model_dump()) for name, item in file.images.items()},
        resumed_at=tuple(file.resumed_at),
        frames=Tally(**file.frames.model_dump()),
    )


def _read(path: Path) -> AcquiringFile:
    document = read_json(path)
    check_format(document, ACQUIRING_FORMAT, path)
    file = validated(AcquiringFile, document, path)
    for name in file.images:
        locate_inside(path.parent, name, what="image", whose="acquisition")
    return file


def write_acquiring(folder: Path, acquiring: Acquiring) -> None:
    """Write it, atomic."""
    document = {"format": ACQUIRING_FORMAT, **asdict(acquiring)}
    write_text(folder / ACQUIRING_JSON, json.dumps(document, indent=1, allow_nan=False) + "\n")


def digest_of(path: Path) -> str | None:
    """SHA-256 of a regular file; None where there is none to read."""
    try:
        check_file(path)
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (FormatError, OSError):
        return None
