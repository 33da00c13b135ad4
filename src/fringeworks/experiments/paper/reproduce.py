"""The paper, chapter by chapter: the list of its parts, and the runner."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

from fringeworks.experiments.paper.calibration import calibrate_both
from fringeworks.experiments.paper.chapter import Chapter
from fringeworks.experiments.paper.code import read_codes
from fringeworks.experiments.paper.cylinder import measure_cylinder
from fringeworks.experiments.paper.ends import look_at_ends
from fringeworks.experiments.paper.kinect import compare_kinect
from fringeworks.experiments.paper.lab import Lab
from fringeworks.experiments.paper.many import check_claims, draw_many
from fringeworks.experiments.paper.pace import time_models
from fringeworks.experiments.paper.parameters import fit_parameters
from fringeworks.experiments.paper.route import follow_route
from fringeworks.experiments.paper.sampling import sample_errors
from fringeworks.experiments.paper.setup import show_setup
from fringeworks.experiments.paper.two import measure_two
from fringeworks.model import Progress, no_progress
from fringeworks.twin.scenes import cylinder_scene, hand_scene, two_scene, wall_scene

Maker: TypeAlias = Callable[[Lab], Chapter]

CHAPTERS: Mapping[str, Maker] = MappingProxyType(
    {
        "setup": show_setup,
        "errors": sample_errors,
        "calibration": calibrate_both,
        "parameters": fit_parameters,
        "route": follow_route,
        "cylinder": measure_cylinder,
        "speckle": compare_kinect,
        "range": look_at_ends,
        "code": read_codes,
        "two": measure_two,
        "rigs": draw_many,
        "claims": check_claims,
        "pace": time_models,
    }
)
"""In the paper's order, by the names that the JSON has for them."""


SCENES = (cylinder_scene(), hand_scene(), wall_scene(), two_scene())


def reproduce(
    folder: Path, *, quick: bool = False, progress: Progress = no_progress
) -> dict[str, Chapter]:
    """Make every chapter; captures and rigs are kept in `folder` and used again.

    Parameters
    ----------
    quick
        Fewer poses, rigs and repeats: a look, no result.

    Raises
    ------
    FringeworksError
        What is kept cannot be read, or cannot be written.
    """
    lab = Lab(folder, quick=quick, progress=progress)
    lab.prepare(SCENES)
    return {name: CHAPTERS[name](lab) for name in progress(list(CHAPTERS), "chapters")}
