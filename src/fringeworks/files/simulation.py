"""Simulated captures on disk: each with its truth and all that made it beside its images."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from fringeworks.errors import UsageError
from fringeworks.files.board import write_board
from fringeworks.files.capture import CAPTURE_TOML
from fringeworks.files.capture_writing import write_capture
from fringeworks.files.rig import write_rig
from fringeworks.files.scene import write_scene
from fringeworks.files.sensor import write_sensor
from fringeworks.files.truth import write_truth
from fringeworks.model import Rig, Sequence
from fringeworks.model.progress import Progress, no_progress
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Board, Scene
from fringeworks.twin.scenes import target_of
from fringeworks.twin.simulate import simulate

TRUTH_NPZ, SCENE_TOML, SENSOR_TOML, RIG_JSON, BOARD_TOML = (
    "truth.npz",
    "scene.toml",
    "sensor.toml",
    "true_rig.json",
    "board.toml",
)


def write_simulations(
    scene: Scene,
    rig: Rig,
    sequence: Sequence,
    folder: str | Path,
    *,
    effects: Effects | None = None,
    seed: int = 0,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> list[Path]:
    """Simulate a scene and write one capture, or one per pose into ``pose_00``, ``pose_01``...

    Beside the images of each stand ``truth.npz``, and ``scene.toml``, ``sensor.toml`` and
    ``true_rig.json``, which made it and may be changed and used again. A posed board's
    ``board.toml``, as a calibration is told it, stands in `folder`. The same seed gives the same
    grey levels. Returns the folders of the captures.

    Raises
    ------
    UsageError
        A capture is there already and `overwrite` is False; or as `simulate`.
    FormatError
        A file cannot be written.
    """
    folder, effects = Path(folder), effects or Effects()
    views = scene.views()
    folders = [folder / view.name for view in views] if scene.poses else [folder]
    for target in folders:
        if not overwrite and (target / CAPTURE_TOML).exists():
            raise UsageError(f"{target}: holds a capture already; choose another folder")
    write = partial(_write_one, rig=rig, sequence=sequence, effects=effects, overwrite=overwrite)
    seeds = np.random.SeedSequence(seed).spawn(len(views))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        jobs = [
            pool.submit(write, view, target, np.random.default_rng(own))
            for view, target, own in zip(views, folders, seeds, strict=True)
        ]
        try:
            for job in progress(jobs, "simulating"):
                job.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    _write_board(scene, folder)
    return folders


def _write_one(
    scene: Scene,
    folder: Path,
    rng: np.random.Generator,
    *,
    rig: Rig,
    sequence: Sequence,
    effects: Effects,
    overwrite: bool,
) -> None:
    made = simulate(scene, rig, sequence, effects=effects, rng=rng)
    write_truth(folder / TRUTH_NPZ, made.truth)
    write_scene(folder / SCENE_TOML, scene)
    write_sensor(folder / SENSOR_TOML, effects)
    write_rig(folder / RIG_JSON, rig)
    write_capture(made.capture, folder, overwrite=overwrite)


def _write_board(scene: Scene, folder: Path) -> None:
    """The board that the poses show, if it is one that a calibration reads."""
    shapes = (item.shape for item in scene.objects if item.name == scene.posed)
    board = next((shape for shape in shapes if isinstance(shape, Board)), None)
    if board is not None and board.kind == "checkerboard":
        write_board(folder / BOARD_TOML, target_of(board))
