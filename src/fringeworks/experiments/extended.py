"""The paper's models beside the full one on the twin: held-out planes and its cylinder.

The paper's rig, with distortion in both lenses, is calibrated from its fourteen poses with noise;
the extended parameters are fitted to the same captures. Two walls and the cylinder, of which the
calibration knows nothing, are scanned with noise and without: without it, what is left is
systematic.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from fringeworks.calibrate.extended.points import fit_captures
from fringeworks.experiments.held_rig import Still
from fringeworks.experiments.truth import find_bias, inner_pixels
from fringeworks.experiments.twin_loop import calibrate_twin
from fringeworks.files import read_capture
from fringeworks.geometry.forms import fit_cylinder
from fringeworks.model import Cloud, ModelName, Rig
from fringeworks.model import Sequence as Patterns
from fringeworks.model.progress import Progress
from fringeworks.patterns import make_sequence
from fringeworks.pipeline import cloud_of
from fringeworks.twin.effects import Effects
from fringeworks.twin.scene import Material, Object, Plane, Scene
from fringeworks.twin.scenes import CYLINDER_RADIUS_MM, cylinder_scene, paper_rig, place, wall_scene

Variants: TypeAlias = Mapping[str, tuple[Rig, ModelName]]
"""By name: a rig, and the model that its scans are made with."""

Scanner: TypeAlias = Callable[[Still], Cloud]

HEAD = (
    "model",
    "planes rms µm",
    "systematic µm",
    "form µm",
    "cylinder systematic µm",
    "radius µm",
)


@dataclass(frozen=True, slots=True)
class ModelScore:
    """What a model errs by, mm.

    Attributes
    ----------
    planes_rms_mm, planes_systematic_mm
        Root mean square error of z on both walls, with noise and without.
    planes_form_mm
        Without noise, along the normal, after rigid alignment of each wall by itself.
    cylinder_systematic_mm
        As of the walls, after rigid alignment: the error's root mean square along the normal.
    radius_error_mm
        Fitted less true, without noise.
    """

    planes_rms_mm: float
    planes_systematic_mm: float
    planes_form_mm: float
    cylinder_systematic_mm: float
    radius_error_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """Walls and cylinder as captured with noise and without."""

    noisy: tuple[Still, ...]
    walls: tuple[Still, ...]
    cylinder: Still

    @classmethod
    def of(cls, rig: Rig, patterns: Patterns, *, seed: int = 0) -> HeldOut:
        """The scenes before the true rig."""
        walls = (wall_scene(), near_wall_scene())
        return cls(
            tuple(
                Still.of(scene, rig, patterns, effects=Effects(), seed=seed + index)
                for index, scene in enumerate(walls)
            ),
            tuple(Still.of(scene, rig, patterns) for scene in walls),
            Still.of(cylinder_scene(), rig, patterns),
        )


def near_wall_scene() -> Scene:
    """A second wall, nearer and turned the other way, so that both fill the calibrated volume."""
    wall = Object("wall", Plane(), place((0.0, 0.0, 630.0), (10.0, -12.0, 0.0)), Material(0.8))
    return Scene("near_wall", (wall,))


def compare_on_twin(
    folder: Path, *, quick: bool = False, seed: int = 0, progress: Progress
) -> dict[str, ModelScore]:
    """Calibrate the twin, fit, scan and score; captures are kept in `folder`."""
    true = paper_rig()
    width, height = true.projector.width, true.projector.height
    patterns = make_sequence("paper", width=width, height=height)
    board = folder / "board"
    rig, _ = calibrate_twin(true, patterns, board, quick=quick, seed=seed, progress=progress)
    captures = sorted(path.parent for path in board.glob("*/capture.toml"))
    variants = extend_variants(rig, captures, progress=progress)
    return score_models(variants, HeldOut.of(true, patterns, seed=seed))


def extend_variants(rig: Rig, captures: Sequence[Path], *, progress: Progress) -> Variants:
    """The rig by every model, the extended ones fitted to the captures that it comes from."""
    fitted = {
        mode: fit_captures(map(read_capture, progress(captures, "planes")), rig, mode=mode).extended
        for mode in ("paper", "map")
    }
    return {
        "geometric": (rig, "geometric"),
        "extended, paper": (replace(rig, extended=fitted["paper"]), "extended"),
        "extended, MAP": (replace(rig, extended=fitted["map"]), "extended"),
        "full": (rig, "full"),
    }


def score_models(variants: Variants, held_out: HeldOut) -> dict[str, ModelScore]:
    """What each variant errs by."""
    return {
        name: score_scans(scan_by(rig, model), held_out) for name, (rig, model) in variants.items()
    }


def scan_by(rig: Rig, model: ModelName) -> Scanner:
    """Scans with a rig by one of its models."""
    return lambda still: cloud_of(still.capture, still.projector_map, rig, model=model)


def tabulate_scores(scores: Mapping[str, ModelScore]) -> list[tuple[str, ...]]:
    """Rows under `HEAD`, µm."""
    return [
        (
            name,
            f"{1e3 * score.planes_rms_mm:.1f}",
            f"{1e3 * score.planes_systematic_mm:.1f}",
            f"{1e3 * score.planes_form_mm:.1f}",
            f"{1e3 * score.cylinder_systematic_mm:.1f}",
            f"{1e3 * score.radius_error_mm:+.1f}",
        )
        for name, score in scores.items()
    ]


def score_scans(scan: Scanner, held_out: HeldOut) -> ModelScore:
    """What scans err by."""
    walls, cylinder = [scan(still) for still in held_out.walls], scan(held_out.cylinder)
    true = held_out.cylinder.truth
    inner = cylinder.xyz[inner_pixels(true) & cylinder.valid].astype(np.float64)
    aligned = [
        find_bias(cloud, still.truth).normal_mm
        for cloud, still in zip(walls, held_out.walls, strict=True)
    ]
    return ModelScore(
        planes_rms_mm=_depth_rms([scan(still) for still in held_out.noisy], held_out.noisy),
        planes_systematic_mm=_depth_rms(walls, held_out.walls),
        planes_form_mm=_root_mean(np.concatenate([part.ravel() for part in aligned])),
        cylinder_systematic_mm=_root_mean(find_bias(cylinder, true).normal_mm),
        radius_error_mm=fit_cylinder(inner).radius_mm - CYLINDER_RADIUS_MM,
    )


def _depth_rms(clouds: Sequence[Cloud], stills: Sequence[Still]) -> float:
    """Root mean square error of z over the inner pixels of all."""
    errors = [
        np.where(inner_pixels(still.truth), cloud.xyz[..., 2] - still.truth.xyz[..., 2], np.nan)
        for cloud, still in zip(clouds, stills, strict=True)
    ]
    return _root_mean(np.concatenate([error.ravel() for error in errors]))


def _root_mean(values: np.typing.NDArray[np.floating]) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
