"""Pictures and plain values of a camera's noise: the photon transfer curve, and linearity."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fringeworks.phase.photon_transfer.nouns import Estimate, Linearity, PhotonTransfer
from fringeworks.report.canvas import CAMERA_COLOUR, new_figure, save_figures

HEIGHT_IN = 5.6
LINEARITY_HEIGHT_IN = 4.2
LEFT_OUT = "0.6"


def summarise_noise(found: PhotonTransfer) -> dict[str, Any]:
    """A camera's figures in plain values, grey levels."""
    linearity = found.linearity
    return {
        "gain": _estimate(found.gain),
        "read_noise": _estimate(found.read_noise),
        "black_level": {**_estimate(found.black_level), "way": found.black_way},
        "full_scale": {"value": found.full_scale, "seen": found.saturates},
        "full_well_e": found.full_well_e,
        "read_noise_e": found.read_noise_e,
        "step": found.step,
        "misfit": found.misfit,
        "left_out": found.moved_share,
        "linearity_error": linearity and {"least": linearity.least, "most": linearity.most},
        "points": {
            "level": found.points.level.tolist(),
            "variance": found.points.variance.tolist(),
            "used": found.points.used.tolist(),
        },
    }


def _estimate(item: Estimate) -> dict[str, float]:
    return {"value": item.value, "sigma": item.sigma}


def save_noise(found: PhotonTransfer, folder: Path) -> list[Path]:
    """Draw ``noise.png``, and with linearity ``linearity.png``, into `folder`; their paths."""
    return save_figures(_draw(found), folder)


def _draw(found: PhotonTransfer) -> Iterator[tuple[str, Figure]]:
    yield "noise", _draw_curve(found)
    if found.linearity is not None:
        yield "linearity", _draw_linearity(found.linearity)


def _draw_curve(found: PhotonTransfer) -> Figure:
    figure = new_figure(HEIGHT_IN)
    above, below = figure.subplots(2, sharex=True, height_ratios=(3, 1))
    points, gain = found.points, found.gain
    line = found.offset + gain.value * points.level
    _draw_points(above, found, points.variance, points.sigma)
    above.plot(points.level, line, color="black", label=f"line: gain {gain.value:.4g}")
    above.set_ylim(0, 1.1 * max(points.variance.max(), line.max()))
    above.set_ylabel("variance, grey levels²")
    above.set_title(
        f"photon transfer: gain {gain.value:.4g} ± {gain.sigma:.1g}, read noise "
        f"{found.read_noise.value:.4g} ± {found.read_noise.sigma:.1g} grey levels",
        loc="left",
    )
    _mark_ends(above, found)
    above.legend(frameon=False, loc="upper left")
    scale = 100 / np.maximum(np.abs(line), 1e-12)
    _draw_points(below, found, (points.variance - line) * scale, points.sigma * scale)
    below.axhline(0, color="black", linewidth=0.8)
    reach = 1.3 * np.abs((points.variance - line) * scale)[points.used].max()
    below.set_ylim(-max(reach, 1.0), max(reach, 1.0))
    below.set_xlabel("mean, grey levels")
    below.set_ylabel("off the line, %")
    return figure


def _draw_points(axes: Axes, found: PhotonTransfer, y: Any, sigma: Any) -> None:
    level, used = found.points.level, found.points.used
    out = ~used
    axes.errorbar(
        level[used], y[used], sigma[used], fmt=".", color=CAMERA_COLOUR, label="repeats, by level"
    )
    if out.any():
        label = "left out: clipped, or hidden by rounding"
        axes.plot(level[out], y[out], "o", mfc="none", color=LEFT_OUT, label=label)


def _mark_ends(axes: Axes, found: PhotonTransfer) -> None:
    way = {"dark": "dark frames", "exposures": "exposures", "assumed": "assumed"}[found.black_way]
    black = found.black_level.value
    label = f"black level {black:.4g} ({way})"
    axes.axvline(black, color="0.5", linestyle=":", label=label)
    if found.saturates:
        label = f"full scale {found.full_scale:g}"
        axes.axvline(found.full_scale, color="0.5", linestyle="--", label=label)


def _draw_linearity(found: Linearity) -> Figure:
    figure = new_figure(LINEARITY_HEIGHT_IN)
    axes = figure.add_subplot()
    times, off, used = found.exposure_ms, 100 * found.deviation, found.used
    axes.axhline(0, color="black", linewidth=0.8)
    axes.plot(times[used], off[used], ".-", color=CAMERA_COLOUR, label="5 to 95 % of full scale")
    if not used.all():
        axes.plot(times[~used], off[~used], "o", mfc="none", color=LEFT_OUT, label="beyond")
    axes.set_xlabel("exposure, ms")
    axes.set_ylabel("signal off the line, %")
    axes.set_title(f"linearity: {100 * found.least:+.2f} to {100 * found.most:+.2f} %", loc="left")
    axes.legend(frameon=False)
    return figure
