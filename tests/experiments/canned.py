"""Trials of the study of calibrations with numbers that can be added up by hand."""

from __future__ import annotations

from dataclasses import replace

from fringeworks.calibrate.judge.structure import Structure
from fringeworks.calibrate.settings import BoardModel
from fringeworks.experiments.held_rig import HeldRig, Predicted
from fringeworks.experiments.trials import Kind, Outcome, Trial

ERRORS = {
    f"{device}.{name}": 0.1
    for device in ("camera", "projector")
    for name in ("fx", "fy", "cx", "cy")
}


def held(error_mm: float) -> HeldRig:
    """All its errors are the same; the radius is too small by it."""
    return HeldRig(
        wall_p95_mm=error_mm,
        cylinder_p95_mm=error_mm,
        radius_error_mm=-error_mm,
        radius_all_error_mm=error_mm,
        parameter_errors={**ERRORS, "baseline_mm": -0.2, "angle_rad": 1e-5},
    )


def trial(kind: Kind, seed: int, ours_mm: float = 0.002, plain_mm: float = 0.03) -> Trial:
    """A trial of a kind whose errors are told."""
    plain = Outcome(0.05, 0.1, kept=1230, offered=1232, held=held(plain_mm))
    ours = replace(
        plain,
        held=held(ours_mm),
        predicted=Predicted(0.002, 0.001, {"camera.fx": 1.5 - seed, "camera.cx": 0.5}),
        halves_ratio=1.0 + seed,
        structure=Structure(1.0 + seed, 1.0, 1.0, 1.0),
        kept=1232,
    )
    shapes: dict[BoardModel, Outcome] = dict.fromkeys(kind.shapes, ours)
    return Trial(kind.name, seed, shapes, plain)
