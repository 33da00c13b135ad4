"""The study of models as a picture: what each is off by, rig by rig."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from fringeworks.experiments.extended import ModelScore
from fringeworks.report.canvas import CAMERA_COLOUR, PROJECTOR_COLOUR, new_figure

QUANTITIES = (
    ("planes_systematic_mm", "planes, systematic", CAMERA_COLOUR, "o"),
    ("planes_form_mm", "planes, form", PROJECTOR_COLOUR, "s"),
    ("radius_error_mm", "cylinder radius", "0.2", "x"),
)
MICRO = 1e3
LEAST_UM = 0.5
"""A radius may be right by chance; the axis is logarithmic."""

LARGEST_UM = 1e4


def draw_models(medians: Mapping[str, Mapping[str, ModelScore]]) -> Figure:
    """A panel for each rig, a line for each model, a mark for each quantity."""
    figure = new_figure(3.8, width_in=11.0)
    panels = figure.subplots(1, len(medians), sharey=True, sharex=True)
    for axes, (rig, scores) in zip(panels, medians.items(), strict=True):
        rows = np.arange(len(scores))[::-1]
        axes.hlines(rows, LEAST_UM / 1.3, LARGEST_UM, color="0.92", linewidth=0.8, zorder=0)
        for key, name, colour, mark in QUANTITIES:
            sizes = [MICRO * abs(getattr(score, key)) for score in scores.values()]
            axes.scatter(
                np.maximum(sizes, LEAST_UM), rows, s=28, color=colour, marker=mark, label=name
            )
        axes.set_xscale("log")
        axes.set_xlim(LEAST_UM / 1.3, LARGEST_UM)
        axes.set_yticks(rows, labels=list(scores))
        axes.set_xlabel("error, µm")
        axes.set_title(rig, loc="left")
        for side in ("top", "right", "left"):
            axes.spines[side].set_visible(False)
    marks, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(marks, names, ncols=len(names), frameon=False, loc="outside upper right")
    return figure
