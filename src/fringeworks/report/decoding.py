"""Pictures of a decoded capture: one per map of ``phase.npz``, and why pixels are void."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fringeworks.model import (
    AbsolutePhase,
    Axis,
    CodedAxis,
    FloatMap,
    Fusion,
    Void,
    WrappedPhase,
)
from fringeworks.model.phase import NO_EXPOSURE, VOID_WORDS, VoidMap
from fringeworks.phase.decode import Decoding
from fringeworks.report.canvas import (
    Shade,
    label_pixels,
    map_figure,
    map_height_in,
    new_figure,
    robust_limits,
    save_figures,
)

COORDINATE_NAMES: dict[Axis, str] = {"x": "column", "y": "row"}

VOID_COLOURS = {
    Void.SATURATED: "#d55e00",
    Void.MODULATION: "#0072b2",
    Void.RESIDUAL: "#e69f00",
    Void.ORDER: "#cc79a7",
    Void.OTHER_LIGHT: "#56b4e9",
}
"""Okabe and Ito's palette: told apart by colour-blind readers too."""

PALE_CONTRAST = 0.45
"""Contrast of the scene behind the voids, as a share of black to white."""


def save_decoding(decoding: Decoding, folder: Path) -> list[Path]:
    """Draw every stage of a decoding into `folder`; returns the paths.

    Files are called like the maps of ``phase.npz``: ``modulation_x.png``, ``wrapped_x.png``,
    ``order_x.png``, ``column.png`` (for y: ``row.png``), ``sigma_px_x.png``, ``voids_x.png``, and
    ``exposures_x.png`` where several were fused. A
    Gray code alone has neither phase nor order, and one sigma for all pixels.
    """
    return save_figures(draw_decoding(decoding), folder)


def draw_decoding(decoding: Decoding) -> Iterator[tuple[str, Figure]]:
    """Name and figure of every stage, axis by axis."""
    for axis in decoding.coded:
        yield from _draw_coded(axis)
    for wrapped in decoding.finest:
        if wrapped.fusion is not None:
            yield f"exposures_{wrapped.fringe.axis}", _draw_exposures(wrapped, wrapped.fusion)
    for wrapped, _ in decoding.relative:
        name = wrapped.fringe.axis
        yield f"modulation_{name}", _draw_modulation(wrapped.modulation, name)
        yield f"wrapped_{name}", _draw_wrapped(wrapped)
        yield f"voids_{name}", draw_voids(wrapped.void, wrapped.offset, f"void pixels, axis {name}")


def _draw_coded(axis: CodedAxis) -> Iterator[tuple[str, Figure]]:
    name, coordinate = axis.axis, COORDINATE_NAMES[axis.axis]
    yield f"modulation_{name}", _draw_modulation(axis.modulation, name)
    if axis.phase is not None:
        yield f"wrapped_{name}", _draw_wrapped(axis.phase.wrapped)
        yield f"order_{name}", _draw_order(axis.phase)
    shade = Shade(f"projector {coordinate}, px")
    yield coordinate, map_figure(axis.coordinate, shade, f"projector {coordinate}")
    if axis.phase is not None:
        shade = Shade(f"sigma of the {coordinate}, projector px", "plasma")
        yield f"sigma_px_{name}", map_figure(axis.sigma, shade, f"random part of the {coordinate}")
    yield f"voids_{name}", draw_voids(axis.void, axis.offset, f"void pixels, axis {name}")


def _draw_modulation(modulation: FloatMap, name: Axis) -> Figure:
    low, high = 0.0, float(np.percentile(modulation, 99))
    shade = Shade("modulation B, grey levels", "cividis", (low, max(high, 1.0)))
    return map_figure(modulation, shade, f"modulation, axis {name}")


def _draw_wrapped(wrapped: WrappedPhase) -> Figure:
    fringe = wrapped.fringe
    turn = {-np.pi: "-π", -np.pi / 2: "-π/2", 0.0: "0", np.pi / 2: "π/2", np.pi: "π"}
    shade = Shade("wrapped phase, rad", "twilight", (-np.pi, np.pi), turn)
    title = (
        f"wrapped phase, axis {fringe.axis}: {fringe.frame_count} steps of "
        f"{fringe.period_px:.4g} px fringes"
    )
    return map_figure(wrapped.phase, shade, title)


def _draw_order(phase: AbsolutePhase) -> Figure:
    order = np.where(np.isnan(phase.margin), np.nan, phase.order).astype(np.float32)
    fringe = phase.fringe
    title = f"fringe order, axis {fringe.axis}, of {fringe.period_px:.4g} px fringes"
    low, high = robust_limits(order)
    marks = MaxNLocator(8, integer=True).tick_values(low, high)
    ticks = {float(mark): f"{mark:.0f}" for mark in marks if low <= mark <= high}
    return map_figure(order, Shade("fringe order", limits=(low, high), ticks=ticks), title)


def _draw_exposures(wrapped: WrappedPhase, fusion: Fusion) -> Figure:
    """Which exposure weighs most at each pixel, from the shortest, dark, to the longest."""
    count = len(fusion.exposures_ms)
    shades = colormaps["viridis"](np.linspace(0.1, 0.95, count))
    words, colours = {0: "void"}, dict[int, str]()
    for place, exposure_ms in enumerate(fusion.exposures_ms):
        words[place + 1], colours[place + 1] = f"{exposure_ms:g} ms", to_hex(shades[place])
    ruling = np.where(fusion.ruling == NO_EXPOSURE, 0, fusion.ruling + 1).astype(np.uint8)
    title = f"exposure that weighs most, axis {wrapped.fringe.axis}"
    return draw_rules(ruling, wrapped.offset, title, rules=(words, colours))


def draw_voids(void: VoidMap, offset: FloatMap, title: str) -> Figure:
    """Which rule made each pixel void, over a pale image of the scene, with every rule's share."""
    return draw_rules(void, offset, title, rules=(VOID_WORDS, VOID_COLOURS))


def draw_rules(
    void: VoidMap,
    offset: FloatMap,
    title: str,
    *,
    rules: tuple[Mapping[Any, str], Mapping[Any, str]],
) -> Figure:
    """As `draw_voids`, by the words and colours of these rules; zero is valid."""
    figure = new_figure(map_height_in((void.shape[0], void.shape[1]), share=0.66))
    axes = figure.add_subplot()
    axes.imshow(_paint_voids(void, offset, rules[1]))
    label_pixels(axes)
    axes.set_title(title, loc="left")
    words, colours = {0: "valid", **rules[0]}, {0: "white", **rules[1]}
    counts = {rule: int(np.count_nonzero(void == rule)) for rule in words}
    handles = [
        Patch(
            facecolor=colours[rule],
            edgecolor="0.6",
            label=_folded(f"{describe_share(count, void.size)} {words[rule]}"),
        )
        for rule, count in counts.items()
        if count
    ]
    figure.legend(handles=handles, loc="outside right upper", frameon=False)
    return figure


def _paint_voids(
    void: VoidMap, offset: FloatMap, colours: Mapping[Any, str]
) -> NDArray[np.float32]:
    """RGB in [0, 1]: the rules' colours on the scene in pale grey."""
    low, high = robust_limits(offset)
    brightness = np.clip((offset - low) / (high - low), 0, 1) ** 0.6
    pale = 1 - PALE_CONTRAST * (1 - brightness)
    painted = np.repeat(pale[..., None], 3, axis=-1).astype(np.float32)
    for rule, colour in colours.items():
        painted[void == rule] = to_rgb(colour)
    return painted


def describe_share(count: int, total: int) -> str:
    """A share in percent, or a number of pixels where that would read 0.0 %."""
    share = count / total
    return f"{share:.1%}" if share >= 0.0005 else f"{count} px"


def _folded(words: str, width: int = 22) -> str:
    """Words in lines of at most `width` letters, so that the legend stays slim."""
    lines = [""]
    for word in words.split():
        if lines[-1] and len(lines[-1]) + len(word) >= width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)
