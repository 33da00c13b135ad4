"""The study of fringe orders as a picture: a column per condition, a line per method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fringeworks.experiments.order_trials import Condition, Told
from fringeworks.report.canvas import new_figure

LEAST_SHARE = 1e-5
"""Less than one pixel of the image: nothing at all is drawn there."""

STYLES = ("-", "--", ":")

Results = Mapping[str, Sequence[Mapping[str, Told]]]
"""Condition -> one table of method -> result per level."""


def draw_orders(results: Results, conditions: Sequence[Condition], names: Sequence[str]) -> Figure:
    """Above the share of wrong orders, below that of pixels left without one; log axes."""
    figure = new_figure(6.4, width_in=2.3 * len(conditions) + 2.2)
    rows = figure.subplots(2, len(conditions), sharex="col", sharey="row", squeeze=False)
    for place, condition in enumerate(conditions):
        levels = results[condition.name]
        for number, name in enumerate(names):
            told = [(x, table[name]) for x, table in _pairs(condition, levels) if name in table]
            if told:
                _draw_line(rows[0, place], [(x, one.wrong_share) for x, one in told], number)
                _draw_line(rows[1, place], [(x, 1 - one.coverage) for x, one in told], number)
        rows[0, place].set_title(condition.name, loc="left")
        rows[1, place].set_xlabel(condition.unit)
    for axes in rows.flat:
        _finish(axes)
    rows[0, 0].set_ylabel("wrong, share of certain pixels")
    rows[1, 0].set_ylabel("not certain, share of pixels")
    for number, name in enumerate(names):
        rows[0, 0].plot([], [], **_look(number), label=name)
    figure.legend(
        *rows[0, 0].get_legend_handles_labels(), loc="outside right center", frameon=False
    )
    return figure


def _pairs(
    condition: Condition, levels: Sequence[Mapping[str, Told]]
) -> list[tuple[float, Mapping[str, Told]]]:
    return list(zip(condition.levels, levels, strict=False))  # a quick run has the first and last


def _draw_line(axes: Axes, points: Sequence[tuple[float, float]], number: int) -> None:
    x, share = np.array(points).T
    axes.plot(x, np.maximum(share, LEAST_SHARE), **_look(number))


def _look(number: int) -> dict[str, Any]:
    colours = mpl.color_sequences["tab10"]
    style = STYLES[number // len(colours) % len(STYLES)]
    return {
        "color": colours[number % len(colours)],
        "linestyle": style,
        "marker": "osD^v<>PX*"[number % 10],
        "markerfacecolor": colours[number % len(colours)] if style == "-" else "white",
        "markersize": 4,
        "linewidth": 1.4,
    }


def _finish(axes: Axes) -> None:
    axes.set_yscale("log")
    axes.set_ylim(0.7 * LEAST_SHARE, 1.5)
    ticks = {LEAST_SHARE: "none", **{10.0**power: f"{10.0**power:.4g}" for power in range(-4, 1)}}
    axes.set_yticks(list(ticks), labels=list(ticks.values()))
    axes.minorticks_off()
    axes.grid(axis="y", color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
