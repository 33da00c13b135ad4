"""Commands that are killed (SIGKILL) while they write over what is there already.

Each process is forked from a server that has imported everything, so that a kill costs the
command's own time alone. It dies before its n-th change of the file system below its folder,
as Python's audit events tell them, or when its time is over.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fringeworks.files import (
    read_capture,
    read_cloud,
    read_image,
    read_phase,
    read_response,
    read_rig,
    read_scene,
    read_sensor,
    read_truth,
    write_rig,
)
from fringeworks.files.board import read_board
from fringeworks.files.validation import read_json
from fringeworks.model import Camera, Rig
from fringeworks.twin.scenes import paper_rig

OLD = b"what was there before"
TEMPORARY = ".fringeworks-"
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.truncate")
WRITING = os.O_WRONLY | os.O_RDWR
LONGEST_S = 300.0
PRELOAD = [
    "tests.fuzz.kills",
    "fringeworks.cli.app",
    "fringeworks.pipeline",
    "fringeworks.twin.simulate",
]
PRELOAD += ["cv2", "scipy.optimize", "scipy.ndimage", "fringeworks.report.summary"]

READ: dict[str, Callable[[Path], object]] = {
    "capture.toml": read_capture,
    "board.toml": read_board,
    "scene.toml": read_scene,
    "sensor.toml": read_sensor,
    "rig.json": read_rig,
    "true_rig.json": read_rig,
    "response.json": read_response,
    "phase.npz": read_phase,
    "truth.npz": read_truth,
}
"""By a file's name; what is not here is read by its suffix."""

BY_SUFFIX: dict[str, Callable[[Path], object]] = {
    ".png": read_image,
    ".json": read_json,
    ".npz": read_cloud,
    ".ply": read_cloud,
}


@dataclass(frozen=True, slots=True)
class Command:
    """Arguments of a command; its files, or a folder of files, that it writes over."""

    arguments: tuple[str, ...]
    writes: str

    def run(self, folder: Path, kill_at: int | None = None, seconds: float | None = None) -> int:
        """Run it in `folder`, which becomes the working one; its exit status, -9 if killed."""
        process = _context().Process(target=_run, args=(self.arguments, folder, kill_at))
        process.start()
        process.join(LONGEST_S if seconds is None else seconds)
        if process.is_alive():
            assert seconds is not None, f"{self.arguments} did not end in {LONGEST_S} s"
            process.kill()
        process.join()
        return int(process.exitcode or 0)


TWIN = ("--rig", "rig.json", "--preset", "measure", "--steps", "4")

COMMANDS: dict[str, Command] = {
    "patterns": Command(
        ("patterns", "paper", "--projector", "64x48", "--out", "shown", "--overwrite"), "shown"
    ),
    "twin": Command(("twin", "wall", *TWIN, "--out", "wall", "--overwrite"), "wall"),
    "decode": Command(("decode", "wall", "--out", "phase.npz"), "phase.npz"),
    "scan": Command(("scan", "wall", "--rig", "rig.json", "--out", "a.ply"), "a.ply"),
    "convert": Command(("convert", "cloud.npz", "b.ply"), "b.ply"),
    "merge": Command(
        ("merge", "cloud.npz", "cloud2.npz", "--by", "frame", "--out", "c.ply"), "c.ply"
    ),
    "response": Command(("response", "levels", "--out", "response.json"), "response.json"),
    "calibrate": Command(
        ("calibrate", "boards", "--board", "boards/board.toml", "--out", "found.json"), "found.json"
    ),
    "demo": Command(("demo", "--quick", "--out", "demo"), "demo"),
}

PREPARE: tuple[tuple[str, ...], ...] = (
    ("twin", "wall", *TWIN, "--out", "wall"),
    ("scan", "wall", "--rig", "rig.json", "--out", "cloud.npz"),
    ("scan", "wall", "--rig", "rig.json", "--out", "cloud2.npz"),
    ("twin", "wall", "--rig", "rig.json", "--preset", "response", "--out", "levels"),
)
BOARDS = (
    "twin",
    "board",
    "--rig",
    "paper",
    "--preset",
    "calibrate",
    "--steps",
    "4",
    "--out",
    "boards",
)


def prepare(folder: Path, *, boards: bool = False) -> None:
    """What the commands read: a small rig, captures, clouds."""
    whole = paper_rig()
    camera = whole.camera
    lens = replace(
        camera.lens,
        fx=camera.lens.fx / 8,
        fy=camera.lens.fy / 8,
        cx=camera.lens.cx / 8,
        cy=camera.lens.cy / 8,
    )
    small = Camera(camera.width // 8, camera.height // 8, lens)
    write_rig(folder / "rig.json", Rig(small, whole.projector, whole.projector_from_camera))
    for arguments in (*PREPARE, *((BOARDS,) if boards else ())):
        status = Command(arguments, "").run(folder)
        assert status == 0, f"{arguments} ended with {status}"


def check_files(path: Path) -> None:
    """Every file is the old one or can be read, but for temporaries, which no reader looks at."""
    files = [path] if path.is_file() else [item for item in path.rglob("*") if item.is_file()]
    for file in files:
        if file.name.startswith(TEMPORARY) or file.read_bytes() == OLD:
            continue
        reader = READ.get(file.name) or BY_SUFFIX.get(file.suffix)
        if reader is not None:
            reader(file)


def _context() -> Any:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOAD)
    return context


def _run(arguments: tuple[str, ...], folder: Path, kill_at: int | None) -> None:
    os.chdir(folder)
    with (folder / "log.txt").open("w") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
    if kill_at is not None:
        _die_at(kill_at, folder)
    from fringeworks.cli import main

    sys.argv = ["fringeworks", *arguments]
    main()


def _die_at(number: int, folder: Path) -> None:
    changes = itertools.count()
    folders = (str(folder), str(folder.resolve()))

    def watch(event: str, details: tuple[Any, ...]) -> None:
        writes = event == "open" and isinstance(details[2], int) and details[2] & WRITING
        if not (writes or event in CHANGES) or not isinstance(details[0], str | os.PathLike):
            return
        if not os.path.abspath(details[0]).startswith(folders):  # noqa: PTH100
            return
        if next(changes) == number:
            os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)
