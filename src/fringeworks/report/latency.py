"""A projector's delay as a picture and in plain values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fringeworks.acquire.latency import Latency
from fringeworks.report.canvas import new_figure, save_figure

FRAMES_SHOWN = 4.0
"""How many intervals around the delay are drawn."""


def save_latency(latency: Latency, folder: Path) -> Path:
    """Write ``latency.png``."""
    return save_figure(draw_latency(latency), folder / "latency.png")


def draw_latency(latency: Latency) -> Figure:
    """Each frame's share of the step over its start, and the delay flash by flash."""
    figure = new_figure(4.2, width_in=11.0)
    left, right = figure.subplots(1, 2)
    _draw_shares(left, latency)
    _draw_delays(right, latency)
    return figure


def summarise_latency(latency: Latency) -> dict[str, Any]:
    """All that `latency --json` says of the devices."""
    delays = latency.delays_ms
    return {
        "delay_ms": {
            "median": float(np.median(delays)),
            "least": float(delays.min()),
            "most": float(delays.max()),
            "sd": float(delays.std(ddof=1)) if len(delays) > 1 else None,
        },
        "flashes": len(delays),
        "change_ms": latency.change_ms,
        "interval_ms": latency.interval_ms,
        "unsteady_ms": latency.unsteady_ms,
        "black": latency.black,
        "white": latency.white,
        "full_scale": latency.full_scale,
        "settle_ms": latency.timing.settle_ms,
        "drop_frames": latency.timing.drop_frames,
    }


def _draw_shares(axes: Axes, latency: Latency) -> None:
    middle = float(np.median(latency.delays_ms))
    reach = FRAMES_SHOWN * max(latency.interval_ms, latency.change_ms)
    ramp = [middle - reach, middle - latency.change_ms, middle, middle + reach]
    axes.plot(ramp, [0, 0, 1, 1], color="0.75", linewidth=3, label="the median delay")
    near = np.abs(latency.since_ms - middle) < reach
    axes.plot(latency.since_ms[near], latency.shares[near], ".", color="#0072b2", label="frames")
    settle = latency.timing.settle_ms
    axes.axvline(settle, color="#d55e00", label=f"settle_ms = {settle:g}")
    axes.set_xlabel("start of the frame after the call, ms")
    axes.set_ylabel("share of the step")
    axes.set_title("what frames show", loc="left")
    axes.legend(frameon=False, fontsize="small")


def _draw_delays(axes: Axes, latency: Latency) -> None:
    place = np.arange(1, len(latency.delays_ms) + 1)
    low, high = latency.bounds_ms.T
    axes.vlines(place, low, high, color="0.8", linewidth=4, label="bounds")
    axes.plot(place, latency.delays_ms, "o", color="#0072b2", label="delay")
    axes.axhline(latency.timing.settle_ms, color="#d55e00")
    axes.set_xlabel("flash")
    axes.set_ylabel("ms")
    axes.set_title("from the call to the light, flash by flash", loc="left")
    axes.legend(frameon=False, fontsize="small")
