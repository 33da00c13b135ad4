"""Captures of simulated scenes, each with its truth and all that made it beside its images."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fringeworks import __version__
from fringeworks.files import write_board, write_capture, write_rig, write_scene, write_sensor
from fringeworks.files.capture_writing import make_room
from fringeworks.files.truth import write_truth
from fringeworks.model import Rig, Sequence
from fringeworks.model.progress import Progress, no_progress
from fringeworks.twin.check import check_effects, check_scene
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


@dataclass(frozen=True, slots=True)
class _Plan:
    """What all captures of one call have in common."""

    rig: Rig
    sequence: Sequence
    effects: Effects
    provenance: Mapping[str, str | int]


def write_simulations(
    scene: Scene,
    rig: Rig,
    sequence: Sequence,
    folder: str | Path,
    *,
    effects: Effects | None = None,
    seed: int = 0,
    facts: Mapping[str, str | int] | None = None,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> list[Path]:
    """Simulate a scene and write one capture, or one per pose into ``pose_00``, ``pose_01``...

    Beside the images of each stand ``truth.npz``, and ``scene.toml``, ``sensor.toml`` and
    ``true_rig.json``, which made it and may be changed and used again; seed, version and `facts`
    are the capture's provenance. A posed board's ``board.toml``, as a calibration is told it,
    stands in `folder`. The same seed gives the same grey levels. With `overwrite` the captures
    that are there are replaced, and further poses of an earlier call are no captures any more.
    Returns the folders of the captures.

    Raises
    ------
    UsageError
        A capture is there already and `overwrite` is False; or as `simulate`.
    FormatError
        A file cannot be written.
    """
    folder = Path(folder)
    views = scene.views()
    folders = [folder / view.name for view in views] if scene.poses else [folder]
    left_over = set(folder.glob("pose_[0-9][0-9]*")) - set(folders) if scene.poses else set()
    provenance = {"twin": f"fringeworks {__version__}", **(facts or {}), "seed": seed}
    plan = _Plan(rig, sequence, effects or Effects(), provenance)
    check_scene(scene)  # before anything that is there goes
    check_effects(plan.effects)
    for target in [*folders, *sorted(left_over)]:
        make_room(target, overwrite=overwrite)
    seeds = [np.random.default_rng(own) for own in np.random.SeedSequence(seed).spawn(len(views))]
    if len(views) == 1:
        _write_one(views[0], folders[0], seeds[0], plan=plan, progress=progress)
    else:
        _write_all(list(zip(views, folders, seeds, strict=True)), plan, progress)
    _write_board(scene, folder)
    return folders


def _write_all(
    jobs: list[tuple[Scene, Path, np.random.Generator]], plan: _Plan, progress: Progress
) -> None:
    """As many at a time as there are cores: the kernels hold no lock."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        waiting = [pool.submit(_write_one, *job, plan=plan) for job in jobs]
        try:
            for one in progress(waiting, "simulating"):
                one.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _write_one(
    scene: Scene,
    folder: Path,
    rng: np.random.Generator,
    *,
    plan: _Plan,
    progress: Progress = no_progress,
) -> None:
    """The capture's description comes last: without it nothing here is one."""
    made = simulate(
        scene, plan.rig, plan.sequence, effects=plan.effects, rng=rng, progress=progress
    )
    write_truth(folder / TRUTH_NPZ, made.truth)
    write_scene(folder / SCENE_TOML, scene)
    write_sensor(folder / SENSOR_TOML, plan.effects)
    write_rig(folder / RIG_JSON, plan.rig)
    write_capture(replace(made.capture, provenance=dict(plan.provenance)), folder)


def _write_board(scene: Scene, folder: Path) -> None:
    """The board that the poses show, if it is one that a calibration reads."""
    shapes = (item.shape for item in scene.objects if item.name == scene.posed)
    board = next((shape for shape in shapes if isinstance(shape, Board)), None)
    if board is not None and board.kind == "checkerboard":
        write_board(folder / BOARD_TOML, target_of(board))
