"""Thirty rigs as poor as the paper's, and the conclusion's three claims on the same draws.

Every draw is `draws.draw_rig`: none is left out. The claims change one prior each: a better board,
a camera of twice the resolution, better corners.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fringeworks.experiments.paper.chapter import Chapter, Grid, Row, Shown
from fringeworks.experiments.paper.draws import MODELS, draw_rig
from fringeworks.experiments.paper.lab import Lab
from fringeworks.experiments.paper.poor_board import POOR, Priors
from fringeworks.files.atomic import write_text
from fringeworks.report.reproduction import draw_spread

Array = NDArray[np.float64]
Trial: TypeAlias = Mapping[str, Any]
"""Errors by model and key of `SHOWN`, mm, signed; ``reprojection`` beside them."""

RIGS, QUICK_RIGS = 30, 3
CLAIM_RIGS, QUICK_CLAIM_RIGS = 12, 1

PAPERS = "as poor as the paper's"
SHARPER = "a camera of twice the resolution"


def better_board(priors: Priors) -> Priors:
    """Printed to 3 µm and 1e-4, on a plate that bows by 0.02 mm at most."""
    return replace(priors, print_scale=1e-4, print_mm=0.003, bow_mm=(0.005, 0.02))


def better_corners(priors: Priors) -> Priors:
    """Found to 0.02 px where printed, to 0.05 px of the projector where projected."""
    return replace(priors, corner_px=(0.02, 0.02), projected_px=(0.05, 0.05))


def sharper_camera(priors: Priors) -> Priors:
    """Twice the pixels each way; corners are found as well in px, half as far off in mm."""
    x, y = priors.projected_px
    return replace(priors, resolution=2, projected_px=(x / 2, y / 2))


CLAIMS: Mapping[str, Priors] = {
    PAPERS: POOR,
    "a better board": better_board(POOR),
    SHARPER: sharper_camera(POOR),
    "better corners": better_corners(POOR),
    "all three": sharper_camera(better_corners(better_board(POOR))),
}
UNCALIBRATED = "phi_0 off by the paper's K_phi"
NO_PHASE = replace(POOR, phase_rad=2.7)

PAPER_FIRST_MM = 0.6
"""What the paper's radius is off by with equations 1 to 3."""

SHOWN = {
    "radius_mm": "cylinder, radius",
    "chord_mm": "cylinder, half-chord",
    "planes_mm": "planes, rms",
    "form_mm": "planes, form rms",
}


def draw_many(lab: Lab) -> Chapter:
    """Errors of 30 rigs by every model, with phi_0 calibrated and without."""
    count = QUICK_RIGS if lab.quick else RIGS
    poor = run_draws(lab, PAPERS, POOR, count)
    without = run_draws(lab, UNCALIBRATED, NO_PHASE, count)
    chord = float(np.median(sizes_of(without, MODELS[0], "chord_mm")))
    phase = PAPER_FIRST_MM / chord * NO_PHASE.phase_rad
    figure = draw_spread(
        {"phi_0 known": _spread(poor), "phi_0 off": _spread(without)},
        label="error of the cylinder's radius, mm",
        marks={"(1)-(3)": 0.6, "mean": 0.25, "paper: half-chord": 0.03},
    )
    caption = f"The radius of the cylinder by {count} rigs, none left out."
    return Chapter(
        heading=f"{count} rigs as poor as the paper's: section 4.4's gain",
        words=WORDS,
        rows=[*_looks(poor), *_errors(poor, without), *_explains(poor, without, phase)],
        grids=(_grid("Sizes of errors, median / 90 %, mm", {PAPERS: poor, UNCALIBRATED: without}),),
        pictures=(Shown("rigs_radius", figure, caption),),
        numbers={
            "priors": asdict(POOR),
            "poor": list(poor),
            "phi_0_off": list(without),
            "phi_0_for_0.6_mm_rad": phase,
        },
    )


def _looks(poor: Sequence[Trial]) -> list[Row]:
    """How the calibrations look."""
    cameras = np.array([trial["reprojection"]["camera_std_px"] for trial in poor])
    projectors = np.array([trial["reprojection"]["projector_std_px"] for trial in poor])
    return [
        Row("camera reprojection, sd x, y, px, median", "0.0987, 0.0905", _pair(cameras)),
        Row("projector reprojection, sd x, y, px, median", "0.77, 0.485", _pair(projectors)),
    ]


def _errors(poor: Sequence[Trial], without: Sequence[Trial]) -> list[Row]:
    """Of the radius by every model."""
    first, extended, with_priors, full = MODELS
    off, beside = "the same with phi_0 off by 2.7 rad, mm", "0.25 (0.03 by half-chord)"
    return [
        Row(
            "radius off, equations 1 to 3, median and 90 %, mm",
            "0.6",
            _quantiles(poor, first),
            "sizes, rig by rig",
        ),
        Row(off, "0.6", _quantiles(without, first)),
        Row("radius off, extended, paper mode, mm", beside, _quantiles(poor, extended)),
        Row(off, beside, _quantiles(without, extended)),
        Row("radius off, extended, MAP, mm", "", _quantiles(poor, with_priors)),
        Row("radius off, full, mm", "", _quantiles(poor, full)),
    ]


def _explains(poor: Sequence[Trial], without: Sequence[Trial], phase: float) -> list[Row]:
    """The half-chord, and how often the extension gains."""
    first, extended = MODELS[:2]
    gained = sizes_of(poor, extended, "radius_mm") < sizes_of(poor, first, "radius_mm")
    return [
        Row(
            "half-chord off, equations 1 to 3, phi_0 off by 2.7 rad, mm",
            "0.6",
            _quantiles(without, first, "chord_mm"),
        ),
        Row(
            "phi_0 off by so much makes the paper's 0.6 mm of it, rad",
            "",
            f"{phase:.2f}",
            "by proportion of the medians",
        ),
        Row(
            "half-chord off, extended, paper mode, mm",
            "0.03",
            _quantiles(poor, extended, "chord_mm"),
        ),
        Row(
            "rigs whose radius the extension brings nearer",
            "",
            f"{gained.mean():.0%}",
            f"of {len(poor)}",
        ),
    ]


WORDS = (
    "Rigs drawn about the twin's, lenses distorted, calibrated by the paper's way from a cheap "
    "board (scale 1e-3, each corner 0.02 mm, bow 0.05 to 0.2 mm) and corners with the noise that "
    "the paper reports; in closed form, without images; scanned without noise. No rig is chosen "
    "or left out.\n\n"
    "The paper's gain, 0.6 mm to 0.03 mm, is not what these rigs show. Once phi_0 is calibrated, "
    "with the projector's principal point, the extended model is off by about as much as equations "
    "1 to 3: both are held to boards that the same calibration placed, and what decides the radius "
    "is the board's scale and bow and the camera's own error, which no fit to the same boards can "
    "see. The full model is no better there: its two lenses come from the same corners. It does "
    "better on the planes' form, where the projector's distortion shows.\n\n"
    "A gain of the paper's size comes back where phi_0 is left out, as its K_phi of 2.7 rad, "
    "13.75 px, suggests: then equations 1 to 3 are off by millimetres, and the fit finds the "
    "phase. The half-chord is proportional to what phi_0 is off by; the last rows say how much of "
    "it makes the paper's 0.6 mm.\n\n"
    "The paper's 0.03 mm is of the half-chord, whose ends lie at nearly the same depth: it tells "
    "the scale across the view, and hardly the depth. By that estimator these poor rigs, extended, "
    "are as good; by circles and cylinders they are off by tenths of a millimetre, as the paper's "
    "mean radius is, 52.25 for 52.5 mm."
)


def check_claims(lab: Lab) -> Chapter:
    """The conclusion: a better board, a better camera, better corners."""
    count = QUICK_CLAIM_RIGS if lab.quick else CLAIM_RIGS
    found = {name: run_draws(lab, name, priors, count) for name, priors in CLAIMS.items()}
    millimetres = {
        name: float(np.median([trial["reprojection"]["camera_std_mm"] for trial in trials]))
        for name, trials in found.items()
    }
    rows = [
        Row(
            f"reprojection, {name}, mm",
            {PAPERS: "0.03", SHARPER: "0.015"}.get(name, ""),
            f"{value:.4f}",
        )
        for name, value in millimetres.items()
    ]
    return Chapter(
        heading="The conclusion's three claims: section 6",
        words=(
            "The paper expects more of a better board, of a camera of twice the resolution, and "
            "of better corners. Each is one change of the same draws.\n\n"
            "Twice the resolution brings the reprojection error to about the paper's 0.015 mm, "
            "also because the cut at 0.25 px is then half as wide in mm; the radius gains nothing "
            "by it. What decides that is the board, whose scale and bow no camera and no corner "
            "finder sees: a better one is worth most, and the full model most with it."
        ),
        rows=rows,
        grids=(_grid(f"Sizes of errors over {count} rigs, median / 90 %, mm", found),),
        pictures=(
            Shown("claims_radius", draw_spread(
                {name: {model: sizes_of(trials, model, "radius_mm") for model in
                        (MODELS[1], MODELS[3])} for name, trials in found.items()},
                label="error of the cylinder's radius, mm", marks={"paper: mean": 0.25},
            ), "The radius by the extended model in paper mode and by the full one."),
        ),
        numbers={"reprojection_mm": millimetres, "trials": {k: list(v) for k, v in found.items()}},
    )  # fmt: skip


def run_draws(lab: Lab, name: str, priors: Priors, count: int) -> Sequence[Trial]:
    """Draws as they are kept; those that are missing are drawn, each kept at once."""
    folder = lab.folder / "rigs" / name.replace(" ", "-").replace("'", "")
    return lab.spread(partial(_run, folder, priors), range(count), f"rigs, {name}")


def _run(folder: Path, priors: Priors, seed: int) -> Trial:
    path, wanted = folder / f"{seed:02d}.json", json.loads(json.dumps(asdict(priors)))
    if path.exists():
        kept: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if kept["priors"] == wanted:
            return kept
    drawn = draw_rig(priors, seed)
    errors = {
        name: {
            "radius_mm": one.cylinder_radius_mm,
            "chord_mm": drawn.chord_mm[name],
            "planes_mm": one.planes_rms_mm,
            "form_mm": one.plane_form_mm,
        }
        for name, one in drawn.errors.items()
    }
    reprojection = {
        "camera_std_px": list(drawn.camera_std_px),
        "projector_std_px": list(drawn.projector_std_px),
        "camera_std_mm": drawn.camera_std_mm,
    }
    trial = {"priors": wanted, "errors": errors, "reprojection": reprojection}
    write_text(path, json.dumps(trial, indent=1) + "\n")
    return trial


def sizes_of(trials: Sequence[Trial], model: str, key: str) -> Array:
    """``(rigs,)`` sizes of errors, mm."""
    return np.abs([trial["errors"][model][key] for trial in trials])


def _spread(trials: Sequence[Trial]) -> dict[str, Array]:
    return {model: sizes_of(trials, model, "radius_mm") for model in MODELS}


def _quantiles(trials: Sequence[Trial], model: str, key: str = "radius_mm") -> str:
    middle, most = np.percentile(sizes_of(trials, model, key), (50, 90))
    return f"{middle:.3f}, {most:.3f}"


def _pair(values: Array) -> str:
    return ", ".join(f"{value:.4f}" for value in np.median(values, axis=0))


def _grid(caption: str, groups: Mapping[str, Sequence[Trial]]) -> Grid:
    rows = [
        (
            f"{group}: {model}",
            *(_quantiles(trials, model, key).replace(", ", " / ") for key in SHOWN),
        )
        for group, trials in groups.items()
        for model in MODELS
    ]
    return Grid(caption, ("rigs: model", *SHOWN.values()), rows)
