"""OpenCV's FileStorage, YAML or XML, as numbers and matrices by their names."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fringeworks.errors import FormatError
from fringeworks.files.validation import clip, read_text

MAX_OPENED = 20_000
"""Brackets, tags and dashes of lists; a calibration has a hundred, with all its points thousands.

OpenCV's parser calls itself for each one within another; a million end the process, out of stack.
"""

_OPENED = re.compile(r"[\[{<]|-\s")


def read_storage(path: Path) -> dict[str, Any]:
    """Top-level numbers and matrices of a FileStorage; what is neither is None.

    Raises
    ------
    FormatError
        Not text, no FileStorage, or more than `MAX_OPENED` brackets, tags and dashes.
    """
    text = read_text(path)
    opened = sum(1 for _ in _OPENED.finditer(text))
    if opened > MAX_OPENED:
        raise FormatError(
            f"{path}: must have at most {MAX_OPENED} brackets, tags and lists, got {opened}; "
            "is it a calibration?"
        )
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        root = storage.root()
        return {name: _value(root.getNode(name)) for name in root.keys()}  # noqa: SIM118
    except (cv2.error, SystemError) as error:  # the latter wraps the former in a constructor
        cause = getattr(error.__cause__ or error, "err", None) or "no YAML or XML of FileStorage"
        raise FormatError(f"{path}: not an OpenCV file: {clip(cause)}") from None


def _value(node: cv2.FileNode) -> NDArray[np.float64] | None:
    if node.isInt() or node.isReal():
        return np.array([node.real()])
    if node.isSeq():
        items = [node.at(index) for index in range(node.size())]
        numbers = all(item.isInt() or item.isReal() for item in items)
        return np.array([item.real() for item in items]) if numbers else None
    try:
        return np.asarray(node.mat(), dtype=np.float64) if node.isMap() else None
    except (cv2.error, TypeError, ValueError):  # a table that is no matrix
        return None
