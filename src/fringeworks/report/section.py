"""Pictures of sections: the curve with its arc and chord, and radii along an axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fringeworks.geometry.forms.circle import CircleFit
from fringeworks.measure.section import RadiusSeries, Section
from fringeworks.report.canvas import (
    CAMERA_COLOUR,
    PROJECTOR_COLOUR,
    WIDTH_IN,
    new_figure,
    save_figure,
)

Array = NDArray[np.float64]

NEARLY = 0.999
"""Of a coordinate: the axis of the frame that a section's direction is."""

ARC_STEPS = 200
OFF_COLOUR = "#009e73"


def save_section(section: Section, arc: CircleFit | None, folder: Path) -> list[Path]:
    """``section.png``."""
    return [save_figure(draw_section(section, arc), folder / "section.png")]


def save_series(series: RadiusSeries, folder: Path) -> list[Path]:
    """``series.png``."""
    return [save_figure(draw_series(series), folder / "series.png")]


def draw_section(section: Section, arc: CircleFit | None) -> Figure:
    """The curve with arc and chord, and below how far points are off the arc, if there is one."""
    curve = section.curve_mm
    rows = 1 if arc is None else 2
    span = np.ptp(curve, axis=0)
    height = float(np.clip(WIDTH_IN * span[1] / max(span[0], 1e-9), 1.5, 7.0))
    figure = new_figure(height + 1.2 + 2.2 * (rows - 1))
    panels = figure.subplots(rows, 1, squeeze=False, height_ratios=(height, 2.0)[:rows])[:, 0]
    _draw_curve(panels[0], section, arc)
    if arc is not None:
        _draw_off(panels[1], curve, arc)
    return figure


def _draw_curve(axes: Axes, section: Section, arc: CircleFit | None) -> None:
    curve = section.curve_mm
    axes.plot(*curve.T, ".", color=CAMERA_COLOUR, markersize=3, label="points")
    ends = curve[[0, -1]]
    chord = f"half-chord {section.half_chord_mm:.3f} mm"
    axes.plot(*ends.T, "o-", color=PROJECTOR_COLOUR, linewidth=1, markersize=5, label=chord)
    for name, (x, y) in zip("AB", ends, strict=True):
        axes.annotate(name, (x, y), (0, 8), textcoords="offset points", ha="center")
    if arc is not None:
        label = f"arc, R {arc.radius_mm:.3f} ± {arc.radius_sigma_mm:.3f} mm"
        axes.plot(*_arc_through(curve, arc).T, color="0.25", linewidth=1, label=label)
    basis = section.plane.basis
    axes.set_xlabel(name_direction(basis[0], "along the plane") + ", mm")
    axes.set_ylabel(name_direction(basis[1], "across it") + ", mm")
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()  # what is near to the camera is on top
    axes.set_title(f"section, {len(curve)} points", loc="left")
    axes.legend(frameon=False, loc="best", fontsize="small")


def name_direction(direction: Array, otherwise: str) -> str:
    """The frame's axis of that direction."""
    largest = int(np.argmax(np.abs(direction)))
    return "xyz"[largest] if abs(direction[largest]) > NEARLY else otherwise


def _angles(curve: Array, arc: CircleFit) -> Array:
    """About the arc's middle, so that no arc short of a full turn is cut."""
    away = curve - arc.centre_mm
    middle = away.mean(axis=0)
    across = np.array([-middle[1], middle[0]])
    return np.asarray(np.arctan2(away @ across, away @ middle))


def _arc_through(curve: Array, arc: CircleFit) -> Array:
    angles = _angles(curve, arc)
    middle = (curve - arc.centre_mm).mean(axis=0)
    turned = np.linspace(angles.min(), angles.max(), ARC_STEPS) + np.arctan2(middle[1], middle[0])
    return np.asarray(
        arc.centre_mm + arc.radius_mm * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    )


def _draw_off(axes: Axes, curve: Array, arc: CircleFit) -> None:
    degrees = np.rad2deg(_angles(curve, arc))
    axes.plot(degrees, arc.deviations_mm, ".", color=OFF_COLOUR, markersize=3)
    axes.axhline(0.0, color="0.25", linewidth=1)
    axes.set_xlabel("along the arc, degrees from its middle")
    axes.set_ylabel("off the arc, mm: + outside")
    axes.set_title(f"rms {arc.form_rms_mm:.4f} mm", loc="left")


def draw_series(series: RadiusSeries) -> Figure:
    """Radii of the arcs with their sigma, and half-chords, over the place of the section."""
    figure = new_figure(5.2)
    above, below = figure.subplots(2, 1, sharex=True)
    above.errorbar(
        series.at_mm,
        series.radius_mm,
        yerr=series.radius_sigma_mm,
        fmt=".",
        color=CAMERA_COLOUR,
        elinewidth=0.8,
    )
    below.plot(series.at_mm, series.half_chord_mm, ".", color=PROJECTOR_COLOUR)
    _mark_mean(above, series, series.radius_mm, "fitted arc")
    _mark_mean(below, series, series.half_chord_mm, "half-chord of the end points")
    below.set_xlabel("place of the section, mm")
    return figure


def _mark_mean(axes: Axes, series: RadiusSeries, values: Array, what: str) -> None:
    mean, sd = series.mean_mm(values), series.sd_mm(values)
    axes.axhline(mean, color="0.25", linewidth=1)
    if np.isfinite(sd):
        axes.axhspan(mean - sd, mean + sd, color="0.25", alpha=0.12, linewidth=0)
    axes.set_ylabel("radius, mm")
    axes.set_title(f"{what}: mean {mean:.3f} mm, sd {sd:.3f} mm", loc="left")
