"""Where real captures are: other people's images, which are no part of the project."""

from __future__ import annotations

import os
from pathlib import Path

DATA_VARIABLE = "FRINGEWORKS_DATA"
SHELVES = ("real", "sample")


def data_folder() -> Path:
    """`$FRINGEWORKS_DATA`, else ``../shared/data`` beside the checkout; it need not exist."""
    named = os.environ.get(DATA_VARIABLE)
    if named:
        return Path(named)
    checkout = Path(__file__).resolve().parents[3]
    beside = checkout if (checkout / "pyproject.toml").is_file() else Path.cwd()
    return beside.parent / "shared" / "data"


def find_data(name: str) -> Path | None:
    """Folder of a real set by its name, as ``procam-graycode``: in real/, then in sample/."""
    folders = (data_folder() / shelf / name for shelf in SHELVES)
    return next((folder for folder in folders if folder.is_dir()), None)
