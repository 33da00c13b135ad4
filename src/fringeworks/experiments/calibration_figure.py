"""The study of calibrations as a picture: every trial a dot, ours beside the plain chain's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fringeworks.experiments.calibration_table import (
    GROUPS,
    Quantity,
    Results,
    cylinder,
    radius,
    values,
    wall,
)
from fringeworks.experiments.trials import Outcome
from fringeworks.report.canvas import CAMERA_COLOUR, PROJECTOR_COLOUR, new_figure

OURS, PLAIN = CAMERA_COLOUR, PROJECTOR_COLOUR
SIDE, SPREAD = 0.18, 0.09
"""How far ours and plain stand from the middle of their place, and how wide a strip is."""

MICRO = 1e3
LEAST_UM = 0.1
"""A radius may be right by chance; the axis is logarithmic."""

BARS_UM: tuple[tuple[str, Quantity, float], ...] = (
    ("wall, p95", wall, 12.0),
    ("cylinder, p95", cylinder, 3.0),
    ("radius", radius, 4.0),
)


def draw_trials(results: Results) -> Figure:
    """Left the flat board's trials by what is measured, right the wall by what is wrong."""
    figure = new_figure(4.4, width_in=11.0)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 5))
    _draw_flat(left, results)
    _draw_kinds(right, results)
    for axes in (left, right):
        axes.set_yscale("log")
        axes.grid(axis="y", color="0.9", linewidth=0.8)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    left.set_ylabel("error, µm")
    left.legend(frameon=False, loc="lower left", fontsize="small")
    return figure


def _draw_flat(axes: Axes, results: Results) -> None:
    for place, (_, quantity, bar) in enumerate(BARS_UM):
        _strip(axes, place - SIDE, (results.ours("flat"), quantity), OURS)
        _strip(axes, place + SIDE, (results.plain("flat"), quantity), PLAIN)
        reach = (place - 0.4, place + 0.4)
        true = max(MICRO * quantity(results.true), LEAST_UM)
        axes.hlines(true, *reach, color="0.2", linewidth=1.4, zorder=0)
        axes.hlines(bar, *reach, color="0.2", linewidth=1.0, linestyles="dotted")
    axes.set_xticks(range(len(BARS_UM)), labels=[name for name, _, _ in BARS_UM])
    axes.set_title(f"{len(results.of('flat'))} calibrations", loc="left")
    for colour, label in ((OURS, "ours"), (PLAIN, "plain OpenCV")):
        axes.scatter([], [], s=16, color=colour, label=label)
    axes.plot([], [], color="0.2", linewidth=1.4, label="true rig")
    axes.plot([], [], color="0.2", linewidth=1.0, linestyle="dotted", label="bar")


def _draw_kinds(axes: Axes, results: Results) -> None:
    for place, (_, kind, shape) in enumerate(GROUPS):
        _strip(axes, place - SIDE, (results.ours(kind, shape), wall), OURS)
        _strip(axes, place + SIDE, (results.plain(kind), wall), PLAIN)
    names = [name.replace(", ", ",\n").replace(" the ", "\nthe ") for name, _, _ in GROUPS]
    axes.set_xticks(range(len(GROUPS)), labels=names)
    axes.set_title("wall, p95, by what is wrong", loc="left")


def _strip(
    axes: Axes, place: float, found: tuple[Sequence[Outcome], Quantity], colour: str
) -> None:
    """One dot per trial, side by side in the order of the seeds, and a line at their median."""
    heights = np.maximum(MICRO * values(*found), LEAST_UM)
    across = place + SPREAD * (2 * np.arange(len(heights)) + 1 - len(heights)) / len(heights)
    axes.scatter(across, heights, s=13, color=colour, alpha=0.8, linewidths=0)
    axes.hlines(np.median(heights), place - 1.4 * SPREAD, place + 1.4 * SPREAD, color=colour)
