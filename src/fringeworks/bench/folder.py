"""A folder of images to a cloud file, beside reading and writing the same bytes."""

from __future__ import annotations

import os
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from fringeworks.bench.metric import Metric
from fringeworks.bench.scan import LARGE, scaled_rig, sequence_of, wall_capture
from fringeworks.bench.speed import ratio_metric
from fringeworks.bench.timing import Work, race, settle_allocator
from fringeworks.files import read_capture, read_image, write_capture, write_cloud
from fringeworks.files.capture_images import MAX_THREADS
from fringeworks.model import Rig
from fringeworks.pipeline import scan

QUICK_SIZE = (376, 240)
TURNS, QUICK_TURNS = (5, 5), (1, 1)
NOTE = "folder of 11 images to cloud.npz over the same files with the same codecs; start-up apart"


def measure_folder(*, quick: bool = False) -> list[Metric]:
    """The ratio for 5 Mpx; of small images and one turn where `quick`."""
    size, turns = (QUICK_SIZE, QUICK_TURNS) if quick else (LARGE, TURNS)
    rig = scaled_rig(size)
    settle_allocator()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "capture"
        write_capture(wall_capture(rig, sequence_of("three_steps_gray")), folder)
        plain, whole = _plain(folder, rig), partial(scan_folder, folder, rig)
        result = race(plain, whole, seconds=0.0, turns=turns)
    key = f"process.scan_folder_{size[0]}x{size[1]}_vs_codecs"
    return [ratio_metric(key, result, "lower", NOTE, "bar <= 1.3")]


def scan_folder(folder: Path, rig: Rig) -> None:
    """What ``fringeworks scan`` does."""
    write_cloud(folder.parent / "cloud.npz", scan(read_capture(folder), rig))


def _plain(folder: Path, rig: Rig) -> Work:
    """Every image decoded, several at a time as `read_capture` does, and one cloud written."""
    cloud = scan(read_capture(folder), rig)
    images = sorted(folder.glob("*.png"))

    def read_and_write() -> None:
        with ThreadPoolExecutor(min(MAX_THREADS, os.cpu_count() or 1)) as pool:
            list(pool.map(read_image, images))
        write_cloud(folder.parent / "plain.npz", cloud)

    return read_and_write
