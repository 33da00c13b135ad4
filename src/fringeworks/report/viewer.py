"""An interactive view of an organised cloud for a page: its surface and colours, packed.

``surface.js`` and ``viewer.js`` beside this module draw it with WebGL and need nothing else, no
network either. Coordinates are rounded to 16 bits: for looking, not for measuring.
"""

from __future__ import annotations

import json
from base64 import b64encode
from html import escape
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from fringeworks.model import Cloud
from fringeworks.report.blocks import CloudView
from fringeworks.report.canvas import Shade
from fringeworks.report.cloud import DEPTH
from fringeworks.report.surface import Surface, find_surface

COLOUR_STEPS = 255
VOID_RGB = (150, 150, 150)
"""Colour 255 of each map: the value is not known."""

NO_WEBGL = "A still picture: this browser, or its settings, offer no WebGL or no JavaScript."

Points = NDArray[np.float64]


def quantise(points: Points) -> tuple[NDArray[np.uint16], Points, float]:
    """Points ``(n, 3)`` as 16-bit counts of one step from their lowest corner, mm.

    ``lowest + step * counts`` is right to half a step.
    """
    lowest = points.min(axis=0)
    step = max(float((points - lowest).max()), 1e-6) / np.iinfo(np.uint16).max
    return np.rint((points - lowest) / step).astype("<u2"), lowest, step


def write_viewer(view: CloudView, still: str) -> str:
    """HTML of a view; `still` is HTML of a picture to fall back on."""
    surface = find_surface(view.cloud)
    data = _pack(view.cloud, surface)
    words = f"{escape(view.caption)} <small>{_describe(view.cloud, surface, data['step'])}</small>"
    packed = json.dumps({**data, "caption": view.caption}).replace("<", "\\u003c")
    return (
        '<figure class="cloud-view">'
        f'<div class="still"><p class="no-webgl">{NO_WEBGL}</p>{still}</div>'
        f'<script type="application/json">{packed}</script>'
        f"<figcaption>{words}</figcaption></figure>"
    )


def _describe(cloud: Cloud, surface: Surface, step: float) -> str:
    shown, total = np.count_nonzero(surface.valid), np.count_nonzero(cloud.valid)
    thinned = f", one pixel in {surface.stride} each way" if surface.stride > 1 else ""
    left_out = f", {surface.left_out:,} far off left out" if surface.left_out else ""
    return (
        f"{shown:,} of {total:,} points{thinned}{left_out}, rounded to {1000 * step:.2g} µm: for "
        "looking, not for measuring. Parallel projection; open where the depth jumps."
    )


def _pack(cloud: Cloud, surface: Surface) -> dict[str, Any]:
    """What ``surface.js`` reads: arrays as base64, one entry per valid point, row by row."""
    valid = surface.valid
    thin = np.s_[:: surface.stride, :: surface.stride]
    counts, lowest, step = quantise(surface.grid[valid])
    return {
        "columns": valid.shape[1],
        "cells": _base64(surface.cells),
        "points": _base64(counts),
        "normals": _base64(np.rint(127 * surface.normals[valid]).astype(np.int8)),
        "lowest": lowest.tolist(),
        "step": step,
        "modes": [
            _pack_mode(name, np.asarray(values[thin][valid], dtype=np.float64), shade)
            for name, values, shade in (
                ("depth", cloud.xyz[..., 2], DEPTH),
                ("camera image", cloud.intensity, Shade("intensity, grey levels", "gray")),
                ("sigma", cloud.sigma_mm, Shade("sigma of z, mm", "plasma")),
            )
            if np.isfinite(values[thin][valid]).any()
        ],
    }


def _pack_mode(name: str, values: Points, shade: Shade) -> dict[str, Any]:
    """One way to colour the points: 255 steps between the shade's limits, then void."""
    low, high = shade.limits_of(values)
    share = np.clip((values - low) / (high - low), 0, 1) * (COLOUR_STEPS - 1)
    levels = np.where(np.isfinite(share), np.rint(share), COLOUR_STEPS).astype(np.uint8)
    colours = mpl.colormaps[shade.colours](np.linspace(0, 1, COLOUR_STEPS))[:, :3]
    table = np.concatenate([np.rint(255 * colours), [VOID_RGB]]).astype(np.uint8)
    places = max(0, 2 - int(np.floor(np.log10(high - low))))
    return {
        "name": name,
        "label": shade.label,
        "low": f"{low:.{places}f}",
        "high": f"{high:.{places}f}",
        "levels": _base64(levels),
        "colours": _base64(table),
    }


def _base64(values: NDArray[Any]) -> str:
    return b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
