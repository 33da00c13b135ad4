"""The whole loop on the digital twin: board poses, calibration, scans, numbers beside the truth.

The captures are written and read again as anybody's are: what is measured went through every file
format and every stage of the line.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fringeworks.acquire.simulated import BOARD_TOML, TRUTH_NPZ, write_simulations
from fringeworks.calibrate import calibrate_captures
from fringeworks.experiments.truth import Bias, find_bias, predicted_form_mm, sigma_ratio
from fringeworks.files import read_board, read_capture, write_cloud, write_rig
from fringeworks.files.truth import read_truth
from fringeworks.geometry.forms import CylinderFit
from fringeworks.measure.region import Region
from fringeworks.model import Capture, Cloud, Rig, Sequence
from fringeworks.model.progress import Progress
from fringeworks.patterns import make_sequence
from fringeworks.phase.decode import Decoding, decode_phases
from fringeworks.pipeline import cloud_of, measure_cylinder
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Cylinder, Scene
from fringeworks.twin.scenes import board_scene, cylinder_scene, paper_rig, two_scene
from fringeworks.twin.simulate import simulate
from fringeworks.twin.truth import Truth

QUICK_STEP = 3
"""Of the poses, every third one is enough for a quick look: five of fourteen."""

LEFT_OBJECT = Region(box_mm=((-np.inf, 0.0), (-np.inf, np.inf), (-np.inf, np.inf)))
"""Where the cylinder of the scene `two` is: left of the camera's axis."""


@dataclass(frozen=True, slots=True)
class Scanned:
    """A scene at every stop of the line, and the cylinder found in it."""

    capture: Capture
    decoding: Decoding
    cloud: Cloud
    truth: Truth
    cylinder: CylinderFit
    true_radius_mm: float


@dataclass(frozen=True, slots=True)
class TwinLoop:
    """What the loop has found.

    `bias` is that of the cylinder scanned without noise; `predicted_form_mm` the form rms that
    sigma predicts of it, `sigma_ratio` predicted over observed sigma of its depth.
    """

    true_rig: Rig
    rig: Rig
    poses: int
    sequence: Sequence
    scans: tuple[Scanned, ...]
    bias: Bias
    predicted_form_mm: float
    sigma_ratio: float


def run_twin_loop(
    folder: Path, *, quick: bool = False, seed: int = 0, progress: Progress
) -> TwinLoop:
    """Simulate, calibrate, scan and measure; captures, rig and clouds are kept in `folder`."""
    true_rig = paper_rig()
    sequence = make_sequence(
        "paper", width=true_rig.projector.width, height=true_rig.projector.height
    )
    rig, poses = calibrate_twin(
        true_rig, sequence, folder / "board", quick=quick, seed=seed, progress=progress
    )
    write_rig(folder / "rig.json", rig)
    scenes = (cylinder_scene(), two_scene())
    scans = []
    for place, scene in enumerate(progress(scenes, "scanning")):
        target = folder / scene.name
        write_simulations(scene, true_rig, sequence, target, seed=seed + 1 + place, overwrite=True)
        scans.append(scan_twin(scene, target, rig))
    quiet = scan_without_noise(scenes[0], true_rig, rig, sequence)
    return TwinLoop(
        true_rig=true_rig,
        rig=rig,
        poses=poses,
        sequence=sequence,
        scans=tuple(scans),
        bias=find_bias(quiet, scans[0].truth),
        predicted_form_mm=predicted_form_mm(scans[0].cloud, scans[0].cylinder),
        sigma_ratio=sigma_ratio(scans[0].cloud, quiet, scans[0].truth),
    )


def calibrate_twin(
    true_rig: Rig, sequence: Sequence, folder: Path, *, quick: bool, seed: int, progress: Progress
) -> tuple[Rig, int]:
    """The rig that a calibration finds from simulated poses of the board, and their number."""
    board = board_scene()
    if quick:
        board = replace(board, poses=board.poses[::QUICK_STEP])
    poses = write_simulations(
        board, true_rig, sequence, folder, seed=seed, overwrite=True, progress=progress
    )
    captures: Iterator[Capture] = map(read_capture, progress(poses, "calibrating"))
    return calibrate_captures(captures, read_board(folder / BOARD_TOML)), len(poses)


def scan_twin(scene: Scene, folder: Path, rig: Rig) -> Scanned:
    """Read, decode, triangulate and measure one simulated capture; its clouds are written."""
    capture = read_capture(folder)
    decoding = decode_phases(capture)
    cloud = cloud_of(capture, decoding.projector_map(), rig)
    write_cloud(folder / "cloud.npz", cloud)
    write_cloud(folder / "cloud.ply", cloud)
    shape = scene.objects[0].shape
    assert isinstance(shape, Cylinder)
    region = LEFT_OBJECT if len(scene.objects) > 1 else Region()
    return Scanned(
        capture=capture,
        decoding=decoding,
        cloud=cloud,
        truth=read_truth(folder / TRUTH_NPZ),
        cylinder=measure_cylinder(cloud, region),
        true_radius_mm=shape.radius_mm,
    )


def scan_without_noise(scene: Scene, true_rig: Rig, rig: Rig, sequence: Sequence) -> Cloud:
    """The scene scanned with the calibrated rig by a camera and a projector without noise."""
    effects, rng = Effects().without_noise(), np.random.default_rng(0)
    made = simulate(scene, true_rig, sequence, effects=effects, rng=rng)
    decoding = decode_phases(made.capture)
    return cloud_of(made.capture, decoding.projector_map(), rig)
