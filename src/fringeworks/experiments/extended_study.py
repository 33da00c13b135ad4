"""The study of drawn rigs as a table: ``fringeworks bench extended``; see `extended_rigs`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fringeworks.experiments.extended import HEAD as TWIN_HEAD
from fringeworks.experiments.extended import ModelScore, compare_on_twin, tabulate_scores
from fringeworks.experiments.extended_rigs import KINDS, MODELS, VIEWS_MM, run_rig
from fringeworks.experiments.ray_forms import FormErrors
from fringeworks.experiments.study import Study
from fringeworks.model import Progress, no_progress
from fringeworks.report.canvas import new_figure

Array = NDArray[np.float64]
Trials: TypeAlias = Mapping[str, Sequence[Mapping[str, FormErrors]]]
"""By kind, rig by rig, by model."""

RIGS, QUICK_RIGS = 100, 3
PANELS_ACROSS = 4
NO_WORSE, WANTED = 1.02, 0.95
QUANTITIES = {
    "planes_rms_mm": "planes rms",
    "plane_form_mm": "plane form",
    "cylinder_radius_mm": "cylinder radius",
    "ball_radius_mm": "sphere radius",
    "ball_distance_mm": "ball distance",
}
BARRED = ("planes_rms_mm", "cylinder_radius_mm", "ball_radius_mm", "ball_distance_mm")
"""What `WANTED` is asked of; the form of single planes has no part that a fit could take away."""

HEAD = (
    "rigs, quantity",
    "geometric µm",
    "paper µm",
    "MAP µm",
    "MAP ppm of view",
    "ratio 50 %",
    "ratio 90 %",
    "ratio 95 %",
    "MAP no worse",
    "paper no worse",
)
NOTES = (
    "Medians of the error's size over all rigs; ratio: MAP over geometric, rig by rig, at so many "
    "percent of the rigs; no worse: share of rigs with a ratio of at most 1.02; ppm of view: of "
    "the width that the camera sees where the forms are.",
    "Boards and forms are about 660 mm away; at 364 and 2169 mm, the ends of the paper's range, "
    "all their lengths are in proportion, before rigs that stay as they are.",
    "Planes rms is of all held-out planes together after one rigid motion, plane form about each "
    "one's own fit, where little is left that a projector's pose or focal length can do.",
    "A drawn rig's geometric error may be small by chance, its signed ones (radii, distance) near "
    "zero: the ratio is then large though both errors are small.",
)


def study_extended(
    folder: Path, *, seeds: int | None = None, quick: bool = False, progress: Progress = no_progress
) -> Study:
    """Draw rigs of all kinds and compare the models; then the twin, whose captures are kept.

    A drawn rig takes half a second, and none is kept. Quick, the twin is left out.
    """
    count = QUICK_RIGS if quick else seeds or RIGS
    trials = {
        kind.name: [run_rig(kind, seed) for seed in progress(range(count), f"rigs, {kind.name}")]
        for kind in KINDS
    }
    twin = {} if quick else compare_on_twin(folder / "twin", progress=progress)
    return Study(
        title=f"Extended beside geometric on {count} drawn rigs of each kind",
        head=HEAD,
        rows=tuple(_row(trials, kind, key) for kind in trials for key in QUANTITIES),
        notes=(*NOTES, _bar_note(trials), *_twin_notes(twin)),
        numbers={
            "trials": {
                kind: [{name: asdict(trial[name]) for name in MODELS} for trial in items]
                for kind, items in trials.items()
            },
            "twin": {name: asdict(score) for name, score in twin.items()},
        },
        draw=partial(draw_ratios, trials),
    )


def ratios_of(trials: Sequence[Mapping[str, FormErrors]], key: str, model: str = "map") -> Array:
    """``(rigs,)`` size of a model's error over the geometric model's."""
    return sizes_of(trials, key, model) / sizes_of(trials, key, "geometric")


def sizes_of(trials: Sequence[Mapping[str, FormErrors]], key: str, model: str) -> Array:
    """``(rigs,)`` absolute errors, mm."""
    return np.abs([getattr(trial[model], key) for trial in trials])


def _row(trials: Trials, kind: str, key: str) -> tuple[str, ...]:
    rigs = trials[kind]
    medians = [1e3 * float(np.median(sizes_of(rigs, key, model))) for model in MODELS]
    ratios = ratios_of(rigs, key)
    shares = (ratios <= NO_WORSE, ratios_of(rigs, key, "paper") <= NO_WORSE)
    return (
        f"{kind}, {QUANTITIES[key]}",
        *(f"{value:.1f}" for value in medians),
        f"{1e3 * medians[-1] / VIEWS_MM[kind]:.0f}",
        *(f"{value:.2f}" for value in np.percentile(ratios, (50, 90, 95))),
        *(f"{np.mean(share):.0%}" for share in shares),
    )


def _bar_note(trials: Trials) -> str:
    """What stays below the share that is wanted."""
    shares = {
        f"{kind}, {QUANTITIES[key]}": float(np.mean(ratios_of(rigs, key) <= NO_WORSE))
        for kind, rigs in trials.items()
        for key in BARRED
    }
    below = [f"{name} {share:.0%}" for name, share in shares.items() if share < WANTED]
    return (
        f"MAP no worse in less than {WANTED:.0%} of the rigs, plane form apart: "
        f"{'; '.join(below) or 'none'}"
    )


def _twin_notes(scores: Mapping[str, ModelScore]) -> list[str]:
    """A sentence per model."""
    return [
        "The twin's rig, {}: {}".format(
            name,
            ", ".join(f"{what} {value}" for what, value in zip(TWIN_HEAD[1:], values, strict=True)),
        )
        for name, *values in tabulate_scores(scores)
    ]


def draw_ratios(trials: Trials) -> Figure:
    """Every rig a step: MAP over geometric, sorted, one panel per kind."""
    figure = new_figure(6.2, width_in=12.0)
    *panels, last = figure.subplots(2, PANELS_ACROSS, sharey=True).ravel()
    for axes, (kind, rigs) in zip(panels, trials.items(), strict=True):
        _draw_kind(axes, rigs)
        axes.set_title(kind, loc="left", fontsize="medium")
    for axes in panels[::PANELS_ACROSS]:
        axes.set_ylabel("share of rigs")
    for axes in panels[-PANELS_ACROSS:]:
        axes.set_xlabel("error of MAP / error of geometric")
    last.axis("off")
    last.legend(*panels[0].get_legend_handles_labels(), frameon=False, loc="center left")
    return figure


def _draw_kind(axes: Axes, rigs: Sequence[Mapping[str, FormErrors]]) -> None:
    shares = (np.arange(len(rigs)) + 1) / len(rigs)
    for key, name in QUANTITIES.items():
        axes.step(np.sort(ratios_of(rigs, key)), shares, label=name, linewidth=1.4)
    axes.axvline(NO_WORSE, color="0.3", linewidth=1.0, linestyle="dotted")
    axes.axhline(WANTED, color="0.3", linewidth=1.0, linestyle="dotted")
    axes.set_xscale("log")
    axes.set_xlim(1e-3, 1e1)
