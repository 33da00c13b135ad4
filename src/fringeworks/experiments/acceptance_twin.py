"""An acceptance test on the twin: artefacts in the rig's volume, scanned by a calibrated rig.

The rig is calibrated on the twin first, from its own board, with all noise: what the certificate
tells is what calibration and scan leave together. Rig and clouds are kept, so that a run that was
cut off goes on; the plan that is written beside them is one as anybody's.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from fringeworks.calibrate import calibrate_captures
from fringeworks.experiments.calibrations import half_rig
from fringeworks.files import read_rig, write_cloud, write_rig
from fringeworks.files.acceptance import Plan, Position, write_plan
from fringeworks.measure.acceptance import Artefacts, CalibratedLength, Form
from fringeworks.measure.acceptance.certificate import Quantity
from fringeworks.measure.region import Range, Region
from fringeworks.model import Capture, Pose, Progress, Rig, Sequence, no_progress
from fringeworks.patterns import make_sequence
from fringeworks.patterns.presets import Preset
from fringeworks.pipeline import scan
from fringeworks.twin.scene import Object, Plane, Scene, Sphere, Vector
from fringeworks.twin.scenes import BOARD, PAPER, PLASTER, board_scene, paper_rig, place, target_of
from fringeworks.twin.simulate import simulate

PLAN_TOML, RIG_JSON = "plan.toml", "rig.json"

VOLUME_MM = (180.0, 130.0, 160.0)
MIDDLE_MM = (0.0, 0.0, 660.0)
"""Of the volume, whose sides are the camera's axes: all of it is seen and lit."""

BALL_MM, BAR_MM, BAR_BALL_MM, FLAT_MM = 40.0, 100.0, 30.0, (140.0, 60.0)

ARTEFACTS = Artefacts(
    ball=CalibratedLength(BALL_MM, 0.002),
    ball_form=Form(0.002, 0.001),
    bar=CalibratedLength(BAR_MM, 0.002),
    flat=Form(0.003, 0.001),
)
"""The twin's are exact. Told is what certificates of such artefacts say, so that it counts."""

LIMITS_MM: dict[Quantity, float] = {"PF": 1.0, "PS": 0.1, "SD": 0.1, "F": 1.0}

BALLS: tuple[Vector, ...] = (
    *((x, y, z) for z in (600.0, 720.0) for y in (-42.0, 42.0) for x in (-70.0, 70.0)),
    (0.0, 0.0, 600.0),
    (0.0, 0.0, 660.0),
)
"""Centres of the ball: the volume's corners, its middle and its front."""

BARS: tuple[tuple[Vector, Vector], ...] = (
    (MIDDLE_MM, (180.0, 130.0, 160.0)),
    (MIDDLE_MM, (-180.0, 130.0, 160.0)),
    (MIDDLE_MM, (180.0, -130.0, 160.0)),
    (MIDDLE_MM, (-180.0, -130.0, 160.0)),
    ((0.0, -20.0, 600.0), (1.0, 0.0, 0.0)),
    ((0.0, 20.0, 720.0), (1.0, 0.0, 0.0)),
    ((-40.0, 0.0, 680.0), (0.0, 1.0, 0.0)),
)
"""Middle and direction of the bar: the volume's four diagonals, along x in front and behind, y."""

FLATS: tuple[tuple[Vector, Vector], ...] = (
    ((0.0, 0.0, 590.0), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 730.0), (0.0, 0.0, -35.0)),
    (MIDDLE_MM, (0.0, 30.0, 0.0)),
    (MIDDLE_MM, (0.0, -30.0, 0.0)),
    (MIDDLE_MM, (0.0, 0.0, 30.0)),
    (MIDDLE_MM, (30.0, 0.0, -30.0)),
)
"""Middle and rotation vector, degrees, of the flat: in front, behind, tilted, diagonal."""

MARGIN_MM = 4.0
"""Around a ball, of the box that its points are chosen by."""

SUFFIXES = {"ball": ".ply", "bar": ".ply", "flat": ".npz"}
"""Only a flat's point precision needs the grid, whose void pixels are most of a file."""

QUICK_STEP = 3
"""Of positions, every third one."""

QUICK_POSES_STEP = 2


@dataclass(frozen=True, slots=True)
class Placed:
    """An artefact somewhere: what the twin sees, and what the plan says of it."""

    scene: Scene
    position: Position


def prepare_twin(
    folder: Path,
    *,
    preset: Preset = "paper",
    seed: int = 0,
    quick: bool = False,
    progress: Progress = no_progress,
) -> Path:
    """Calibrate the paper's rig, scan every position, write a plan; returns the plan's path.

    What `folder` has of it already is used again: remove it where the code has changed.

    Parameters
    ----------
    quick
        Half the pixels and a third of the positions: its numbers mean nothing.
    """
    kept = folder / f"{preset}-{seed:02d}{'-quick' if quick else ''}"
    true = half_rig(paper_rig()) if quick else paper_rig()
    sequence = make_sequence(preset, width=true.projector.width, height=true.projector.height)
    twin = _Twin(true, sequence, seed)
    rig = twin.rig(kept / RIG_JSON, quick=quick, progress=progress)
    placed = place_artefacts(quick=quick)
    twin.scan(placed, rig, kept, progress)
    write_plan(kept / PLAN_TOML, _plan([item.position for item in placed], preset))
    return kept / PLAN_TOML


def place_artefacts(*, quick: bool = False) -> list[Placed]:
    """All positions: ten of the ball, seven of the bar, six of the flat."""
    step = QUICK_STEP if quick else 1
    placed = [_ball(number, centre) for number, centre in enumerate(BALLS, start=1)][::step]
    placed += [_bar(number, *row) for number, row in enumerate(BARS, start=1)][::step]
    placed += [_flat(number, *row) for number, row in enumerate(FLATS, start=1)][::step]
    return placed


@dataclass(frozen=True, slots=True)
class _Twin:
    """The true rig, and how it is used."""

    true: Rig
    sequence: Sequence
    seed: int

    def rig(self, path: Path, *, quick: bool, progress: Progress) -> Rig:
        """The calibrated one, as it is kept, or made and kept."""
        if not path.exists():
            views = board_scene().views()[:: QUICK_POSES_STEP if quick else 1]
            captures = self._captures(list(views), 0, progress, "calibrating")
            write_rig(path, calibrate_captures(captures, target_of(BOARD)))
        return read_rig(path)

    def scan(self, placed: list[Placed], rig: Rig, folder: Path, progress: Progress) -> None:
        """Keep the clouds that are missing."""
        paths = [folder / item.position.source for item in placed]
        missing = [number for number, path in enumerate(paths) if not path.exists()]
        scenes = [placed[number].scene for number in missing]
        captures = self._captures(scenes, 1, progress, "scanning", numbers=missing)
        for number, capture in zip(missing, captures, strict=True):
            write_cloud(paths[number], scan(capture, rig))

    def _captures(
        self,
        scenes: list[Scene],
        part: int,
        progress: Progress,
        what: str,
        *,
        numbers: list[int] | None = None,
    ) -> Iterator[Capture]:
        """Each with noise of its own, whichever of them are made in this run."""
        numbers = list(range(len(scenes))) if numbers is None else numbers
        jobs = [
            (scene, np.random.default_rng([self.seed, part, number]))
            for scene, number in zip(scenes, numbers, strict=True)
        ]
        with ThreadPoolExecutor(os.cpu_count()) as pool:  # the kernels hold no lock
            waiting = [pool.submit(self._capture, *job) for job in jobs]
            for one in progress(waiting, what):
                yield one.result()

    def _capture(self, scene: Scene, rng: np.random.Generator) -> Capture:
        return simulate(scene, self.true, self.sequence, rng=rng).capture


def _plan(positions: list[Position], preset: str) -> Plan:
    return Plan(
        name=f"the paper's rig on the twin, patterns '{preset}'",
        volume_mm=VOLUME_MM,
        artefacts=ARTEFACTS,
        positions=tuple(positions),
        limits_mm=LIMITS_MM,
    )


def _ball(number: int, centre: Vector) -> Placed:
    return _placed("ball", number, [_sphere("ball", centre, BALL_MM)])


def _bar(number: int, middle: Vector, along: Vector) -> Placed:
    half = BAR_MM / 2 * np.array(along) / np.linalg.norm(along)
    ends = [np.array(middle) + sign * half for sign in (-1, 1)]
    balls = [
        _sphere(name, (float(x), float(y), float(z)), BAR_BALL_MM)
        for name, (x, y, z) in zip(("first", "second"), ends, strict=True)
    ]
    return _placed("bar", number, balls)


def _flat(number: int, middle: Vector, turn: Vector) -> Placed:
    flat = Object("flat", Plane(*FLAT_MM), place(middle, turn), PAPER)
    return _placed("flat", number, [flat])


def _sphere(name: str, centre: Vector, diameter: float) -> Object:
    return Object(name, Sphere(diameter / 2), Pose(np.eye(3), np.array(centre)), PLASTER)


def _placed(artefact: Literal["ball", "bar", "flat"], number: int, objects: list[Object]) -> Placed:
    name = f"{artefact} {number}"
    source = name.replace(" ", "_") + SUFFIXES[artefact]
    regions = tuple(_region(item) for item in objects)
    return Placed(
        Scene(name, tuple(objects)),
        Position(name, artefact, source, is_capture=False, regions=regions),
    )


def _region(item: Object) -> Region:
    """A box about a ball; a flat is alone, and needs none."""
    if not isinstance(item.shape, Sphere):
        return Region()
    reach = item.shape.radius_mm + MARGIN_MM
    x, y, z = (_about(float(middle), reach) for middle in item.camera_from_object.translation_mm)
    return Region(box_mm=(x, y, z))


def _about(middle: float, reach: float) -> Range:
    return middle - reach, middle + reach
