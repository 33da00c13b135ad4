"""Captures for the commands: rendered patterns as a camera would see them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from fringeworks.cli.app import app
from fringeworks.experiments import code_frame, twin_loop
from fringeworks.experiments.paper import lab
from fringeworks.files import read_image, write_capture, write_image, write_rig
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import (
    Capture,
    Fringe,
    Lens,
    PatternSet,
    Pose,
    Projector,
    Rig,
    Sensor,
    Sequence,
)
from fringeworks.patterns import frequency_ladder
from fringeworks.twin.scenes import paper_rig
from tests.scenes import CAMERA, coarser, map_of, plane_points

RIG = Rig(
    CAMERA,
    Projector(608, 684, Lens(1013, 1015, 300, 340, -0.05, 0.03, 1e-3, -5e-4)),
    Pose(rotation_matrix(np.array([0.02, 0.24, 0.01])), np.array([-180.0, 5.0, 20.0])),
)
"""Its projector lights all of the plane below that its camera sees."""

DARK, BRIGHT = 20.0, 0.8
"""Grey level of black, and the share of the projector's light that arrives."""

PLANE_NORMAL, PLANE_MM = (0.0, -0.2588190451, -0.9659258263), -760.0


def run(*arguments: object) -> Any:
    """One command in this process: `exit_code`, `stdout`, `stderr`, `exception`."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def shrink_camera(patch: pytest.MonkeyPatch, times: float) -> None:
    """The loops on the twin with so many times fewer camera pixels each way; all else stays.

    What a command does is the same, and its captures take that much squared less time.
    """
    seen = coarser(paper_rig(), times)
    for module in (lab, code_frame, twin_loop):
        patch.setattr(module, "paper_rig", lambda: seen)


def plain(text: str) -> str:
    """Words with single blanks: help wraps lines as it likes."""
    return re.sub(r"\s+", " ", text)


def see(patterns: Path, capture: Path) -> None:
    """The folder of patterns as seen by a camera whose pixels are the projector's."""
    capture.mkdir(parents=True)
    (capture / "capture.toml").write_text((patterns / "capture.toml").read_text())
    for path in patterns.glob("*.png"):
        seen = np.rint(DARK + BRIGHT * read_image(path)).astype(np.uint8)
        write_image(capture / path.name, seen)


def write_plane_scan(folder: Path) -> tuple[Path, Path]:
    """Capture and rig.json of a plane at `PLANE_MM`, three frequencies of four steps per axis."""
    write_rig(folder / "rig.json", RIG)
    seen = map_of(RIG, plane_points(RIG, PLANE_NORMAL, PLANE_MM))
    sets, stacks = [], []
    for axis in seen.axes:
        extent = RIG.projector.width if axis.axis == "x" else RIG.projector.height
        for period in frequency_ladder(extent):
            fringe = Fringe(axis.axis, period, tuple(np.arange(4) * np.pi / 2))
            sets.append(PatternSet(fringe))
            stacks.append(fringe_frames(fringe, axis.coordinate))
    sequence = Sequence(RIG.projector.width, RIG.projector.height, tuple(sets))
    write_capture(Capture(sequence, tuple(stacks), Sensor(255.0)), folder / "plane")
    return folder / "plane", folder / "rig.json"


def fringe_frames(fringe: Fringe, coordinate: NDArray[np.float32]) -> NDArray[np.uint8]:
    """``(n, H, W)`` grey levels where each pixel sees the projector coordinate given."""
    turns = (coordinate.astype(float) - fringe.zero_px) / fringe.period_px
    waves = [np.cos(2 * np.pi * turns - shift) for shift in fringe.shifts_rad]
    grey: NDArray[np.uint8] = np.rint(120 + 90 * np.stack(waves)).astype(np.uint8)
    return grey
