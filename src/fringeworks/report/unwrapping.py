"""Pictures of spatial unwrapping: relative phase, regions, and residues with their cuts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from fringeworks.kernels.spatial import ABOVE, LEFT
from fringeworks.model import UnwrappedPhase, WrappedPhase
from fringeworks.model.phase import VOID_REGION, OrderMap
from fringeworks.phase.regions import branch_cuts, find_residues
from fringeworks.report.canvas import (
    VOID_COLOUR,
    WIDTH_IN,
    Shade,
    draw_map,
    label_pixels,
    map_figure,
    map_height_in,
    new_figure,
    save_figures,
)

PLUS_COLOUR, MINUS_COLOUR, CUT_COLOUR = "#d55e00", "#0072b2", "#000000"
MOST_DRAWN = 20_000
"""Beyond so many residues or cut links a picture is black, and slow: none are drawn."""


def save_unwrapping(unwrapped: UnwrappedPhase, folder: Path) -> list[Path]:
    """Draw an unwrapped phase into `folder`; returns the paths.

    ``relative_x.png``, ``regions_x.png`` and ``residues_x.png``, or ``_y``.
    """
    return save_figures(draw_unwrapping(unwrapped), folder)


def draw_unwrapping(unwrapped: UnwrappedPhase) -> Iterator[tuple[str, Figure]]:
    """Name and figure of each picture."""
    axis = unwrapped.fringe.axis
    shade = Shade("relative phase, rad: each region has a constant of its own")
    yield f"relative_{axis}", map_figure(unwrapped.phase, shade, _describe(unwrapped))
    yield f"regions_{axis}", _draw_regions(unwrapped)
    yield f"residues_{axis}", _draw_residues(unwrapped.wrapped)


def _describe(unwrapped: UnwrappedPhase) -> str:
    """How the unwrapping went, in words."""
    faults = unwrapped.residues + unwrapped.open_loops
    how = (
        f"{unwrapped.residues} residues, {unwrapped.open_loops} open loops: cheapest links first"
        if faults
        else "every loop closes"
    )
    return f"spatially unwrapped phase, axis {unwrapped.fringe.axis}: {how}"


def _draw_regions(unwrapped: UnwrappedPhase) -> Figure:
    """Regions in colours that tell neighbours apart; large ones carry their number."""
    region = unwrapped.region
    figure = new_figure(map_height_in((region.shape[0], region.shape[1]), share=0.95))
    axes = figure.add_subplot()
    colours = mpl.colormaps["tab20"].with_extremes(bad=VOID_COLOUR)
    shown = np.where(region == VOID_REGION, np.nan, region % colours.N)
    axes.imshow(shown, cmap=colours, vmin=-0.5, vmax=colours.N - 0.5, interpolation="nearest")
    for number, (row, column) in _large(region):
        axes.text(column, row, str(number), ha="center", va="center", fontsize=8)
    label_pixels(axes)
    axes.set_title(f"{unwrapped.region_count} regions, axis {unwrapped.fringe.axis}", loc="left")
    return figure


def _large(region: OrderMap, share: float = 0.005) -> Iterator[tuple[int, tuple[float, float]]]:
    """Number and middle pixel of the regions of at least this share of the image."""
    sizes = np.bincount(region[region != VOID_REGION])
    for number in np.flatnonzero(sizes >= share * region.size):
        rows, columns = np.nonzero(region == number)
        middle = len(rows) // 2  # in the order of memory: a pixel of the middle row
        yield int(number), (float(rows[middle]), float(columns[middle]))


def _draw_residues(wrapped: WrappedPhase) -> Figure:
    """The wrapped phase with the residues of either sign and the branch cuts between them."""
    residues, cuts = find_residues(wrapped), branch_cuts(wrapped)
    count = int(np.count_nonzero(residues))
    height, width = wrapped.phase.shape
    figure = new_figure(WIDTH_IN * 0.85 * height / width + 1.0)
    axes = figure.add_subplot()
    shade = Shade("wrapped phase, rad", "twilight", (-np.pi, np.pi))
    draw_map(axes, wrapped.phase, shade)
    axes.set_title(f"{count} residues and their cuts, axis {wrapped.fringe.axis}", loc="left")
    if not 0 < count <= MOST_DRAWN:
        return figure
    across, along = _cut_lines(cuts)
    axes.plot(across, along, color=CUT_COLOUR, linewidth=0.8)
    for charge, colour, name in ((1, PLUS_COLOUR, "+1 turn"), (-1, MINUS_COLOUR, "-1 turn")):
        rows, columns = np.nonzero(residues == charge)
        axes.plot(columns + 0.5, rows + 0.5, ".", color=colour, markersize=4, label=name)
    handles, _ = axes.get_legend_handles_labels()
    cut = Line2D([], [], color=CUT_COLOUR, linewidth=0.8, label="cut")
    figure.legend(handles=[*handles, cut], loc="outside lower left", ncols=3, frameon=False)
    return figure


def _cut_lines(cuts: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places x, y of the pixels' sides that cuts run along, NaN between them."""
    rows, columns = np.nonzero(cuts & LEFT)
    rows_above, columns_above = np.nonzero(cuts & ABOVE)
    nan = np.full(len(rows), np.nan)
    nan_above = np.full(len(rows_above), np.nan)
    x = np.concatenate(
        [
            np.stack([columns - 0.5, columns - 0.5, nan], axis=1).ravel(),
            np.stack([columns_above - 0.5, columns_above + 0.5, nan_above], axis=1).ravel(),
        ]
    )
    y = np.concatenate(
        [
            np.stack([rows - 0.5, rows + 0.5, nan], axis=1).ravel(),
            np.stack([rows_above - 0.5, rows_above - 0.5, nan_above], axis=1).ravel(),
        ]
    )
    return x, y
