"""What all pictures share: how a map is drawn, how colours are ranged, how a file is written."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.text import Text
from numpy.typing import NDArray

from fringeworks.files.atomic import replacing

DPI = 110
WIDTH_IN = 8.5
CAMERA_COLOUR, PROJECTOR_COLOUR = "#0072b2", "#d55e00"
VOID_COLOUR = "0.9"
"""Void pixels are light grey: none of the colour maps used here comes near it."""

ROBUST_PERCENT = (1.0, 99.0)
"""A handful of wild pixels must not decide the colours of all others."""

CYCLIC_DARKENED = 0.82
"""Twilight, the cyclic map, turns as light as a void pixel where the phase wraps."""

Image = NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class Shade:
    """How values become colours.

    Attributes
    ----------
    label
        Text at the colour bar, with the unit.
    colours
        Name of a perceptually uniform map; of a cyclic one for angles.
    limits
        Values at both ends; None takes the 1 and 99 percentiles.
    ticks
        Values to mark with their names; None chooses round ones.
    void
        Colour of NaN.
    """

    label: str
    colours: str = "viridis"
    limits: tuple[float, float] | None = None
    ticks: Mapping[float, str] | None = None
    void: str = VOID_COLOUR

    @property
    def colormap(self) -> Colormap:
        colours = mpl.colormaps[self.colours]
        if self.colours == "twilight":
            wheel = colours(np.linspace(0, 1, 256))[:, :3]
            colours = ListedColormap(wheel * CYCLIC_DARKENED)
        return colours.with_extremes(bad=self.void)

    def limits_of(self, values: Image) -> tuple[float, float]:
        """The range of the colour bar."""
        return self.limits or robust_limits(values)


def signed_shade(label: str, reach: float) -> Shade:
    """Red above 0, blue below, the same to both sides; 0 is white, so void is a darker grey."""
    return Shade(label, "RdBu_r", (-reach, reach), void="0.72")


def robust_limits(values: Image) -> tuple[float, float]:
    """The 1 and 99 percentiles of the finite values, kept apart; (0, 1) if there are none."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = (float(level) for level in np.percentile(finite, ROBUST_PERCENT))
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def view_colours(count: int) -> list[Any]:
    """One colour per view, told apart and in order."""
    return [mpl.colormaps["viridis"](share) for share in np.linspace(0.0, 0.92, count)]


def new_figure(height_in: float, *, width_in: float = WIDTH_IN) -> Figure:
    """An empty figure whose parts make room for each other's labels."""
    return Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")


def map_height_in(shape: tuple[int, int], *, share: float = 0.85) -> float:
    """Height of a figure whose image of `shape` takes this share of the width."""
    rows, columns = shape
    return float(np.clip(WIDTH_IN * share * rows / columns + 0.7, 2.5, 11.0))


def draw_map(axes: Axes, values: Image, shade: Shade) -> AxesImage:
    """A map ``(H, W)`` on the camera's pixel grid with its colour bar; NaN is light grey.

    Colours are averaged where the picture has fewer pixels than the map, not values: across a
    wrap or an edge the mean of two values would be a third that occurs nowhere.
    """
    low, high = shade.limits_of(values)
    image = axes.imshow(
        values,
        cmap=shade.colormap,
        vmin=low,
        vmax=high,
        interpolation_stage="rgba",
    )
    draw_bar(axes, image, shade, extend=_beyond(values, (low, high)))
    label_pixels(axes)
    return image


def _beyond(values: Image, limits: tuple[float, float]) -> str:
    """At which ends of the colour bar values were cut off, as matplotlib's `extend`."""
    finite = values[np.isfinite(values)]
    below = bool(finite.size and finite.min() < limits[0])
    above = bool(finite.size and finite.max() > limits[1])
    if below and above:
        return "both"
    return "min" if below else "max" if above else "neither"


def draw_bar(axes: Axes, image: ScalarMappable, shade: Shade, *, extend: str = "neither") -> None:
    """A colour bar of the picture's own height."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    beside = axes.inset_axes((1.02, 0.0, 0.028, 1.0))
    bar = figure.colorbar(image, cax=beside, label=shade.label, extend=extend, extendfrac=0.03)
    if shade.ticks is not None:
        bar.set_ticks(list(shade.ticks), labels=list(shade.ticks.values()))


def label_pixels(axes: Axes) -> None:
    """Name both axes of an image in the camera's pixels."""
    axes.set_xlabel("camera x, px")
    axes.set_ylabel("camera y, px")
    axes.tick_params(direction="out", length=3)


def map_figure(values: Image, shade: Shade, title: str) -> Figure:
    """One map on a figure of its own."""
    height, width = values.shape[:2]
    figure = new_figure(map_height_in((height, width)))
    axes = figure.add_subplot()
    draw_map(axes, values, shade)
    axes.set_title(title, loc="left")
    return figure


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a PNG, whole or not at all; returns its path."""
    with replacing(path) as temporary:
        save_png(figure, temporary)
    return path


def save_png(figure: Figure, target: Path | BinaryIO) -> None:
    """The figure as PNG, cut to what is drawn.

    Names of files and positions stand in it as they are: a dollar begins no formula, and a letter
    that the font lacks is a box and no warning. Ticks of logarithms are formulas all the same.
    """
    for text in figure.findobj(Text):
        if text.get_text() and not text.get_text().startswith(r"$\mathdefault"):
            text.set_parse_math(False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        figure.savefig(target, format="png", bbox_inches="tight", pad_inches=0.12)


def save_figures(named: Iterable[tuple[str, Figure]], folder: Path) -> list[Path]:
    """Write every figure as ``NAME.png`` into `folder`; returns their paths."""
    return [save_figure(figure, folder / f"{name}.png") for name, figure in named]
