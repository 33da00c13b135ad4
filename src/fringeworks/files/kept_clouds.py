"""A folder of numbered clouds that keeps the newest within a limit of its size."""

from __future__ import annotations

import re
from collections import deque
from pathlib import Path

from fringeworks.files.cloud_npz import write_npz_cloud
from fringeworks.files.system import told
from fringeworks.model import Cloud

SUFFIX = ".npz"
_HALF = re.compile(r"\.fringeworks-[0-9a-f]{32}\.npz")
"""What `files.atomic` leaves of a process that was killed while it wrote."""

_WHOLE = re.compile(r"scan_([0-9]{7,})\.npz")
"""As `keep` names them: a ``scan_1.npz`` is somebody else's."""


class KeptClouds:
    """Clouds as ``scan_NUMBER.npz``, each written atomically; the oldest make room.

    The newest one is kept whatever its size, and is there before room is made: for a moment the
    folder holds one file more.

    `newest` is the number of the newest cloud that was there at the start, 0 without any.

    Parameters
    ----------
    folder
        It is made; what a killed process has left half-written there is removed.
    most_bytes
        Of all clouds together.

    Raises
    ------
    FormatError
        The operating system refuses.
    """

    def __init__(self, folder: Path, *, most_bytes: int) -> None:
        self._folder, self._most_bytes = folder, most_bytes
        with told(folder, "written"):
            folder.mkdir(parents=True, exist_ok=True)
            for path in list(folder.iterdir()):
                if _HALF.fullmatch(path.name):
                    path.unlink()
            found = sorted(folder.iterdir(), key=_number)
            self._files = deque((p, p.stat().st_size) for p in found if _WHOLE.fullmatch(p.name))
        self._bytes = sum(size for _, size in self._files)
        self.newest = max((_number(path) for path, _ in self._files), default=0)

    def keep(self, number: int, cloud: Cloud) -> str:
        """Write a cloud and return its file's name; fails as `write_cloud`."""
        path = self._folder / f"scan_{number:07d}{SUFFIX}"
        self._drop(path)  # of a scan that was killed before it was logged
        write_npz_cloud(path, cloud)
        with told(path, "written"):
            self._files.append((path, path.stat().st_size))
            self._bytes += self._files[-1][1]
            while self._bytes > self._most_bytes and len(self._files) > 1:
                oldest, size = self._files.popleft()
                oldest.unlink(missing_ok=True)
                self._bytes -= size
        return path.name

    def _drop(self, path: Path) -> None:
        """Forget a file that is about to be replaced."""
        for entry in [entry for entry in self._files if entry[0] == path]:
            self._files.remove(entry)
            self._bytes -= entry[1]


def _number(path: Path) -> int:
    found = _WHOLE.fullmatch(path.name)
    return int(found[1]) if found else -1
