"""Pictures of a cloud: depth, sigma, what is left across the epipolar line, and the solid thing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fringeworks.model import Cloud, Reason
from fringeworks.model.cloud import REASON_WORDS
from fringeworks.report.canvas import Shade, map_figure, save_figures, signed_shade
from fringeworks.report.decoding import draw_rules
from fringeworks.report.solid import draw_solid

DEPTH = Shade("depth z, mm", "viridis_r")
"""What is near is light, as a lamp at the camera would show it."""

REASON_COLOURS = {
    Reason.NOT_DECODED: "0.55",
    Reason.OFF_LINE: "#cc79a7",
    Reason.OUTSIDE: "#56b4e9",
    Reason.MIXED: "#d55e00",
    Reason.GRAZING: "#e69f00",
}


def save_cloud(cloud: Cloud, folder: Path) -> list[Path]:
    """Draw a cloud into `folder`; returns the paths.

    ``depth.png``, ``sigma_mm.png``, ``cloud.png``, ``epipolar_px.png`` where both axes were used,
    ``systematic_mm.png`` where the rig tells it, ``reasons.png`` where they are kept.
    """
    return save_figures(draw_cloud(cloud), folder)


def draw_cloud(cloud: Cloud) -> Iterator[tuple[str, Figure]]:
    """Name and figure of every picture."""
    yield "depth", map_figure(cloud.xyz[..., 2], DEPTH, "depth")
    yield (
        "sigma_mm",
        map_figure(cloud.sigma_mm, Shade("sigma of z, mm", "plasma"), "random part of the depth"),
    )
    if np.isfinite(cloud.epipolar_px).any():
        yield "epipolar_px", _draw_epipolar(cloud)
    if cloud.systematic_mm is not None and np.isfinite(cloud.systematic_mm).any():
        shade = Shade("systematic sigma of z, mm", "plasma")
        yield "systematic_mm", map_figure(cloud.systematic_mm, shade, "what the rig leaves open")
    if cloud.reason is not None:
        rules = (REASON_WORDS, REASON_COLOURS)
        title = "pixels without a point"
        yield "reasons", draw_rules(cloud.reason, cloud.intensity, title, rules=rules)
    yield "cloud", draw_solid(cloud, DEPTH)


def _draw_epipolar(cloud: Cloud) -> Figure:
    """Signed distances, white where rig and decoding agree; so void is a darker grey here."""
    values = cloud.epipolar_px[np.isfinite(cloud.epipolar_px)]
    reach = max(float(np.percentile(np.abs(values), 99)), 1e-3)
    label = "distance from the epipolar line, projector px"
    shade = signed_shade(label, reach)
    rms = float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
    return map_figure(cloud.epipolar_px, shade, f"epipolar residual, rms {rms:.3f} px")
