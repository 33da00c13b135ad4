"""Pictures of the code frame: as designed, and as the paper's method reads it in a capture.

Figures 11, 12, 13a, 13b and 13c of the paper, from whatever fringes, code and capture there are.
"""

from __future__ import annotations

import string
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fringeworks.model import Capture, Codeword, FloatMap, Frames
from fringeworks.phase.codeframe import find_code_frame
from fringeworks.phase.codeword_names import (
    NameCodeword,
    name_by_correlation,
    name_by_spectrum,
    peak_frequency,
    spectrum,
    table_hz,
)
from fringeworks.phase.decode import Decoding
from fringeworks.phase.feature_points import Period
from fringeworks.phase.orders import AxisFrames
from fringeworks.phase.paper_code import CodeReading, RegionCode, read_code_frame
from fringeworks.phase.window import Volume, coordinate_window
from fringeworks.report.canvas import (
    WIDTH_IN,
    label_pixels,
    new_figure,
    save_figures,
)

NAMES: Mapping[str, NameCodeword] = MappingProxyType(
    {"paper-code": name_by_spectrum, "code-correlation": name_by_correlation}
)
"""Methods that read one fringe per region."""

MOST_REGIONS = 4
"""Regions that are drawn: the largest ones."""

CODE_COLOUR, FRINGE_COLOUR, PHASE_COLOUR, MARK_COLOUR = "#d62728", "#1f4fb4", "#17a5c4", "0.25"
"""Code, sinusoid and phase in the colours of the paper's figure 12: red, blue, cyan."""

PHASE_TIMES = 10.0
"""The paper draws the phase ten times as large, to stand beside grey levels."""

AROUND = 0.6
"""How much of the line is drawn on either side of a fringe, in lengths of it."""

PANEL_IN = 2.3
PATTERN_IN = 3.6
"""Flat, and as wide as pictures are: the finest codeword needs a pixel for each of its own."""

NARROW_IN = 0.7 * WIDTH_IN


def save_code_reading(reading: CodeReading, folder: Path) -> list[Path]:
    """Draw what `read_code_frame` found into `folder`; returns the paths.

    ``code_frame_x.png``: the frame and its feature points (figure 13a); ``code_fringes_x.png``:
    the fringe of each with its zero crossings (13b); ``code_spectra_x.png``: their spectra (13c).
    """
    return save_figures(draw_code_reading(reading), folder)


def save_fringes_read(
    capture: Capture, decoding: Decoding, folder: Path, *, orders: str, volume: Volume | None
) -> list[Path]:
    """Draw how `orders` was read in a capture into `folder`; nothing for methods not in `NAMES`.

    `capture` is one group of it. Axes whose finest fringes are finer than the code's are left out.
    """
    if orders not in NAMES:
        return []
    paths: list[Path] = []
    for wrapped in [coded.phase.wrapped for coded in decoding.coded if coded.phase is not None]:
        axis = wrapped.fringe.axis
        window = None if volume is None else coordinate_window(volume, axis, capture.shape)
        frames = AxisFrames(capture, axis, (wrapped,), window)
        code, _ = find_code_frame(frames)
        if code.period_px == wrapped.fringe.period_px:
            paths += save_code_reading(read_code_frame(frames, NAMES[orders]), folder)
    return paths


def draw_code_reading(reading: CodeReading) -> Iterator[tuple[str, Figure]]:
    """Name and figure of each; a capture without a whole fringe in any region has the first."""
    axis, regions = reading.code.axis, _largest(reading)
    yield f"code_frame_{axis}", draw_feature_points(reading)
    if regions:
        yield f"code_fringes_{axis}", draw_crossings(reading)
        yield f"code_spectra_{axis}", draw_spectra(reading)


def draw_pattern(image: Frames, code: Codeword) -> Figure:
    """The code frame as the projector shows it (figure 11), ``(H, W)`` grey levels."""
    figure = new_figure(PATTERN_IN)
    axes = figure.add_subplot()
    axes.imshow(image, cmap="gray", interpolation="lanczos", aspect="auto")
    axes.set_xlabel("projector x, px")
    axes.set_ylabel("projector y, px")
    words = ", ".join(f"{word:g}" for word in code.codewords_px)
    axes.set_title(f"codewords of {words} px in fringes of {code.period_px:g} px", loc="left")
    return figure


def draw_profile(fringe: FloatMap, code: FloatMap, phase: FloatMap, *, name: str) -> Figure:
    """Fringe, code and wrapped phase along a line of the projector (figure 12).

    The first two are grey levels ``(n,)``; the phase, rad, is drawn ten times as large.
    """
    figure = new_figure(3.4)
    axes = figure.add_subplot()
    for values, colour, label in (
        (fringe, FRINGE_COLOUR, "fringes with a phase shift of zero"),
        (code, CODE_COLOUR, "code frame"),
        (PHASE_TIMES * phase, PHASE_COLOUR, f"wrapped phase, rad, times {PHASE_TIMES:g}"),
    ):
        axes.plot(values, color=colour, linewidth=1.0, label=label)
    axes.set_xlim(0, len(code) - 1)
    axes.set_xlabel(f"projector {name}, px")
    axes.set_ylabel("grey level; rad x 10")
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    return figure


def draw_feature_points(reading: CodeReading) -> Figure:
    """The captured code frame with the feature point of each region (figure 13a)."""
    height, width = reading.grey.shape
    figure = new_figure(NARROW_IN * height / width + 0.5, width_in=NARROW_IN)
    axes = figure.add_subplot()
    axes.imshow(reading.grey, cmap="gray")
    for letter, found in _largest(reading):
        row, column = found.period.pixel
        axes.plot(column, row, "o", color=CODE_COLOUR, markeredgecolor="white", markersize=7)
        axes.annotate(
            f"{letter} ({row}, {column})",
            (column, row),
            (6, 6),
            textcoords="offset points",
            color="white",
            bbox={"facecolor": "black", "alpha": 0.6, "edgecolor": "none", "pad": 2},
        )
    label_pixels(axes)
    axes.set_title("captured code frame; feature points (row, column)", loc="left")
    return figure


def draw_crossings(reading: CodeReading) -> Figure:
    """Code frame and phase round each feature point, and the zero crossings (figure 13b)."""
    panels = _largest(reading)
    figure = new_figure(PANEL_IN * len(panels) + 0.4)
    axes = _stacked(figure, len(panels))
    for (letter, found), panel in zip(panels, axes, strict=True):
        _draw_crossing(panel, reading, found, letter)
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False
    )
    return figure


def draw_spectra(reading: CodeReading) -> Figure:
    """Spectrum of each feature point's fringe beside the codewords' frequencies (figure 13c)."""
    panels = _largest(reading)
    figure = new_figure(PANEL_IN * len(panels) + 0.4)
    for (letter, found), axes in zip(panels, _stacked(figure, len(panels)), strict=True):
        _draw_spectrum(axes, reading.code, found, letter)
    return figure


def _largest(reading: CodeReading) -> list[tuple[str, RegionCode]]:
    """The regions with most pixels from left to right, each with its letter."""
    region = reading.unwrapped.region
    size = np.bincount(region[region >= 0], minlength=reading.unwrapped.region_count)
    large = sorted(reading.regions, key=lambda found: -size[found.period.region])[:MOST_REGIONS]
    large.sort(key=lambda found: found.period.pixel[1])
    return list(zip(string.ascii_uppercase, large, strict=False))


def _stacked(figure: Figure, count: int) -> list[Axes]:
    """So many panels, one below the other."""
    return [figure.add_subplot(count, 1, place + 1) for place in range(count)]


def _draw_crossing(axes: Axes, reading: CodeReading, found: RegionCode, letter: str) -> None:
    period = found.period
    grey, phase = _line_of(reading.grey, period), _line_of(reading.unwrapped.wrapped.phase, period)
    reach = AROUND * period.length_px
    first = max(int(period.start_px - reach), 0)
    last = min(int(period.end_px + reach), len(grey) - 1)
    at = np.arange(first, last + 1)
    axes.plot(at, grey[at], color=CODE_COLOUR, linewidth=1.0, label="code frame, grey levels")
    axes.plot(
        at,
        PHASE_TIMES * phase[at],
        color=PHASE_COLOUR,
        linewidth=1.0,
        label=f"wrapped phase, rad, times {PHASE_TIMES:g}",
    )
    axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
    for crossing, mark in ((period.start_px, "'"), (period.end_px, "''")):
        axes.axvline(crossing, color=MARK_COLOUR, linewidth=0.8, linestyle="--")
        axes.plot(crossing, 0, "o", color=MARK_COLOUR, markersize=4)
        axes.annotate(f"{letter}{mark}", (crossing, 0), (4, 4), textcoords="offset points")
    axes.plot(period.feature, 0, "s", color=MARK_COLOUR, markersize=5, label="feature point")
    axes.annotate(letter, (period.feature, 0), (4, 4), textcoords="offset points")
    line, along = ("row", "x") if period.axis == "x" else ("column", "y")
    axes.set_xlim(first, last)
    axes.set_xlabel(f"camera {along}, px, in {line} {period.line}")
    axes.set_ylabel("grey level; rad x 10")
    axes.set_title(f"{letter}: one fringe of {period.length_px:.1f} camera px", loc="left")


def _line_of(image: Frames | FloatMap, period: Period) -> Frames | FloatMap:
    return image[period.line] if period.axis == "x" else image[:, period.line]


def _draw_spectrum(axes: Axes, code: Codeword, found: RegionCode, letter: str) -> None:
    frequency, magnitude = spectrum(found.fringe.grey)
    scale = found.fringe.length_px
    hertz, peak = table_hz(frequency * scale), table_hz(peak_frequency(found.fringe.grey) * scale)
    own = [table_hz(code.period_px / word) for word in code.codewords_px]
    last = 1.25 * max(own)
    axes.plot(hertz, magnitude, color=CODE_COLOUR, linewidth=1.0)
    for place, line in enumerate(own):
        axes.axvline(line, color="0.75", linewidth=0.8, zorder=0)
        axes.annotate(
            f"p{place + 1}",
            (line, 1.0),
            (0, 2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="center",
            color=MARK_COLOUR,
        )
    axes.plot(peak, magnitude.max(), "o", color=MARK_COLOUR, markersize=4)
    word = f"p{found.codeword + 1}" if found.margin > 0 else "no codeword"
    order = "no order" if found.order is None else f"order {found.order}"
    axes.set_xlim(0, last)
    axes.set_ylim(0, 1.08 * float(magnitude.max()))
    axes.set_xlabel("frequency in the unit of the paper's Table 1, Hz")
    axes.set_ylabel("magnitude")
    axes.set_title(f"{letter}: {peak:.1f} Hz, {word}, {order}", loc="left", pad=16)
