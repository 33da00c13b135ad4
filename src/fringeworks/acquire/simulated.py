"""Captures of simulated scenes, each with its truth and all that made it beside its images."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fringeworks import __version__
from fringeworks.errors import UsageError
from fringeworks.files import write_board, write_capture, write_rig, write_scene, write_sensor
from fringeworks.files.capture import CAPTURE_TOML
from fringeworks.files.capture_writing import check_folder, describe_capture, make_room
from fringeworks.files.scene import files_written
from fringeworks.files.truth import write_truth
from fringeworks.model import GreyCurve, Rig, Sequence, Target
from fringeworks.model.progress import Progress, no_progress
from fringeworks.patterns import frame_names
from fringeworks.twin.cast import Caster
from fringeworks.twin.check import check_effects, check_scene, check_view
from fringeworks.twin.effects import Effects
from fringeworks.twin.expose import sensor_of
from fringeworks.twin.optics import optics_of
from fringeworks.twin.scene import Board, Scene
from fringeworks.twin.scenes import target_of
from fringeworks.twin.simulate import simulate
from fringeworks.twin.truth import find_truth

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
    curve: GreyCurve | None = None


def write_simulations(
    scene: Scene,
    rig: Rig,
    sequence: Sequence,
    folder: str | Path,
    *,
    effects: Effects | None = None,
    seed: int = 0,
    facts: Mapping[str, str | int] | None = None,
    inputs: Collection[Path] = (),
    curve: GreyCurve | None = None,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> list[Path]:
    """Simulate a scene and write one capture, or one per pose into ``pose_00``, ``pose_01``...

    Beside the images of each stand ``truth.npz``, and ``scene.toml``, ``sensor.toml`` and
    ``true_rig.json``, which made it and may be changed and used again; seed, version and `facts`
    are the capture's provenance; `curve` pre-distorts what is shown. A posed board's
    ``board.toml``, as a calibration is told it, stands in `folder`. The same seed gives the same
    grey levels. With `overwrite` the captures that are there are replaced, and further poses of an
    earlier call are no captures any more; `inputs`, the files that all this was read from, never
    are. Returns the folders of the captures.

    Raises
    ------
    UsageError
        A capture, or any file that would be written, is there already and `overwrite` is False;
        one of `inputs` would be replaced; or as `simulate`. All before anything is changed.
    FormatError
        A file cannot be written.
    """
    folder = Path(folder)
    check_folder(folder)
    views = scene.views()
    folders = [folder / view.name for view in views] if scene.poses else [folder]
    left_over = set(folder.glob("pose_[0-9][0-9]*")) - set(folders) if scene.poses else set()
    provenance = {"twin": f"fringeworks {__version__}", **(facts or {}), "seed": seed}
    plan = _Plan(rig, sequence, effects or Effects(), provenance, curve)
    board = _target(scene)
    _check(scene, plan)  # before anything that is there goes
    files = [] if board is None else [folder / BOARD_TOML]
    for view, target in zip(views, folders, strict=True):
        files += _files(view, target, sequence)
    _refuse_inputs(files, inputs)
    for target in [*folders, *sorted(left_over)]:
        make_room(target, overwrite=overwrite)
    if not overwrite:
        _refuse_existing(files)
    seeds = [np.random.default_rng(own) for own in np.random.SeedSequence(seed).spawn(len(views))]
    if len(views) == 1:
        _write_one(views[0], folders[0], seeds[0], plan=plan, progress=progress)
    else:
        _write_all(list(zip(views, folders, seeds, strict=True)), plan, progress)
    if board is not None:
        write_board(folder / BOARD_TOML, board)
    return folders


def _check(scene: Scene, plan: _Plan) -> None:
    """Refuse what would fail in the end, when an earlier capture is gone."""
    check_scene(scene)
    check_effects(plan.effects)
    sensor = sensor_of(plan.effects.camera)
    describe_capture(plan.sequence, sensor=sensor, provenance=plan.provenance)
    optics = optics_of(plan.rig)
    for view in scene.views():
        check_view(find_truth(Caster(view), *optics), scene=view.name)


def _files(scene: Scene, folder: Path, sequence: Sequence) -> list[Path]:
    """What is written of a scene into its folder."""
    images = [name for row in frame_names(sequence) for name in row]
    names = [TRUTH_NPZ, SENSOR_TOML, RIG_JSON, CAPTURE_TOML, *images]
    return [*files_written(folder / SCENE_TOML, scene), *(folder / name for name in names)]


def _refuse_inputs(files: Iterable[Path], inputs: Iterable[Path]) -> None:
    read = {path.resolve() for path in inputs}
    for path in files:
        if path.resolve() in read:
            raise UsageError(f"{path}: is read here and would be replaced; choose another folder")


def _refuse_existing(files: Iterable[Path]) -> None:
    for path in files:
        if path.exists():
            raise UsageError(f"{path}: is there already; choose another folder or overwrite it")


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
        scene,
        plan.rig,
        plan.sequence,
        effects=plan.effects,
        rng=rng,
        curve=plan.curve,
        progress=progress,
    )
    write_truth(folder / TRUTH_NPZ, made.truth)
    write_scene(folder / SCENE_TOML, scene)
    write_sensor(folder / SENSOR_TOML, plan.effects)
    write_rig(folder / RIG_JSON, plan.rig)
    write_capture(replace(made.capture, provenance=dict(plan.provenance)), folder)


def _target(scene: Scene) -> Target | None:
    """The board that the poses show, if it is one."""
    shapes = (item.shape for item in scene.objects if item.name == scene.posed)
    board = next((shape for shape in shapes if isinstance(shape, Board)), None)
    return None if board is None else target_of(board)
