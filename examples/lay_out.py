"""Lay a checkout of a public repository out as captures that fringeworks reads.

    python examples/lay_out.py procam-graycode PATH_TO_CHECKOUT --out DIR

PATH_TO_CHECKOUT is the repository or the folder in it that holds the images. The captures stand
in DIR/real/SET afterwards (with --half in DIR/sample/procam-half), so that FRINGEWORKS_DATA=DIR
finds them. No image is renamed; needs Python alone (--half: also opencv-python-headless).
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

EXAMPLES = Path(__file__).resolve().parent
HALF = "procam-half"


@dataclass(frozen=True)
class Source:
    """Where a set comes from; `extras` are files that are copied if they are there."""

    repository: str
    commit: str
    images_in: str
    extras: dict[str, str] = field(default_factory=dict)


SOURCES = {
    "procam-graycode": Source(
        "kamino410/procam-calibration",
        "09e58d5",
        "sample_data",
        {"calibration_result.xml": "author_calibration_result.xml"},
    ),
    "psp3-gray-mugs": Source(
        "kamino410/phase-shifting",
        "c261726",
        "sample_data/object2",
        {"vizualized.png": "vizualized.png", "config.xml": "config.xml"},
    ),
    "gamma-plane": Source(
        "kamino410/phase-shifting",
        "c261726",
        "sample_data/gamma_correction",
        {"gamma_result.txt": "author_gamma_result.txt", "config.xml": "config.xml"},
    ),
    "fourstep-dome": Source("nzhagen/fpp_tools", "aa71ef7", "figures"),
}


class LayOutError(Exception):
    """What the user can put right."""


def lay_out(name: str, checkout: Path, out: Path, *, half: bool = False) -> Path:
    """Copy the images of set `name` beside its descriptions; returns the folder of the set."""
    source = SOURCES[name]
    if half and name != "procam-graycode":
        raise LayOutError("--half is for procam-graycode alone")
    if not checkout.is_dir():
        raise LayOutError(f"{checkout}: no such folder; give a checkout of {source.repository}")
    images = image_names(EXAMPLES / name)
    found = find_images(checkout, source, images)
    target = out / "sample" / HALF if half else out / "real" / name
    copy = halve_image if half else copy_file
    for image in images:
        copy(found / image, target / image)
    if not half:
        copy_extras(found, target, source.extras)
    copy_licence(checkout, found, target)
    for path in sorted((EXAMPLES / name).rglob("*.toml")):  # last: it makes the capture whole
        copy_file(path, target / path.relative_to(EXAMPLES / name))
    return target


def image_names(example: Path) -> list[str]:
    """Paths of all images that the example's descriptions name, relative to its folder."""
    names = []
    for path in sorted(example.rglob("capture.toml")):
        below = PurePosixPath(path.parent.relative_to(example).as_posix())
        sets = tomllib.loads(path.read_text(encoding="utf-8"))["set"]
        names += [str(below / image) for item in sets for image in item["images"]]
    return names


def find_images(checkout: Path, source: Source, images: list[str]) -> Path:
    """The folder that holds the images: the repository's own place for them, or `checkout`."""
    last = PurePosixPath(source.images_in).name
    folders = [checkout / source.images_in, checkout / last, checkout]
    missing = {
        folder: [image for image in images if not (folder / image).is_file()] for folder in folders
    }
    best = min(folders, key=lambda folder: len(missing[folder]))
    if missing[best]:
        shown = ", ".join(missing[best][:5]) + (", ..." if len(missing[best]) > 5 else "")
        raise LayOutError(
            f"{best}: {len(missing[best])} of {len(images)} images are missing: {shown}\n"
            f"give a checkout of {source.repository} (commit {source.commit}), whose "
            f"{source.images_in} has them"
        )
    return best


def copy_file(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def copy_extras(found: Path, target: Path, extras: dict[str, str]) -> None:
    for name, new_name in extras.items():
        if (found / name).is_file():
            copy_file(found / name, target / new_name)


def copy_licence(checkout: Path, found: Path, target: Path) -> None:
    """The images stay their author's: their licence goes with them."""
    for folder in (checkout, found, *found.parents[:2]):
        if (folder / "LICENSE").is_file():
            copy_file(folder / "LICENSE", target / "LICENSE")
            return


def halve_image(source: Path, target: Path) -> None:
    """Half the width and height: the mean of 2x2 pixels, rounded half up."""
    cv2, np = _opencv()
    image = cv2.imdecode(np.fromfile(source, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 2 or image.dtype != np.uint8:
        raise LayOutError(f"{source}: not an 8 bit grey image")
    height, width = (size // 2 * 2 for size in image.shape)
    quads = image[:height, :width].astype(np.uint16).reshape(height // 2, 2, width // 2, 2)
    half = ((quads.sum(axis=(1, 3), dtype=np.uint16) + 2) // 4).astype(np.uint8)
    target.parent.mkdir(parents=True, exist_ok=True)
    cv2.imencode(".png", half)[1].tofile(target)


def _opencv() -> tuple[Any, Any]:
    try:
        import cv2
        import numpy as np
    except ImportError:
        raise LayOutError("--half needs opencv-python-headless: pip install it first") from None
    return cv2, np


def main(arguments: list[str] | None = None, say: Callable[[str], object] = print) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("set", choices=sorted(SOURCES))
    parser.add_argument("checkout", type=Path, help="the repository, or its folder of images")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--half", action="store_true", help=f"make the half-size {HALF} instead")
    given = parser.parse_args(arguments)
    try:
        target = lay_out(given.set, given.checkout, given.out, half=given.half)
    except (LayOutError, OSError) as error:
        sys.stderr.write(f"lay_out: {error}\n")
        return 1
    say(f"{target}: laid out; use it with FRINGEWORKS_DATA={given.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
