"""What the operating system refuses, said as a FormatError of the file that it is about."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fringeworks.errors import FormatError


@contextmanager
def told(path: Path, done: str) -> Iterator[None]:
    """An OSError of the block as a FormatError: `path` cannot be `done`, "read" or "written"."""
    try:
        yield
    except OSError as error:
        raise FormatError(f"{path}: cannot be {done} ({error.strerror or error})") from error


def check_file(path: Path) -> None:
    """Refuse what is no regular file to read.

    Raises
    ------
    FormatError
        Nothing is there, or a folder, a device or a pipe; or it is out of reach.
    """
    with told(path, "read"):
        if path.is_file():
            return
        there = path.exists()
    if there:
        raise FormatError(f"{path}: not a regular file; is it a folder or a device?")
    raise FormatError(f"{path}: no such file")
