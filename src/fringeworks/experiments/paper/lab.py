"""The laboratory: the twin of the paper's rig, its captures in a folder, what they calibrate.

Captures and rigs are kept and used again as long as they show the same patterns and are of this
version: an interrupted run goes on where it stopped. Remove the folder where the code has changed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from collections.abc import Sequence as Items
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from fringeworks import __version__
from fringeworks.acquire.simulated import BOARD_TOML, TRUTH_NPZ, write_simulations
from fringeworks.calibrate import calibrate_captures
from fringeworks.calibrate.extended.fit import ExtendedFit, Mode
from fringeworks.calibrate.extended.points import fit_captures
from fringeworks.calibrate.projected.solve import calibrate_paper
from fringeworks.experiments.code_frame import see_template
from fringeworks.experiments.held_rig import Still
from fringeworks.files import read_board, read_capture, read_rig, write_rig
from fringeworks.files.capture import CAPTURE_TOML
from fringeworks.files.truth import read_truth
from fringeworks.geometry.forms import CylinderFit, fit_cylinder
from fringeworks.model import (
    Capture,
    Cloud,
    ModelName,
    Progress,
    Rig,
    Sequence,
    Target,
    no_progress,
)
from fringeworks.patterns import make_sequence
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.window import CoordinateWindow
from fringeworks.twin.scene import Scene
from fringeworks.twin.scenes import board_scene, paper_rig

QUICK_STEP = 4
"""Of the poses, every fourth one is enough for a quick look: four of fourteen."""

QUICK_THIN = 5
"""Of a cylinder's points, every so many are fitted for a quick look."""

BOARD_SEED, SCENE_SEED, TEMPLATE_SEED = 0, 1, 1


RIGS = ("joint", "paper")
MODES: tuple[Mode, ...] = ("paper", "map")

Item = TypeVar("Item")
Made = TypeVar("Made")


class Lab:
    """All that the chapters share.

    Parameters
    ----------
    folder
        Where captures are kept.
    quick
        Fewer poses, rigs and draws.
    """

    def __init__(
        self, folder: Path, *, quick: bool = False, progress: Progress = no_progress
    ) -> None:
        self.folder = folder
        self.quick = quick
        self.progress = progress
        self.true_rig = paper_rig()
        self._stills: dict[tuple[str, bool], Still] = {}
        self._fits: dict[tuple[str, Mode], ExtendedFit] = {}

    def spread(self, make: Callable[[Item], Made], items: Items[Item], words: str) -> list[Made]:
        """What `make` gives of every item, as many at a time as there are cores."""
        with ThreadPoolExecutor(os.cpu_count()) as pool:  # the kernels hold no lock
            waiting = [pool.submit(make, item) for item in items]
            return [one.result() for one in self.progress(waiting, words)]

    @cached_property
    def patterns(self) -> Sequence:
        """The paper's: three fringes, the code frame, and Gray code to compare with, along x."""
        projector = self.true_rig.projector
        return make_sequence("paper", width=projector.width, height=projector.height, axes=("x",))

    @cached_property
    def poses(self) -> tuple[Path, ...]:
        """Captures of the calibration board: fringes of both axes, and a projected checkerboard."""
        scene, projector = board_scene(), self.true_rig.projector
        if self.quick:
            scene = replace(scene, poses=scene.poses[::QUICK_STEP])
        shown = make_sequence("paper-calibrate", width=projector.width, height=projector.height)
        folder = self.folder / ("board-quick" if self.quick else "board")
        wanted = tuple(folder / view.name for view in scene.views())
        if not (folder / BOARD_TOML).exists() or not all(_shows(one, shown) for one in wanted):
            for old in folder.glob("rig-*.json"):
                old.unlink()
            write_simulations(
                scene,
                self.true_rig,
                shown,
                folder,
                seed=BOARD_SEED,
                overwrite=True,
                progress=self.progress,
            )
        return wanted

    @cached_property
    def good_rig(self) -> Rig:
        """By our joint calibration."""
        return self._calibrate("joint", calibrate_captures)

    @cached_property
    def paper_rig(self) -> Rig:
        """By the paper's way, from the same captures: printed, then projected corners."""
        return self._calibrate("paper", calibrate_paper)

    @cached_property
    def template(self) -> CoordinateWindow:
        """The paper's: what the code frame shows on the board says where each pixel can be."""
        return see_template(seed=TEMPLATE_SEED)

    def rig(self, name: str) -> Rig:
        """``joint`` or ``paper``."""
        return self.good_rig if name == "joint" else self.paper_rig

    def _calibrate(self, name: str, calibrate: Callable[[Iterable[Capture], Target], Rig]) -> Rig:
        folder = self.poses[0].parent
        kept = folder / f"rig-{name}.json"
        if not kept.exists():
            board = read_board(folder / BOARD_TOML)
            write_rig(kept, calibrate(self._read(f"calibrating, {name}"), board))
        return read_rig(kept)

    def fit(self, rig: str, mode: Mode) -> ExtendedFit:
        """The ten parameters of a rig, fitted to its own boards."""
        if (rig, mode) not in self._fits:
            captures = self._read(f"extended parameters, {rig} rig, {mode}")
            self._fits[rig, mode] = fit_captures(captures, self.rig(rig), mode=mode)
        return self._fits[rig, mode]

    def models(self, rig: str) -> dict[str, tuple[Rig, ModelName]]:
        """A rig by every model, the paper's first."""
        found = self.rig(rig)
        extended = {mode: self.fit(rig, mode).extended for mode in ("paper", "map")}
        return {
            "equations 1 to 3": (found, "geometric"),
            "extended, paper": (replace(found, extended=extended["paper"]), "extended"),
            "extended, MAP": (replace(found, extended=extended["map"]), "extended"),
            "full": (found, "full"),
        }

    def prepare(self, scenes: Items[Scene]) -> None:
        """Make side by side what most chapters need: captures, both rigs, their parameters."""
        rigs = RIGS if self.poses else ()  # captured before threads read them
        self.spread(self.rig, rigs, "rigs")
        self.spread(self._fit_one, [(rig, mode) for rig in RIGS for mode in MODES], "parameters")
        self.spread(self.still, scenes, "scenes")

    def _fit_one(self, job: tuple[str, Mode]) -> ExtendedFit:
        return self.fit(*job)

    def still(self, scene: Scene, *, noisy: bool = True) -> Still:
        """A scene captured by `patterns` and decoded by Gray code; noisy captures are kept."""
        key = (scene.name, noisy)
        if key not in self._stills:
            self._stills[key] = self._keep(scene) if noisy else self._simulate(scene)
        return self._stills[key]

    def _simulate(self, scene: Scene) -> Still:
        return Still.of(scene, self.true_rig, self.patterns)

    def _keep(self, scene: Scene) -> Still:
        folder = self.folder / scene.name
        if not _shows(folder, self.patterns):
            write_simulations(
                scene, self.true_rig, self.patterns, folder, seed=SCENE_SEED, overwrite=True
            )
        capture = read_capture(folder)
        return Still(scene, capture, decode_capture(capture), read_truth(folder / TRUTH_NPZ))

    def fit_cylinder(self, cloud: Cloud) -> CylinderFit:
        """Through all points of a cloud, or, quick, through some of them."""
        return fit_cylinder(cloud.points()[:: QUICK_THIN if self.quick else 1])

    def _read(self, description: str) -> Iterable[Capture]:
        return map(read_capture, self.progress(self.poses, description))


def _shows(folder: Path, patterns: Sequence) -> bool:
    """Whether a capture of these patterns, made by this version, is there."""
    if not (folder / CAPTURE_TOML).exists():
        return False
    capture = read_capture(folder)
    made_by = capture.provenance.get("twin")
    return capture.sequence == patterns and made_by == f"fringeworks {__version__}"
