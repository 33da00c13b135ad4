"""A cloud as a solid thing: shaded, seen from the front and from two sides.

Orthographic painter's algorithm on numpy arrays: a few hundred thousand points take a moment,
where a scatter plot of them takes minutes.
"""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from fringeworks.geometry.grid import grid_normals, smoothing_window
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Cloud
from fringeworks.report.canvas import Shade, draw_bar, new_figure

RASTER_PX = 420
"""Longer side of a view, raster pixels."""

MARGIN_PX = 6
"""White around it."""

SPAN_PERCENT = (0.5, 99.5)
SPAN_MARGIN = 0.08
"""What is drawn: the span of nearly all points, and this share of it more on every side."""

LIGHT = np.array([-0.45, -0.55, -0.70])
"""Direction to the lamp in the camera's frame: above the camera, to its left."""

FIGURE_IN = 12.0
AMBIENT = 0.35

SIDES: tuple[tuple[str, tuple[float, float, float]], ...] = (
    ("from the camera", (0.0, 0.0, 0.0)),
    ("turned by 40°", (0.0, 40.0, 0.0)),
    ("tipped by 40°", (-40.0, 0.0, 0.0)),
)
"""What the sides are called, and the rotation vector of each, degrees."""


@dataclass(frozen=True, slots=True)
class _Solid:
    """Points ``(n, 3)`` about their middle, mm, with an RGB colour ``(n, 3)`` each."""

    points: NDArray[np.float64]
    colours: NDArray[np.float64]


def draw_solid(cloud: Cloud, shade: Shade) -> Figure:
    """The cloud from three sides, coloured by depth and lit from above."""
    low, high = shade.limits_of(cloud.xyz[..., 2])
    solid = _solid_of(cloud, shade, (low, high))
    pictures = [_paint(solid, rotation_matrix(np.deg2rad(np.array(turn)))) for _, turn in SIDES]
    widths = [picture.width for picture in pictures]
    tallest = max(picture.height for picture in pictures)
    height_in = np.clip(FIGURE_IN * tallest / sum(widths), 2.0, 9.0) + 0.6
    figure = new_figure(float(height_in), width_in=FIGURE_IN)
    panels = figure.subplots(1, len(SIDES), width_ratios=widths)
    for axes, (name, _), picture in zip(panels, SIDES, pictures, strict=True):
        _show(axes, picture, tallest)
        axes.set_title(name, loc="left")
    panels[0].set_ylabel("mm")
    draw_bar(panels[-1], ScalarMappable(Normalize(low, high), shade.colormap), shade)
    return figure


def _solid_of(cloud: Cloud, shade: Shade, limits: tuple[float, float]) -> _Solid:
    use = within_span(cloud.xyz)
    points = cloud.xyz[use].astype(np.float64)
    depth = np.clip((points[:, 2] - limits[0]) / (limits[1] - limits[0]), 0, 1)
    colours = mpl.colormaps[shade.colours](depth)[:, :3]
    lit = shade_relief(cloud)[use]
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return _Solid(points - middle, colours * lit[:, None])


def within_span(xyz: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Valid points inside the box that holds nearly all of them."""
    valid = np.isfinite(xyz[..., 2])
    low, high = np.percentile(xyz[valid], SPAN_PERCENT, axis=0)
    margin = SPAN_MARGIN * (high - low).max()
    with np.errstate(invalid="ignore"):
        inside = (xyz >= low - margin) & (xyz <= high + margin)
    return np.asarray(valid & inside.all(axis=-1))


def shade_relief(cloud: Cloud) -> NDArray[np.float64]:
    """Lambert's brightness ``(H, W)``, 0 to 1, of the surface smoothed as its noise demands."""
    normals = grid_normals(_smooth(cloud))
    with np.errstate(invalid="ignore"):
        facing = np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
    return np.asarray(AMBIENT + (1 - AMBIENT) * np.nan_to_num(facing, nan=0.5), dtype=np.float64)


def _smooth(cloud: Cloud) -> NDArray[np.float32]:
    """Moving average of the points over a window that leaves slopes of a few percent of noise."""
    size = smoothing_window(cloud.xyz, cloud.sigma_mm)
    valid = cloud.valid
    weight = uniform_filter(valid.astype(np.float32), size)
    filled = np.where(valid[..., None], cloud.xyz, np.float32(0))
    mean = uniform_filter(filled, (size, size, 1)) / np.maximum(weight, 1e-6)[..., None]
    return np.where(valid[..., None], mean, np.float32(np.nan)).astype(np.float32)


@dataclass(frozen=True, slots=True)
class _Picture:
    """RGB raster with its upper left corner and its pixel's size, mm."""

    rgb: NDArray[np.float32]
    corner: NDArray[np.float64]
    step: float

    @property
    def height(self) -> float:
        return self.step * float(self.rgb.shape[0])

    @property
    def width(self) -> float:
        return self.step * float(self.rgb.shape[1])


def _paint(solid: _Solid, rotation: NDArray[np.float64]) -> _Picture:
    """Far points first, each on two by two raster pixels."""
    turned = solid.points @ rotation.T
    low, high = turned[:, :2].min(axis=0), turned[:, :2].max(axis=0)
    step = max(float((high - low).max()), 1e-6) / RASTER_PX
    low -= MARGIN_PX * step
    column, row = np.floor((turned[:, :2] - low) / step).astype(int).T
    rgb = np.ones((row.max() + 2 + MARGIN_PX, column.max() + 2 + MARGIN_PX, 3), np.float32)
    far_first = np.argsort(-turned[:, 2], kind="stable")
    row, column, colours = row[far_first], column[far_first], solid.colours[far_first]
    for down, right in ((1, 1), (1, 0), (0, 1), (0, 0)):
        rgb[row + down, column + right] = colours
    return _Picture(rgb, low, step)


def _show(axes: Axes, picture: _Picture, tallest: float) -> None:
    """All pictures at one scale: the same height of mm in each panel."""
    left, top = picture.corner
    extent = (left, left + picture.width, top + picture.height, top)
    axes.imshow(picture.rgb, extent=extent, interpolation_stage="rgba")
    middle = top + picture.height / 2
    axes.set_ylim(middle + tallest / 2, middle - tallest / 2)
    axes.set_xlabel("mm")
    axes.tick_params(labelsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
