"""A verification in plain values, and its picture: where both devices miss the board."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from fringeworks.calibrate.held.misfit import Misfit
from fringeworks.calibrate.held.verify import Verification
from fringeworks.model import Camera, Projector, Rig
from fringeworks.report.canvas import CAMERA_COLOUR, PROJECTOR_COLOUR, new_figure, save_figures
from fringeworks.report.findings import summarise_finding

ARROW_SHARE = 0.05
"""Length of the largest miss as a share of the image's width."""


def summarise_verification(found: Verification, rig: Rig) -> dict[str, Any]:
    """Verdict, numbers with their limits, and what moved; units stand in the names."""
    moved = found.moved
    return {
        "capture": found.name,
        "holds": found.holds,
        "verdict": found.verdict,
        **_named(found.misfit),
        "epipolar_rms_px": found.epipolar_rms_px,
        "depth_error_mm": found.depth_error_mm,
        "squares_mean_mm": found.squares_mean_mm,
        "squares_sd_mm": found.squares_sd_mm,
        "scale_share": found.scale,
        "scale_sigma": rig.scale_sigma,
        "plane_rms_mm": found.plane_rms_mm,
        "corners_used": len(found.seen.board),
        "corners_offered": len(found.seen.view.reasons),
        "limits": _named(found.limits),
        "limits_from": found.limits_from,
        "moved": None if moved is None else moved.sentence,
        "moved_parts": [] if moved is None else [cause.name for cause in moved.named],
        "findings": [summarise_finding(finding) for finding in found.findings],
        "causes": [] if moved is None else [asdict(cause) for cause in moved.causes],
    }


def _named(misfit: Misfit) -> dict[str, float]:
    return {
        "camera_rms_px": misfit.camera_rms_px,
        "projector_rms_px": misfit.projector_rms_px,
        "along_mean_px": misfit.along_px,
        "epipolar_mean_px": misfit.across_px,
    }


def save_verification(found: Verification, rig: Rig, folder: Path) -> list[Path]:
    """Draw ``verification.png`` into `folder`; returns its path in a list."""
    return save_figures([("verification", draw_verification(found, rig))], folder)


def draw_verification(found: Verification, rig: Rig) -> Figure:
    """Measured minus computed px at each corner, magnified, in both images."""
    figure = new_figure(4.9, width_in=11.0)
    left, right = figure.subplots(1, 2)
    view, kept = found.seen.view, found.seen.view.kept
    _arrows(left, (view.camera_px[kept], found.seen.camera), rig.camera)
    _arrows(right, (view.projector_px[kept], found.seen.projector), rig.projector)
    figure.suptitle(f"{found.name}: the rig {found.verdict}", x=0.01, ha="left")
    return figure


def _arrows(
    axes: Axes,
    misses: tuple[NDArray[np.float64], NDArray[np.float64]],
    device: Camera | Projector,
) -> None:
    places, residuals = misses
    name = type(device).__name__.lower()
    longest = float(np.hypot(*residuals.T).max())
    magnified = float(f"{ARROW_SHARE * device.width / max(longest, 1e-9):.1g}")
    colour = CAMERA_COLOUR if name == "camera" else PROJECTOR_COLOUR
    axes.scatter(places[:, 0], places[:, 1], s=4, color=colour, linewidths=0)
    axes.quiver(
        *places.T, *(magnified * residuals).T, angles="xy", scale_units="xy", scale=1.0,
        color=colour, width=0.0025, headwidth=4, headlength=4,
    )  # fmt: skip
    axes.add_patch(Rectangle((-0.5, -0.5), device.width, device.height, fill=False, color="0.4"))
    axes.set_aspect("equal")
    axes.set_xlim(-0.03 * device.width, 1.03 * device.width)
    axes.set_ylim(1.03 * device.height, -0.03 * device.height)
    axes.set_xlabel("x, px")
    axes.set_ylabel("y, px")
    axes.set_title(f"{name}: misses magnified {magnified:g} times", loc="left")
