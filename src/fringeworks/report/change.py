"""What changed between two scans, in plain values and in a picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fringeworks.measure.change import Change
from fringeworks.measure.changed import ChangedRegion
from fringeworks.report.blocks import Details, Page, Picture, Section, Table, Text
from fringeworks.report.canvas import (
    draw_map,
    map_height_in,
    new_figure,
    save_figures,
    signed_shade,
)
from fringeworks.report.parameters import with_sigma

SMALLEST_REACH = 0.1
MOST_NAMED = 40
"""Regions that are numbered in the picture."""

MARK = "#e69f00"

HEAD = ("region", "what", "change, mm", "largest window, mm", "area, mm²", "volume, mm³", "at, mm")


def summarise_change(change: Change) -> dict[str, Any]:
    """The regions with their numbers; units stand in the names, lengths are mm."""
    known = change.difference_mm[np.isfinite(change.difference_mm)]
    return {
        "changed": bool(change.regions),
        "regions": [_plain(region) for region in change.regions],
        "volume_mm3": float(sum(r.volume_mm3 for r in change.regions if np.isfinite(r.volume_mm3))),
        "compared_share": float(known.size / change.difference_mm.size),
        "noise_factor": change.noise_factor,
        "limit_sigmas": change.limit_sigmas,
        "sigma_mm_median": float(np.nanmedian(change.sigma_mm)),
    }


def _plain(region: ChangedRegion) -> dict[str, Any]:
    values = asdict(region)
    values["centre_mm"] = [float(value) for value in region.centre_mm]
    values["box_px"] = list(region.box_px)
    return {
        name: None if isinstance(value, float) and not np.isfinite(value) else value
        for name, value in values.items()
    }


def region_rows(change: Change) -> list[tuple[str, ...]]:
    """Cells under `HEAD`, one row per region."""
    return [_row(number, region) for number, region in enumerate(change.regions, start=1)]


def _row(number: int, region: ChangedRegion) -> tuple[str, ...]:
    place = " ".join(f"{value:.1f}" for value in region.centre_mm)
    area = f"{region.area_mm2:.1f}"
    if region.kind != "changed":
        return (str(number), region.kind, "", "", area, "", place)
    return (
        str(number),
        "nearer" if region.mean_mm > 0 else "further",
        _signed(region.mean_mm, region.mean_sigma_mm),
        f"{region.largest_mm:+.3f}",
        area,
        _signed(region.volume_mm3, region.volume_sigma_mm3),
        place,
    )


def _signed(value: float, sigma: float) -> str:
    shown, deviation = with_sigma(value, sigma)
    return f"{'+' if value > 0 else ''}{shown} ± {deviation}"


def save_change(change: Change, folder: Path) -> list[Path]:
    """Draw ``change.png`` into `folder`; returns its path in a list."""
    return save_figures(draw_change(change), folder)


def draw_change(change: Change) -> Iterator[tuple[str, Figure]]:
    """Name and figure of the map of differences, its regions framed and numbered."""
    values = change.difference_mm
    inside = np.abs(values[(change.labels > 0) & np.isfinite(values)])
    noise = 5 * float(np.nanmedian(change.sigma_mm))
    reach = max(float(np.percentile(inside, 95)) if inside.size else noise, SMALLEST_REACH)
    shade = signed_shade("change towards the camera, mm", reach)
    height, width = values.shape
    figure = new_figure(map_height_in((height, width)))
    axes = figure.add_subplot()
    draw_map(axes, values, shade)
    for number, region in enumerate(change.regions[:MOST_NAMED], start=1):
        u0, u1, v0, v1 = region.box_px
        size = (u1 - u0 + 1, v1 - v0 + 1)
        axes.add_patch(Rectangle((u0 - 0.5, v0 - 0.5), *size, fill=False, color=MARK, lw=1.2))
        axes.annotate(str(number), (u1 + 2, v0), color="black", fontsize=8, va="top")
    count = len(change.regions)
    title = f"{count} region{'' if count == 1 else 's'}" if count else "nothing changed"
    axes.set_title(f"what changed: {title}", loc="left")
    yield "change", figure


def make_change_page(change: Change, before: str, after: str) -> Page:
    """The page; its figure is drawn at once."""
    ((_, figure),) = draw_change(change)
    caption = "Red came nearer, blue went away; framed where that is more than noise."
    rows = region_rows(change)
    listed = Table(HEAD, rows, numbers=(2, 3, 4, 5)) if rows else Text("Nothing but noise.")
    lead = (
        f"From `{before}` to `{after}`. A change is positive towards the camera; sigmas are the "
        "random part. A region is kept where the mean over a window exceeds "
        f"{change.limit_sigmas:.1f} of its standard deviations."
    )
    return Page(
        "What changed",
        lead,
        [
            Section("Where", [Picture(figure, caption, caption)]),
            Section("Regions", [listed]),
            Section("All numbers", [Details("change.json", summarise_change(change))]),
        ],
    )
