"""Pictures after the paper's that no other command draws: its geometry, frames, tinted clouds."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fringeworks.geometry.lens import pixel_rays
from fringeworks.model import Cloud, Frames, Rig
from fringeworks.report.canvas import (
    CAMERA_COLOUR,
    PROJECTOR_COLOUR,
    Shade,
    draw_bar,
    label_pixels,
    new_figure,
)
from fringeworks.report.solid import shade_relief

Array = NDArray[np.float64]

PANEL_IN = 4.4
LEAST_DRAWN = 1e-3
"""On a logarithmic axis, values below are drawn here."""

POINT_MM = np.array([22.0, 0.0, 640.0])
"""P of figure 1: where the drawn rays meet."""

REFERENCE_MM = 720.0
"""Where the reference plane of figure 1 is drawn."""


def draw_geometry(rig: Rig) -> Figure:
    """Figure 1 from above, to scale: both lens centres, a point, the fringe that lights it.

    A is the camera's centre, B the projector's, C the pixel and D the fringe that belong to P.
    """
    figure = new_figure(6.2, width_in=7.0)
    axes = figure.add_subplot()
    centre = rig.projector_from_camera.inverse().translation_mm
    camera, projector = np.zeros(2), centre[[0, 2]]
    point = POINT_MM[[0, 2]]
    for start, colour, name in (
        (camera, CAMERA_COLOUR, "A, camera"),
        (projector, PROJECTOR_COLOUR, "B, projector"),
    ):
        axes.plot(*np.stack([start, point]).T, color=colour, linewidth=1.4)
        axes.plot(*start, "o", color=colour)
        axes.annotate(name, tuple(start), (-6, -14), textcoords="offset points", color=colour)
    for low, high, colour in (
        (*_view_edges(rig, of_camera=True), CAMERA_COLOUR),
        (*_view_edges(rig, of_camera=False), PROJECTOR_COLOUR),
    ):
        axes.fill(*np.stack([low[0], low[1], high[1]]).T, color=colour, alpha=0.08)
    _draw_reference(axes, projector, point)
    axes.plot(*np.stack([camera, projector]).T, color="0.4", linewidth=1.0, linestyle="dotted")
    axes.annotate(
        f"baseline {rig.baseline_mm:.0f} mm", tuple((camera + projector) / 2), (0, 8),
        textcoords="offset points", ha="center", color="0.3",
    )  # fmt: skip
    axes.set_aspect("equal")
    axes.set_ylim(-50, REFERENCE_MM + 45)
    axes.set_xlabel("x, mm")
    axes.set_ylabel("depth z, mm")
    axes.set_title("camera, projector and a point, from above", loc="left")
    return figure


def _view_edges(rig: Rig, *, of_camera: bool) -> tuple[Array, Array]:
    """Both edges of a device's view in x and z, each ``(2, 2)``: its centre, its end."""
    device = rig.camera if of_camera else rig.projector
    middle = device.lens.cy if of_camera else (device.height - 1) / 2
    edges = np.array([[-0.5, middle], [device.width - 0.5, middle]])
    rays = pixel_rays(edges, device.lens.vector) * REFERENCE_MM
    place = rig.projector_from_camera.inverse()
    ends = rays if of_camera else place.apply(rays)
    start = np.zeros(3) if of_camera else place.translation_mm
    reach = (REFERENCE_MM - start[2]) / (ends[:, 2] - start[2])
    ends = start + (ends - start) * reach[:, None]
    low, high = (np.stack([start, end])[:, [0, 2]] for end in ends)
    return low, high


def _draw_reference(axes: Axes, projector: Array, point: Array) -> None:
    """The reference plane, and where the rays through P meet it."""
    axes.axhline(REFERENCE_MM, color="0.4", linewidth=1.0)
    axes.annotate(
        "reference plane",
        (-255, REFERENCE_MM),
        (0, 4),
        textcoords="offset points",
        fontsize="small",
    )
    for start, name in ((np.zeros(2), ""), (projector, "P1")):
        reach = (REFERENCE_MM - start[1]) / (point[1] - start[1])
        there = start + (point - start) * reach
        axes.plot(*np.stack([point, there]).T, color="0.5", linewidth=1.0, linestyle="--")
        if name:
            axes.annotate(name, tuple(there), (-2, 4), textcoords="offset points", ha="right")
    axes.plot(*point, "ko")
    axes.annotate("P", tuple(point), (8, -4), textcoords="offset points")


def draw_frames(frames: Mapping[str, Frames], *, full_scale: float) -> Figure:
    """Grey frames of one camera side by side, under their titles."""
    height, width = next(iter(frames.values())).shape[:2]
    figure = new_figure(PANEL_IN * height / width + 0.5, width_in=PANEL_IN * len(frames))
    panels = np.atleast_1d(figure.subplots(1, len(frames)))
    for axes, (title, frame) in zip(panels, frames.items(), strict=True):
        axes.imshow(frame, cmap="gray", vmin=0, vmax=full_scale)
        axes.set_title(title, loc="left")
        label_pixels(axes)
        axes.label_outer()
    return figure


def draw_tinted(clouds: Mapping[str, Cloud], coordinate: int, *, label: str) -> Figure:
    """Clouds as their cameras see them, lit from above, coloured by x, y or z (0, 1, 2).

    All with one colour bar; figures 9, 10 and 14.
    """
    values = [cloud.xyz[..., coordinate] for cloud in clouds.values()]
    finite = np.concatenate([part[np.isfinite(part)] for part in values])
    low, high = (float(level) for level in np.percentile(finite, (0.5, 99.5)))
    shade = Shade(label, "turbo", (low, high))
    shapes = [_span(cloud) for cloud in clouds.values()]
    figure = new_figure(PANEL_IN + 0.4, width_in=PANEL_IN * len(clouds) + 0.8)
    panels = np.atleast_1d(figure.subplots(1, len(clouds)))
    for axes, (title, cloud), part, span in zip(
        panels, clouds.items(), values, shapes, strict=True
    ):
        tint = mpl.colormaps["turbo"](np.clip((part - low) / (high - low), 0, 1))[..., :3]
        image = np.where(cloud.valid[..., None], tint * shade_relief(cloud)[..., None], 1.0)
        axes.imshow(image, interpolation_stage="rgba")
        axes.set_xlim(*span[0])
        axes.set_ylim(*span[1])
        axes.set_title(title, loc="left")
        label_pixels(axes)
    draw_bar(panels[-1], ScalarMappable(Normalize(low, high), "turbo"), shade)
    return figure


def _span(cloud: Cloud) -> tuple[tuple[float, float], tuple[float, float]]:
    """The pixels that nearly all points are in, x from left, y downwards, as a square."""
    rows, columns = np.nonzero(cloud.valid)
    low, high = (
        np.percentile(np.stack([columns, rows]), percent, axis=1) for percent in (0.5, 99.5)
    )
    half, (x, y) = 0.55 * float((high - low).max()) + 2, (low + high) / 2
    return (x - half, x + half), (y + half, y - half)


def draw_spread(
    groups: Mapping[str, Mapping[str, Array]],
    *,
    label: str,
    marks: Mapping[str, float],
) -> Figure:
    """Every value as a dot, group by group below each other; dotted lines at the marks."""
    names = [(group, name) for group, rows in groups.items() for name in rows]
    figure = new_figure(1.2 + 0.32 * len(names))
    axes = figure.add_subplot()
    for place, (group, name) in enumerate(names):
        values = np.maximum(groups[group][name], LEAST_DRAWN)
        colour = mpl.colormaps["tab10"](list(groups[group]).index(name))
        axes.plot(values, np.full(len(values), place), "o", color=colour, alpha=0.5, markersize=4)
        axes.plot(np.median(values), place, "|", color="k", markersize=14, markeredgewidth=2)
    for mark, value in marks.items():
        axes.axvline(value, color="0.3", linewidth=1.0, linestyle="dotted")
        axes.annotate(
            mark, (value, 1.0), (0, 3), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="center", fontsize="small",
        )  # fmt: skip
    labels = [f"{group}: {name}" if len(groups) > 1 else name for group, name in names]
    axes.set_yticks(range(len(names)), labels=labels)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlim(left=0.8 * LEAST_DRAWN)
    axes.set_xlabel(f"{label}; bar: median; at the left edge: less")
    return figure
