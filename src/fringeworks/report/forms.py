"""Pictures of forms: where points lie off a fitted one, and which forms a cloud was split into."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from fringeworks.geometry.forms import ConeFit, CylinderFit, PlaneFit, SphereFit
from fringeworks.geometry.forms.named import FormFit, name_of
from fringeworks.measure.found import FoundForms
from fringeworks.measure.region import Region, chosen_pixels
from fringeworks.model import Cloud
from fringeworks.report.canvas import (
    CAMERA_COLOUR,
    PROJECTOR_COLOUR,
    WIDTH_IN,
    Shade,
    draw_map,
    label_pixels,
    map_height_in,
    new_figure,
    save_figure,
    signed_shade,
)

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FORM_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442")
OTHER_GREY = 0.62
MARGIN_PX = 6
MOST_DOTS = 30_000
BINS = 80


def save_form(cloud: Cloud, region: Region, fit: FormFit, folder: Path) -> list[Path]:
    """Draw the deviations of a region's points from the form fitted to them: ``plane.png``..."""
    figure = draw_form(cloud, region, fit)
    return [save_figure(figure, folder / f"{name_of(fit)}.png")]


def save_found(cloud: Cloud, region: Region, found: FoundForms, folder: Path) -> list[Path]:
    """Draw which points of a region belong to which form: ``forms.png``."""
    return [save_figure(draw_found(cloud, region, found), folder / "forms.png")]


def draw_form(cloud: Cloud, region: Region, fit: FormFit) -> Figure:
    """A map of signed distances, and how often each occurs."""
    chosen = chosen_pixels(cloud, region)
    values = np.full(chosen.shape, np.nan)
    values[chosen] = fit.deviations_mm
    window = _window(chosen)
    wide = _organised(cloud)
    size = (window[0].stop - window[0].start, window[1].stop - window[1].start)
    figure = new_figure(map_height_in(size, share=0.55) if wide else 4.5, width_in=1.35 * WIDTH_IN)
    left, right = figure.subplots(1, 2, width_ratios=(1.6, 1.0))
    reach = max(float(np.quantile(np.abs(fit.deviations_mm), 0.99)), 1e-6)
    shade = signed_shade(_off_label(fit), reach)
    if wide:
        _draw_window(left, values, window, shade)
    else:
        _draw_dots(left, cloud.points(), values[cloud.valid], shade)
    left.set_title(describe_form(fit), loc="left")
    _draw_histogram(right, fit)
    return figure


def describe_form(fit: FormFit) -> str:
    """Name and size in a few words."""
    match fit:
        case PlaneFit():
            return f"plane, {abs(fit.offset_mm):.2f} mm from the origin"
        case SphereFit() | CylinderFit():
            return f"{name_of(fit)}, R {fit.radius_mm:.3f} mm"
        case ConeFit():
            return f"cone, half angle {fit.half_angle_deg:.3f}°"


def _organised(cloud: Cloud) -> bool:
    return bool(min(cloud.xyz.shape[:2]) > 1)


def _window(chosen: Mask) -> tuple[slice, slice]:
    """Rows and columns that hold all that is chosen."""
    rows, columns = (np.flatnonzero(chosen.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(int(rows[0]) - MARGIN_PX, 0), int(rows[-1]) + 1 + MARGIN_PX),
        slice(max(int(columns[0]) - MARGIN_PX, 0), int(columns[-1]) + 1 + MARGIN_PX),
    )


def _draw_window(axes: Axes, values: Array, window: tuple[slice, slice], shade: Shade) -> None:
    """The map's part of interest, its pixels numbered as in the whole."""
    part = values[window]
    image = draw_map(axes, part, shade)
    top, left = window[0].start, window[1].start
    height, width = part.shape
    image.set_extent((left - 0.5, left + width - 0.5, top + height - 0.5, top - 0.5))


def _draw_dots(axes: Axes, points: Array, values: Array, shade: Shade) -> None:
    """A cloud without grid: its points seen along z."""
    known = np.flatnonzero(np.isfinite(values))
    shown = known[:: max(len(known) // MOST_DOTS, 1)]
    low, high = shade.limits_of(values)
    dots = axes.scatter(
        points[shown, 0],
        points[shown, 1],
        c=values[shown],
        cmap=shade.colormap,
        vmin=low,
        vmax=high,
        s=2,
        linewidths=0,
        rasterized=True,
    )
    _label_front(axes)
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.colorbar(dots, ax=axes, label=shade.label)


def _label_front(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.invert_yaxis()
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")


def _draw_histogram(axes: Axes, fit: FormFit) -> None:
    off = fit.deviations_mm
    low, high = np.quantile(off, [0.001, 0.999])
    axes.hist(off, bins=BINS, range=(float(low), float(high)), color=CAMERA_COLOUR, alpha=0.75)
    for edge in np.quantile(off, [0.025, 0.975]):
        axes.axvline(float(edge), color=PROJECTOR_COLOUR, linestyle="--", linewidth=1)
    axes.set_xlabel(_off_label(fit))
    axes.set_ylabel("points")
    words = f"rms {fit.form_rms_mm:.4f} mm, 95 % in a band of {fit.band95_mm:.4f} mm"
    axes.set_title(words, loc="left")


def _off_label(fit: FormFit) -> str:
    """What the sign means, in as few words as an axis holds."""
    side = "nearer the origin" if isinstance(fit, PlaneFit) else "outside"
    return f"off the form, mm: positive {side}"


def draw_found(cloud: Cloud, region: Region, found: FoundForms) -> Figure:
    """Every point in the colour of its form, over the camera's picture where there is a grid."""
    chosen = chosen_pixels(cloud, region)
    label = np.full(chosen.shape, -1)
    label[chosen] = found.labels
    colours = _colours(len(found.forms))
    wide = _organised(cloud)
    figure = new_figure(map_height_in(chosen.shape) if wide else 6.0)
    axes = figure.add_subplot()
    if wide:
        axes.imshow(_painted(cloud, label, colours), interpolation_stage="rgba")
        label_pixels(axes)
        _number(axes, label, count=len(colours))
    else:
        _draw_labelled(axes, cloud, label, colours)
    words = [
        f"{place}: {describe_form(form.fit)}" for place, form in enumerate(found.forms, start=1)
    ]
    patches = [Patch(color=colour, label=word) for colour, word in zip(colours, words, strict=True)]
    figure.legend(handles=patches, loc="outside lower center", ncols=2, frameon=False)
    axes.set_title("forms found", loc="left")
    return figure


def _number(axes: Axes, label: NDArray[np.int64], *, count: int) -> None:
    """Each form's number on that of its points which is next to their middle."""
    for place in range(count):
        pixels = np.argwhere(label == place)
        away = np.sum((pixels - np.median(pixels, axis=0)) ** 2, axis=1)
        row, column = (int(value) for value in pixels[np.argmin(away)])
        box = {"boxstyle": "circle", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
        axes.annotate(f"{place + 1}", (column, row), ha="center", va="center", bbox=box)


def _colours(count: int) -> list[tuple[float, float, float]]:
    return [to_rgb(FORM_COLOURS[place % len(FORM_COLOURS)]) for place in range(count)]


def _painted(
    cloud: Cloud, label: NDArray[np.int64], colours: Sequence[tuple[float, float, float]]
) -> Array:
    """``(H, W, 3)`` the camera's picture, tinted; points of no form stay grey, void is light."""
    grey = np.nan_to_num(cloud.intensity.astype(np.float64))
    white = max(float(np.percentile(grey, 99.0)), 1e-9)
    light = 0.35 + 0.65 * np.clip(grey / white, 0, 1)
    picture = np.full((*label.shape, 3), 0.93)
    picture[cloud.valid] = OTHER_GREY * light[cloud.valid][:, None]
    for place, colour in enumerate(colours):
        there = label == place
        picture[there] = np.array(colour) * light[there][:, None]
    return picture


def _draw_labelled(
    axes: Axes,
    cloud: Cloud,
    label: NDArray[np.int64],
    colours: Sequence[tuple[float, float, float]],
) -> None:
    palette = np.array([(OTHER_GREY,) * 3, *colours])
    points, painted = cloud.points(), palette[label[cloud.valid] + 1]
    step = max(len(points) // MOST_DOTS, 1)
    axes.scatter(
        points[::step, 0],
        points[::step, 1],
        c=painted[::step],
        s=2,
        linewidths=0,
        rasterized=True,
    )
    _label_front(axes)
