"""Small capture folders to read, and to spoil."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import tomlkit
from numpy.typing import NDArray

WIDTH, HEIGHT = 7, 5

Document = dict[str, Any]


def document() -> Document:
    """A description with a set of every kind that carries something to check."""
    return {
        "format": "fringeworks-capture/1",
        "projector": {"width": 32, "height": 24},
        "set": [
            {
                "kind": "fringe",
                "axis": "x",
                "period_px": 8.0,
                "shifts_deg": [120.0, 0.0, -120.0],
                "images": ["f0.png", "f1.png", "f2.png"],
            },
            {"kind": "gray", "axis": "x", "cell_px": 8.0, "images": ["g0.png", "g1.png"]},
            {
                "kind": "codeword",
                "axis": "x",
                "period_px": 8.0,
                "codewords_px": [2.0, 4.0],
                "images": ["code.png"],
            },
            {"kind": "uniform", "level": 1.0, "images": ["white.png"]},
        ],
    }


def pixels(
    name: str, *, dtype: type[np.generic] = np.uint8, shape: tuple[int, ...] = (HEIGHT, WIDTH)
) -> NDArray[Any]:
    """Grey levels that depend on the name alone."""
    rng = np.random.default_rng(list(name.encode()))
    return rng.integers(0, np.iinfo(np.dtype(dtype)).max, shape).astype(dtype)


def write_raw(path: Path, image: NDArray[Any]) -> None:
    """An image file in the format of its suffix, by OpenCV alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)


def image_names(description: Document) -> list[str]:
    names = []
    for item in description["set"]:
        names += item["images"] + item.get("inverted", [])
        extra = item.get("complementary", [])
        names += [extra] if isinstance(extra, str) else extra
    return names


def write_toml(folder: Path, description: Document) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "capture.toml").write_text(tomlkit.dumps(description), encoding="utf-8")


def make_capture(
    folder: Path,
    description: Document | None = None,
    *,
    dtype: type[np.generic] = np.uint8,
) -> Path:
    """A folder with `description` and all the images it names."""
    description = document() if description is None else description
    write_toml(folder, description)
    for name in image_names(description):
        write_raw(folder / name, pixels(name, dtype=dtype))
    return folder
