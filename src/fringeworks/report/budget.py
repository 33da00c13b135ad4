"""The error budget as a picture and in plain values."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fringeworks.report.canvas import new_figure, save_figure
from fringeworks.uncertainty.budget import KINDS, Budget
from fringeworks.uncertainty.contributions import Kind

Array = NDArray[np.float64]

COLOURS: Mapping[Kind, str] = {"model": "#009e73", "parameters": "#0072b2", "phase": "#d55e00"}
LEAST_NAMED_PERCENT = 8.0
LEAST_SHOWN = 1e-3
"""Bars start at this share of the longest one."""


def save_budget(budget: Budget, path: Path, *, sampled: Mapping[Kind, Array] | None = None) -> Path:
    """Write the picture; `sampled` are Monte Carlo values ``(3,)`` at near, middle and far."""
    return save_figure(draw_budget(budget, sampled=sampled or {}), path)


def draw_budget(budget: Budget, *, sampled: Mapping[Kind, Array]) -> Figure:
    """Classes over depth, their shares of the variance, and every source at the middle depth."""
    figure = new_figure(5.0, width_in=14.5)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.2, 0.8, 1.0))
    _draw_over_depth(left, budget, sampled)
    _draw_shares(middle, budget)
    _draw_sources(right, budget)
    return figure


def ends_and_middle(count: int) -> list[int]:
    """Places of near, middle and far among so many depths."""
    return [0, count // 2, count - 1]


def _draw_over_depth(axes: Axes, budget: Budget, sampled: Mapping[Kind, Array]) -> None:
    depths, places = budget.depths_mm, ends_and_middle(len(budget.depths_mm))
    axes.plot(depths, budget.total_mm, color="0.15", linewidth=2, label="all together")
    for kind in KINDS:
        if budget.of_kind(kind).any():
            axes.plot(depths, budget.of_kind(kind), color=COLOURS[kind], label=kind)
        if kind in sampled and any(sampled[kind]):
            style: dict[str, Any] = {"color": COLOURS[kind], "linestyle": "none", "marker": "o"}
            axes.plot(depths[places], sampled[kind], **style, label=f"{kind}, Monte Carlo")
    if budget.aligned_mm is not None:
        aligned = "parameters, aligned: of the form alone"
        axes.plot(depths, budget.aligned_mm, "--", color=COLOURS["parameters"], label=aligned)
    axes.set_ylim(0, 1.08 * float(budget.total_mm.max()))
    axes.set_ylabel("standard deviation of z, mm")
    axes.set_title("by class", loc="left")
    _label_depth(axes, depths)
    axes.legend(
        frameon=False, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2
    )


def _draw_shares(axes: Axes, budget: Budget) -> None:
    variance = budget.total_mm**2
    shares = [100 * budget.of_kind(kind) ** 2 / variance for kind in KINDS]
    colours = [COLOURS[kind] for kind in KINDS]
    axes.stackplot(budget.depths_mm, shares, colors=colours, alpha=0.75)
    middle = ends_and_middle(len(variance))[1]
    below = 0.0
    for kind, share in zip(KINDS, shares, strict=True):
        if share[middle] > LEAST_NAMED_PERCENT:
            place = (budget.depths_mm[middle], below + share[middle] / 2)
            axes.annotate(kind, place, ha="center", va="center", color="white")
        below += share[middle]
    axes.set_ylim(0, 100)
    axes.set_ylabel("share of the variance, %")
    axes.set_title("shares", loc="left")
    _label_depth(axes, budget.depths_mm)


def _label_depth(axes: Axes, depths: Array) -> None:
    axes.set_xlim(depths[0], depths[-1])
    axes.set_xlabel("depth z, mm")


def _draw_sources(axes: Axes, budget: Budget) -> None:
    middle = ends_and_middle(len(budget.depths_mm))[1]
    shown = [one for one in budget.sources if one.sigma_mm[middle] > 0]
    values = [float(one.sigma_mm[middle]) for one in shown]
    names = [one.name if one.counts else f"({one.name})" for one in shown]
    colours = [COLOURS[one.kind] for one in shown]
    alphas = [0.9 if one.counts else 0.35 for one in shown]
    if budget.parameters_mm is not None:
        place = max(i for i, one in enumerate(shown) if one.kind == "parameters") + 1
        values.insert(place, float(budget.parameters_mm[middle]))
        names.insert(place, "all parameters together")
        colours.insert(place, "#00436b")
        alphas.insert(place, 0.9)
    bars = axes.barh(np.arange(len(values)), values, color=colours)
    for bar, alpha in zip(bars, alphas, strict=True):
        bar.set_alpha(alpha)
    axes.set_yticks(np.arange(len(values)), labels=names)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlim(LEAST_SHOWN * max(values) / 3, 2 * max(values))
    axes.set_xlabel("standard deviation of z, mm, of each source alone")
    axes.set_title(f"at z = {budget.depths_mm[middle]:.0f} mm", loc="left")


def summarise_budget(budget: Budget) -> dict[str, Any]:
    """Plain values over depth, mm unless their names say otherwise."""
    return {
        "depths_mm": budget.depths_mm.tolist(),
        "sources": [
            {
                "kind": one.kind,
                "name": one.name,
                "counts": one.counts,
                "sigma_mm": one.sigma_mm.tolist(),
            }
            for one in budget.sources
        ],
        "classes_mm": {kind: budget.of_kind(kind).tolist() for kind in KINDS},
        "parameters_aligned_mm": _plain(budget.aligned_mm),
        "scale_mm": _plain(budget.scale_mm),
        "total_mm": budget.total_mm.tolist(),
        "lit_share": budget.lit_share.tolist(),
        "camera_px_mm": budget.camera_px_mm.tolist(),
        "fringe_mm": budget.fringe_mm.tolist(),
    }


def _plain(values: Array | None) -> list[float] | None:
    return None if values is None else values.tolist()
