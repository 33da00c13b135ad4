"""What is done of an acquisition, kept on disk after every image: any moment may be the last."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

from fringeworks.errors import UsageError
from fringeworks.files.acquiring import (
    ACQUIRING_JSON,
    Acquiring,
    Setting,
    Taken,
    Tally,
    digest_of,
    read_acquiring,
    write_acquiring,
)
from fringeworks.files.atomic import write_text
from fringeworks.files.capture import CAPTURE_TOML
from fringeworks.files.capture_writing import make_room
from fringeworks.files.images import write_image
from fringeworks.model import Frames

ANEW = "choose another folder, or begin anew with --overwrite"


class Journal:
    """The images of one capture, called `names`, as they come into its folder.

    Raises
    ------
    UsageError
        `folder` holds a capture or other files, or an acquisition of other settings.
    FormatError
        It cannot be read or written.
    """

    def __init__(
        self, folder: Path, plan: Acquiring, *, names: Collection[str], overwrite: bool
    ) -> None:
        self._folder = folder
        left = None if overwrite else read_acquiring(folder)
        if left is None:
            _clear(folder, overwrite=overwrite)
            self._state = plan
        else:
            _refuse_other(left, plan, folder)
            planned = {name: taken for name, taken in left.images.items() if name in names}
            self._state = replace(left, images=_intact(planned, folder))
        self._save()

    @property
    def state(self) -> Acquiring:
        return self._state

    def resume_at(self, name: str) -> None:
        """Note the image with which a later run begins."""
        self._state = replace(self._state, resumed_at=(*self._state.resumed_at, name))

    def add(self, name: str, image: Frames, *, time_s: float, frames: Tally) -> None:
        """Write an image under its final name, then note it."""
        write_image(self._folder / name, image)
        taken = Taken(digest_of(self._folder / name) or "", time_s)
        images = {**self._state.images, name: taken}
        self._state = replace(self._state, images=images, frames=frames)
        self._save()

    def count(self, frames: Tally) -> None:
        """Note what was not used although no image came of it."""
        self._state = replace(self._state, frames=frames)
        self._save()

    def finish(self, text: str) -> Path:
        """Write ``capture.toml``: with it the folder is a capture."""
        target = self._folder / CAPTURE_TOML
        write_text(target, text)
        (self._folder / ACQUIRING_JSON).unlink(missing_ok=True)
        return target

    def _save(self) -> None:
        write_acquiring(self._folder, self._state)


def count_taken(folder: Path) -> int:
    """How many images an unfinished acquisition into `folder` has; 0 where there is none."""
    left = read_acquiring(folder)
    return 0 if left is None else len(_intact(left.images, folder))


def _clear(folder: Path, *, overwrite: bool) -> None:
    """Nothing may be overwritten unasked; an old description goes before its first image."""
    held = sorted(path.name for path in folder.glob("*") if not path.name.startswith("."))
    if held and not overwrite and CAPTURE_TOML not in held:
        raise UsageError(f"{folder}: holds {len(held)} files already (first: {held[0]}); {ANEW}")
    make_room(folder, overwrite=overwrite)


def _intact(images: Mapping[str, Taken], folder: Path) -> dict[str, Taken]:
    """Those whose files are as they were written."""
    return {
        name: taken for name, taken in images.items() if digest_of(folder / name) == taken.sha256
    }


def _refuse_other(left: Acquiring, plan: Acquiring, folder: Path) -> None:
    """Images of other settings or another sequence must not come into one capture."""
    changes = [
        *_changed_settings(left.settings, plan.settings),
        *_changed_line(left.sequence, plan.sequence),
    ]
    if changes:
        raise UsageError(
            f"{folder}: holds an unfinished acquisition that is another: {'; '.join(changes)}. "
            f"Give the same settings to go on, {ANEW}"
        )


def _changed_settings(then: Mapping[str, Setting], now: Mapping[str, Setting]) -> list[str]:
    return [
        f"{key} was {then.get(key, 'not given')}, is {now.get(key, 'not given')}"
        for key in dict.fromkeys([*then, *now])
        if then.get(key) != now.get(key)
    ]


def _changed_line(then: str, now: str) -> list[str]:
    """The first line in which two sequences differ."""
    pairs = zip_longest(then.splitlines(), now.splitlines(), fillvalue="no more")
    return [f"its sequence had '{a}', has '{b}'" for a, b in pairs if a != b][:1]
