"""Pictures of how well a calibration is known, over the camera's image.

``points_aligned.png`` and ``points.png`` the systematic uncertainty of measured points at three
depths, ``pixels.png`` that of both projections, ``halves.png`` two halves of the views compared.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fringeworks.calibrate.judge.halves import Halves
from fringeworks.calibrate.judge.uncertainty import MIDDLE, PixelSigma, PointSigma
from fringeworks.model import Camera
from fringeworks.report.canvas import Shade, draw_bar, label_pixels, new_figure

Array = NDArray[np.float64]

TOP_PERCENT = 99.0
"""A cell at the image's edge must not decide the colours of all others."""


def draw_points(sigma: PointSigma, depths_mm: Array, camera: Camera) -> Figure:
    """Depth above, lateral below; near, middle and far from left to right."""
    figure = new_figure(5.6, width_in=12.5)
    grid = figure.subplots(2, 3, sharex=True, sharey=True)
    for row, (name, maps) in zip(
        grid, (("depth", sigma.depth_mm), ("lateral", sigma.lateral_mm)), strict=True
    ):
        scaled, unit = _in_unit(maps)
        shade = _shade(scaled, f"{name}, 1 sd, {unit}")
        for axes, values, depth in zip(row, scaled, depths_mm, strict=True):
            _draw_cells(axes, values, (camera, shade))
            axes.set_title(f"{name} at z = {depth:.0f} mm", loc="left")
    _label_outer(grid)
    return figure


def draw_pixels(as_it_stands: PixelSigma, aligned: PixelSigma, camera: Camera) -> Figure:
    """As it stands above, aligned below; camera on the left, projector on the right."""
    figure = new_figure(6.2, width_in=9.5)
    grid = figure.subplots(2, 2, sharex=True, sharey=True)
    for row, (words, sigma) in zip(
        grid, (("as it stands", as_it_stands), ("aligned", aligned)), strict=True
    ):
        for axes, device, maps in zip(
            row, ("camera", "projector"), (sigma.camera_px, sigma.projector_px), strict=True
        ):
            values = maps[MIDDLE]
            _draw_cells(axes, values, (camera, _shade(values, "1 sd, px")))
            axes.set_title(f"{device}, {words}", loc="left")
    _label_outer(grid)
    return figure


def draw_halves(halves: Halves, camera: Camera) -> Figure:
    """Found on the left, predicted on the right, in the same colours; at the middle depth."""
    figure = new_figure(3.4, width_in=9.5)
    grid = figure.subplots(1, 2, sharex=True, sharey=True, squeeze=False)
    pair, unit = _in_unit(np.stack([halves.difference_mm[MIDDLE], halves.predicted_mm[MIDDLE]]))
    shade = _shade(pair, f"distance, {unit}")
    for axes, values, words in zip(
        grid[0], pair, ("two halves differ by", "their covariances predict"), strict=True
    ):
        _draw_cells(axes, values, (camera, shade))
        axes.set_title(words, loc="left")
    _label_outer(grid)
    return figure


def _in_unit(maps_mm: Array) -> tuple[Array, str]:
    """Lengths in µm, or in mm where most are above one."""
    known = maps_mm[np.isfinite(maps_mm)]
    if known.size and np.median(known) >= 1.0:
        return maps_mm, "mm"
    return 1e3 * maps_mm, "µm"


def _shade(values: Array, label: str) -> Shade:
    """From zero, so that colours can be compared in size."""
    known = values[np.isfinite(values)]
    top = float(np.percentile(known, TOP_PERCENT)) if known.size else 0.0
    return Shade(label, "viridis", (0.0, top or 1.0))


def _draw_cells(axes: Axes, values: Array, how: tuple[Camera, Shade]) -> None:
    """Cells ``(rows, columns)`` that fill the camera's image; NaN is light grey."""
    camera, shade = how
    low, high = shade.limits_of(values)
    image = axes.imshow(
        values,
        cmap=shade.colormap,
        vmin=low,
        vmax=high,
        interpolation="nearest",
        extent=(-0.5, camera.width - 0.5, camera.height - 0.5, -0.5),
    )
    beyond = bool(np.any(values[np.isfinite(values)] > high))
    draw_bar(axes, image, shade, extend="max" if beyond else "neither")
    label_pixels(axes)


def _label_outer(grid: NDArray[Any]) -> None:
    for axes in grid.flat:
        axes.label_outer()
