"""Pictures of a cloud: depth, sigma, what is left across the epipolar line, and the solid thing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fringeworks.model import Cloud
from fringeworks.report.canvas import Shade, map_figure, save_figures
from fringeworks.report.solid import draw_solid

DEPTH = Shade("depth z, mm", "viridis_r")
"""What is near is light, as a lamp at the camera would show it."""


def save_cloud(cloud: Cloud, folder: Path) -> list[Path]:
    """Draw a cloud into `folder`; returns the paths.

    ``depth.png``, ``sigma_mm.png``, ``cloud.png``, and ``epipolar_px.png`` where both axes were
    used.
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
    yield "cloud", draw_solid(cloud, DEPTH)


def _draw_epipolar(cloud: Cloud) -> Figure:
    """Signed distances, white where rig and decoding agree; so void is a darker grey here."""
    values = cloud.epipolar_px[np.isfinite(cloud.epipolar_px)]
    reach = max(float(np.percentile(np.abs(values), 99)), 1e-3)
    label = "distance from the epipolar line, projector px"
    shade = Shade(label, "RdBu_r", (-reach, reach), void="0.72")
    rms = float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
    return map_figure(cloud.epipolar_px, shade, f"epipolar residual, rms {rms:.3f} px")
