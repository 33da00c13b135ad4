"""Pictures of a calibration, drawn from the record that a rig keeps of it.

``residuals.png`` what the solution leaves, ``views.png`` the same view by view, ``coverage.png``
where in both images the corners lie and which way each one misses, ``boards.png`` the scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fringeworks.calibrate.record import ViewRecord, read_record
from fringeworks.errors import FormatError
from fringeworks.model import Camera, Projector, Quality, Rig
from fringeworks.report.canvas import (
    CAMERA_COLOUR,
    PROJECTOR_COLOUR,
    new_figure,
    save_figures,
    view_colours,
)
from fringeworks.report.scene import draw_scene

ARROW_SHARE = 0.05
"""Length of the largest residual in ``coverage.png`` as a share of the image's width."""

SCATTER_PERCENT = 98.5
MOST_IN_LEGEND = 12

Array = NDArray[np.float64]


def save_calibration(rig: Rig, folder: Path) -> list[Path]:
    """Draw a calibrated rig into `folder`; returns the paths.

    Raises
    ------
    FormatError
        The rig has no record of its calibration, or a damaged one.
    """
    return save_figures(draw_calibration(rig), folder)


def draw_calibration(rig: Rig) -> Iterator[tuple[str, Figure]]:
    """Name and figure of every picture."""
    record = read_record(rig.further)
    if record is None or rig.quality is None:
        raise FormatError("the rig keeps no record of its calibration: nothing to draw")
    yield "residuals", _draw_residuals(record.views, rig.quality)
    yield "views", _draw_views(record.views)
    yield "coverage", _draw_coverage(record.views, rig)
    yield "boards", draw_scene(rig, record.views)


def _residuals(view: ViewRecord) -> tuple[Array, Array]:
    """``(n, 2)`` px in camera and projector, NaN where a corner is left out."""
    kept = view.view.kept[:, None]
    return (
        np.where(kept, view.camera_residual_px, np.nan),
        np.where(kept, view.projector_residual_px, np.nan),
    )


def _draw_residuals(views: Sequence[ViewRecord], quality: Quality) -> Figure:
    figure = new_figure(4.9, width_in=10.0)
    left, right = figure.subplots(1, 2)
    camera, projector = zip(*map(_residuals, views), strict=True)
    _scatter(left, camera, quality.camera_rms_px)
    left.set_title(f"camera: rms {quality.camera_rms_px:.3f} px", loc="left")
    _scatter(right, projector, quality.projector_rms_px)
    right.set_title(f"projector: rms {quality.projector_rms_px:.3f} px", loc="left")
    if len(views) <= MOST_IN_LEGEND:
        handles = [
            left.scatter([], [], s=16, color=colour, label=view.name)
            for view, colour in zip(views, view_colours(len(views)), strict=True)
        ]
        figure.legend(handles=handles, loc="outside right center", frameon=False)
    return figure


def _scatter(axes: Axes, residuals: Sequence[Array], rms: float) -> None:
    """Measured minus projected coordinates, with a circle of one rms."""
    every = np.abs(np.concatenate(residuals))
    reach = max(1.1 * float(np.nanpercentile(every, SCATTER_PERCENT)), 3.0 * rms)
    beyond = int(np.count_nonzero((every > reach).any(axis=1)))
    for values, colour in zip(residuals, view_colours(len(residuals)), strict=True):
        axes.scatter(values[:, 0], values[:, 1], s=9, color=colour, alpha=0.75, linewidths=0)
    axes.add_patch(Circle((0, 0), rms, fill=False, color="0.25", linewidth=1.2))
    axes.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    axes.axvline(0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_aspect("equal")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(reach, -reach)
    axes.xaxis.set_major_locator(MaxNLocator(5))  # more of them run into each other
    axes.set_xlabel("measured - projected x, px" + (f"  ({beyond} outside)" if beyond else ""))
    axes.set_ylabel("measured - projected y, px")


def _draw_views(views: Sequence[ViewRecord]) -> Figure:
    figure = new_figure(1.4 + 0.45 * len(views))
    axes = figure.add_subplot()
    place = np.arange(len(views))
    camera = [view.camera_rms_px for view in views]
    projector = [view.projector_rms_px for view in views]
    axes.barh(place - 0.2, camera, 0.38, color=CAMERA_COLOUR, label="camera")
    axes.barh(place + 0.2, projector, 0.38, color=PROJECTOR_COLOUR, label="projector")
    axes.set_yticks(
        place,
        labels=[
            f"{view.name}\n{view.kept_count} of {view.offered_count} corners" for view in views
        ],
    )
    axes.invert_yaxis()
    axes.set_xlabel("rms, px")
    axes.set_title("residuals view by view", loc="left")
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure


def _draw_coverage(views: Sequence[ViewRecord], rig: Rig) -> Figure:
    figure = new_figure(4.9, width_in=11.0)
    left, right = figure.subplots(1, 2)
    camera = [(view.view.camera_px, _residuals(view)[0]) for view in views]
    projector = [(view.view.projector_px, _residuals(view)[1]) for view in views]
    for axes, name, pairs, device in (
        (left, "camera", camera, rig.camera),
        (right, "projector", projector, rig.projector),
    ):
        magnified = _draw_arrows(axes, pairs, device)
        axes.set_title(f"{name}: residuals magnified {magnified:g} times", loc="left")
    return figure


def _draw_arrows(
    axes: Axes,
    pairs: Sequence[tuple[Array, Array]],
    device: Camera | Projector,
) -> float:
    """Corners in a device's image, each with its residual; returns how much it is magnified."""
    lengths = np.hypot(*np.concatenate([residual for _, residual in pairs]).T)
    longest = float(np.nanpercentile(lengths, SCATTER_PERCENT))
    magnified = ARROW_SHARE * device.width / max(longest, 1e-9)
    magnified = float(f"{magnified:.1g}")
    for (points, residual), colour in zip(pairs, view_colours(len(pairs)), strict=True):
        axes.scatter(points[:, 0], points[:, 1], s=4, color=colour, linewidths=0)
        style = {"color": colour, "width": 0.0025, "headwidth": 4, "headlength": 4}
        kept = np.isfinite(residual).all(axis=1)
        axes.quiver(
            *points[kept].T,
            *(magnified * residual[kept]).T,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            **style,
        )
    size = (device.width, device.height)
    axes.add_patch(Rectangle((-0.5, -0.5), *size, fill=False, color="0.4"))
    axes.set_aspect("equal")
    axes.set_xlim(-0.03 * size[0], 1.03 * size[0])
    axes.set_ylim(1.03 * size[1], -0.03 * size[1])
    axes.set_xlabel("x, px")
    axes.set_ylabel("y, px")
    return magnified
