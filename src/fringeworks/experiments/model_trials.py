"""One calibration of the twin, and what every model makes of what it has not seen.

The rig is calibrated from fourteen poses of its board, captured with noise; everything else is
fitted to the same captures: the paper's ten parameters, residual fields, and the rivals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from fringeworks.calibrate.extended.points import measure_planes
from fringeworks.calibrate.residual.choose import Choice, choose_fields
from fringeworks.experiments.extended import (
    HeldOut,
    ModelScore,
    Scanner,
    extend_variants,
    scan_by,
    score_scans,
)
from fringeworks.experiments.rivals import PIXELS, fit_rivals
from fringeworks.experiments.truth import inner_pixels
from fringeworks.experiments.twin_loop import calibrate_twin
from fringeworks.files import read_capture
from fringeworks.model import Progress, Rig
from fringeworks.model import Sequence as Patterns

WITH_FIELD = " + field"


@dataclass(frozen=True, slots=True)
class FieldTold:
    """What came of one residual field: order 0 is none; rms of regions of unseen views, px."""

    model: str
    axis: str
    order: int
    rms_px: float
    rms_with_px: float

    @classmethod
    def of(cls, choice: Choice) -> FieldTold:
        before, after = choice.rms_px
        order = 0 if choice.field is None else choice.field.order
        return cls(choice.model, choice.axis, order, before, after)


@dataclass(frozen=True, slots=True)
class ModelTrial:
    """What one calibration gave.

    Attributes
    ----------
    rig, seed
        Which rig's name, and the seed of its captures' noise.
    scores
        By model.
    fields
        What came of the residual fields.
    covered
        Share of the first wall's inner pixels for which the polynomials per pixel have a point.
    """

    rig: str
    seed: int
    scores: dict[str, ModelScore]
    fields: tuple[FieldTold, ...]
    covered: float


def run_models(
    rig: tuple[str, Rig],
    patterns: Patterns,
    folder: Path,
    *,
    held_out: HeldOut,
    seed: int,
    quick: bool,
    progress: Progress,
) -> ModelTrial:
    """Calibrate a named rig by captures that go to `folder`, fit everything, scan and score."""
    name, true = rig
    found, _ = calibrate_twin(true, patterns, folder, quick=quick, seed=seed, progress=progress)
    captures = sorted(path.parent for path in folder.glob("*/capture.toml"))
    variants = extend_variants(found, captures, progress=progress)
    scanners: dict[str, Scanner] = {key: scan_by(*variant) for key, variant in variants.items()}
    mended, _ = variants["extended, MAP"]
    chosen = choose_fields(mended)
    fields = tuple(choice.field for choice in chosen if choice.field is not None)
    mended = replace(mended, residual=fields)
    for key in ("geometric", "extended, MAP", "full"):
        scanners[key + WITH_FIELD] = scan_by(mended, variants[key][1])
    measured = measure_planes(map(read_capture, progress(captures, "rivals")), found)
    rivals = fit_rivals(measured, found)
    scanners |= rivals
    wall = held_out.walls[0]
    return ModelTrial(
        rig=name,
        seed=seed,
        scores=_scores(scanners, held_out),
        fields=tuple(FieldTold.of(choice) for choice in chosen),
        covered=float(rivals[PIXELS](wall).valid[inner_pixels(wall.truth)].mean()),
    )


def _scores(scanners: Mapping[str, Scanner], held_out: HeldOut) -> dict[str, ModelScore]:
    return {name: score_scans(scan, held_out) for name, scan in scanners.items()}
