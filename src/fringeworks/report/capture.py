"""Pictures of a capture: one frame of each kind of pattern, as the camera saw it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fringeworks.model import (
    Axis,
    Capture,
    Codeword,
    Frames,
    Fringe,
    GrayCode,
    Pattern,
    Uniform,
)
from fringeworks.report.canvas import WIDTH_IN, label_pixels, new_figure

COLUMNS = 2
AXIS_NAMES: dict[Axis, str] = {"x": "columns", "y": "rows"}


def draw_capture(capture: Capture) -> Figure:
    """The white frame, and one frame of the fringes, the Gray code and the code frame."""
    shown = {_name(item.pattern): stack for item, stack in capture if _name(item.pattern)}
    rows = -(-len(shown) // COLUMNS)
    height, width = capture.shape
    figure = new_figure(rows * (WIDTH_IN / COLUMNS * height / width + 0.35))
    panels = figure.subplots(rows, COLUMNS, squeeze=False)
    for axes in panels.flat[len(shown) :]:
        axes.set_axis_off()
    for axes, (name, stack) in zip(panels.flat, shown.items(), strict=False):
        axes.imshow(_middle(stack), cmap="gray", vmin=0, vmax=capture.sensor.full_scale)
        axes.set_title(name, loc="left")
        label_pixels(axes)
        axes.label_outer()
    return figure


def _middle(stack: Frames) -> Frames:
    """The frame in the middle: of a Gray code neither the coarsest bit nor the finest."""
    return np.asarray(stack[len(stack) // 2])


def _name(pattern: Pattern) -> str:
    """What a kind is called; empty for what is not shown."""
    match pattern:
        case Uniform(level=level):
            return "white" if level > 0.5 else ""
        case Fringe(axis=axis, period_px=period):
            return f"fringes across the {AXIS_NAMES[axis]}, period {period:g} px"
        case GrayCode(axis=axis):
            return f"a bit of the Gray code of the {AXIS_NAMES[axis]}"
        case Codeword():
            return "the code frame"
        case _:
            return ""
