"""Write beside the target, then rename: a reader sees the old file or the new one, never half.

A process that is killed leaves its temporary file behind: no reader looks at it, and the next
write into that folder takes it away once it is a day old, when nobody can be writing it any more.
"""

from __future__ import annotations

import os
import re
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

from fringeworks.errors import FormatError

MAX_SUFFIX = 32
"""Longest suffix of a temporary name, which has to fit into 255 bytes."""

STALE_S = 24 * 3600.0
"""Age of a temporary file whose writer was killed."""

_PREFIX = ".fringeworks-"
_OURS = re.compile(re.escape(_PREFIX) + r"[0-9a-f]{32}(\..*)?")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path in the folder of `path` that becomes `path` when the block succeeds.

    Missing parent folders are made. The temporary name keeps the suffix of `path`; if the block
    fails it is removed and whatever was at `path` stays. Where `path` is a link, the file that it
    points to is replaced and the link stays.

    Raises
    ------
    FormatError
        The operating system refuses (no permission, disk full, `path` is a folder).
    """
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f"{_PREFIX}{uuid.uuid4().hex}{path.suffix[:MAX_SUFFIX]}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_stale(target.parent)
        yield temporary
        temporary.replace(target)
    except OSError as error:
        _discard(temporary)
        raise FormatError(f"{path}: cannot be written ({error.strerror or error})") from error
    except BaseException:
        _discard(temporary)
        raise


@lru_cache(maxsize=1024)  # once per folder and run
def _remove_stale(folder: Path) -> None:
    """Take away what writers that were killed have left in `folder`."""
    with suppress(OSError), os.scandir(folder) as items:
        for item in items:
            if _OURS.fullmatch(item.name) and time.time() - item.stat().st_mtime > STALE_S:
                _discard(folder / item.name)


def _discard(path: Path) -> None:
    with suppress(OSError):  # never made, or no longer within reach: the first error tells
        path.unlink()


def write_text(path: Path, text: str) -> None:
    """Replace `path` by `text`: UTF-8, line ends as they are in `text`."""
    with replacing(path) as temporary:
        temporary.write_bytes(text.encode())
