"""One acquisition at a time into one folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fringeworks.errors import UsageError
from fringeworks.files.capture_writing import check_folder
from fringeworks.files.system import told

LOCK = ".acquiring.lock"
"""Holds the number of the process that acquires into the folder."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Make `folder` and keep it to this process; what a process that is gone has left is removed.

    Raises
    ------
    UsageError
        Another process acquires into it, or may do so; or it is no folder.
    FormatError
        The lock cannot be written.
    """
    check_folder(folder)
    lock = folder / LOCK
    with told(lock, "written"):
        folder.mkdir(parents=True, exist_ok=True)
        _take(lock)
    try:
        yield
    finally:
        with suppress(OSError):
            lock.unlink(missing_ok=True)


def _take(lock: Path) -> None:
    try:
        _make(lock)
    except FileExistsError:
        _remove_stale(lock)
        try:
            _make(lock)
        except FileExistsError:  # someone else was faster
            raise _occupied(lock) from None


def _make(lock: Path) -> None:
    with lock.open("x", encoding="ascii") as file:
        file.write(str(os.getpid()))


def _remove_stale(lock: Path) -> None:
    if not _is_gone(_holder(lock)):
        raise _occupied(lock)
    lock.unlink(missing_ok=True)


def _occupied(lock: Path) -> UsageError:
    process = _holder(lock)
    who = "another process" if process is None else f"process {process}"
    return UsageError(
        f"{lock.parent}: {who} acquires into it; wait for its end, or remove {lock} if it runs no "
        "more"
    )


def _holder(lock: Path) -> int | None:
    try:
        return int(lock.read_bytes()[:20])
    except (OSError, ValueError):
        return None


def _is_gone(process: int | None) -> bool:
    """Whether no such process lives; False where that cannot be told."""
    if process is None or process <= 0 or os.name != "posix":  # elsewhere signal 0 is no question
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False
