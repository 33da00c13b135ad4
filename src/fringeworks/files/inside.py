"""Names of files in a description: where they lead, which is nowhere outside its folder."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

from fringeworks.errors import FormatError
from fringeworks.files.validation import shorten


def locate_inside(folder: Path, name: str, *, what: str, whose: str) -> Path:
    """Path of the file called `name` (with ``/`` between folders) inside `folder`.

    `what` it is and `whose` folder it is are words for the messages. It need not exist.

    Raises
    ------
    FormatError
        The name leaves the folder (absolute, ``..``, a link to elsewhere) or is none.
    """
    windows = PureWindowsPath(name)
    if not name or "\0" in name or "\\" in name:
        raise FormatError(
            f"{folder}: {what} path {shorten(name)} must be a name, with / between folders"
        )
    leaves = windows.drive or windows.root or ".." in PurePosixPath(name).parts
    try:
        path = folder / name
        leaves = leaves or not path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a name too long
        reason = getattr(error, "strerror", None) or type(error).__name__
        raise FormatError(
            f"{folder}: {what} path {shorten(name)} cannot be followed ({reason})"
        ) from None
    if leaves:
        raise FormatError(
            f"{folder}: {what} path {shorten(name)} leaves the {whose}'s folder; "
            f"copy the {what} into it (links to elsewhere are not followed)"
        )
    return path
