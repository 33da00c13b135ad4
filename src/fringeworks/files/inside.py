"""Names of files in a description: where they lead, which is nowhere outside its folder."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

from fringeworks.errors import FormatError


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
        raise FormatError(f"{folder}: {what} path {name!r} must be a name, with / between folders")
    leaves = windows.drive or windows.root or ".." in PurePosixPath(name).parts
    try:
        path = folder / name
        leaves = leaves or not path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a name too long
        raise FormatError(f"{folder}: {what} path {name!r} cannot be followed ({error})") from None
    if leaves:
        raise FormatError(
            f"{folder}: {what} path {name!r} leaves the {whose}'s folder; "
            f"copy the {what} into it (links to elsewhere are not followed)"
        )
    return path
