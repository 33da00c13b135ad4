"""A calibration target on paper at true size: a vector PDF with two bars to measure.

Printers scale: 1e-3 is usual for an office one, and every length of a calibration grows with it.
The bars tell by how much, along x and along y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from fringeworks.calibrate.boards.charuco import charuco_board
from fringeworks.errors import UsageError
from fringeworks.files.atomic import replacing
from fringeworks.model import CharucoTarget, CirclesTarget, Target

Array = NDArray[np.float64]

MM_PER_INCH = 25.4
MARGIN_MM = 6.0
"""What printers leave white all around."""

GAP_MM = 3.0
BELOW_MM, BESIDE_MM = 13.5, 7.0
"""What the bar along x takes with its words, and the bar along y."""

BARS_MM = (250.0, 200.0, 150.0, 100.0, 50.0, 20.0, 10.0)
MARK_MM = 3.0
LINE_PT = 0.5
TEXT_PT = 7.0
WORDS_MM = 104.0
"""Width of the words below the bar."""


@dataclass(frozen=True, slots=True)
class Paper:
    """A sheet of paper, upright or not."""

    width_mm: float
    height_mm: float
    name: str

    @property
    def turned(self) -> Paper:
        return replace(self, width_mm=self.height_mm, height_mm=self.width_mm)

    def __str__(self) -> str:
        return f"{self.name} ({self.width_mm:g} x {self.height_mm:g} mm)"


@dataclass(frozen=True, slots=True)
class Place:
    """Where a target stands on its paper, mm from the upper left corner of the page.

    Attributes
    ----------
    paper
        As it lies: turned where the target fits better so.
    left_mm, top_mm
        The target's first inner corner, or first centre: its frame's origin.
    before_mm
        How far the print reaches to the left of and above it.
    wide_mm, high_mm
        Size of the print.
    """

    paper: Paper
    left_mm: float
    top_mm: float
    before_mm: float
    wide_mm: float
    high_mm: float

    @property
    def bars_mm(self) -> tuple[float, float]:
        """Lengths of the bars along x and y."""
        return _bar(self.wide_mm), _bar(self.high_mm)


def place_target(target: Target, paper: Paper) -> Place:
    """The target in the middle of what the bars leave of the paper.

    Raises
    ------
    UsageError
        It fits neither upright nor across, with the largest pitch that would.
    """
    wide, high, before = _print_size(target)
    for lying in (paper, paper.turned):
        free_x, free_y = _room(lying)
        if wide <= free_x and high <= free_y:
            left = MARGIN_MM + (free_x - wide) / 2 + before
            top = MARGIN_MM + (free_y - high) / 2 + before
            return Place(lying, left, top, before, wide, high)
    largest = target.pitch_x_mm * max(
        min(free_x / wide, free_y / high) for free_x, free_y in (_room(paper), _room(paper.turned))
    )
    raise UsageError(
        f"{target.columns} x {target.rows} of {target.pitch_x_mm:g} mm take {wide:g} x {high:g} mm "
        f"and do not fit {paper} beside the bars: square_mm may be at most "
        f"{math.floor(largest * 10) / 10:g}, or take fewer columns and rows, or larger paper"
    )


def target_figure(target: Target, paper: Paper) -> Figure:
    """The page as a figure of the paper's size; lengths on it are true.

    Raises
    ------
    UsageError
        As `place_target`; or a ChArUco dictionary that does not fit the board.
    """
    place = place_target(target, paper)
    lying = place.paper
    figure = Figure(figsize=(lying.width_mm / MM_PER_INCH, lying.height_mm / MM_PER_INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0, lying.width_mm)
    axes.set_ylim(lying.height_mm, 0)
    _fill(axes, _shapes(target), (place.left_mm, place.top_mm))
    _draw_bars(axes, target, place)
    return figure


def write_page(figure: Figure, path: Path) -> Path:
    """Write a page as vector PDF, whole or not at all; returns its path.

    The same page gives the same bytes.
    """
    with replacing(path) as temporary:
        figure.savefig(temporary, format="pdf", metadata={"CreationDate": None})
    return path


def _print_size(target: Target) -> tuple[float, float, float]:
    """Width, height, and how far the print reaches before the first corner."""
    pitch = target.pitch_x_mm
    if isinstance(target, CirclesTarget):
        radius = target.diameter_mm / 2
        return (
            (target.columns - 1) * pitch + 2 * radius,
            (target.rows - 1) * pitch + 2 * radius,
            radius,
        )
    return (target.columns + 1) * pitch, (target.rows + 1) * pitch, pitch


def _room(paper: Paper) -> tuple[float, float]:
    """Width and height that margins and bars leave."""
    return (
        paper.width_mm - 2 * MARGIN_MM - GAP_MM - BESIDE_MM,
        paper.height_mm - 2 * MARGIN_MM - GAP_MM - BELOW_MM,
    )


def _bar(room: float) -> float:
    return next((length for length in BARS_MM if length <= room), BARS_MM[-1])


def _shapes(target: Target) -> list[Outline]:
    """What is black, mm from the first corner."""
    if isinstance(target, CirclesTarget):
        centres = [(float(x), float(y)) for x, y, _ in target.corners_mm()]
        return [Outline.circle(centre, target.diameter_mm / 2) for centre in centres]
    squares = _black_squares(target)
    return squares + _markers(target) if isinstance(target, CharucoTarget) else squares


def _black_squares(target: Target) -> list[Outline]:
    """Those whose row and column are both even or both odd: the first one is black."""
    pitch = target.pitch_x_mm
    return [
        _square((column - 1) * pitch, (row - 1) * pitch, pitch)
        for row in range(target.rows + 1)
        for column in range(target.columns + 1)
        if (row + column) % 2 == 0
    ]


def _markers(target: CharucoTarget) -> list[Outline]:
    """Black cells of all markers, where OpenCV's board has them."""
    board = charuco_board(target)
    dictionary = board.getDictionary()
    cells = dictionary.markerSize + 2
    cell = target.marker_mm / cells
    outlines = []
    for number, corners in zip(np.ravel(board.getIds()), board.getObjPoints(), strict=True):
        left, top = np.asarray(corners, dtype=np.float64)[0, :2] - target.pitch_x_mm
        image = dictionary.generateImageMarker(int(number), cells)
        for row, column in zip(*np.nonzero(image < 128), strict=True):
            outlines.append(_square(left + column * cell, top + row * cell, cell))
    return outlines


def _square(left: float, top: float, side: float) -> Outline:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]) * side
    return Outline(corners + np.array([left, top]), closed=True)


def _fill(axes: Axes, shapes: list[Outline], origin: tuple[float, float]) -> None:
    """All shapes as one, so that no viewer leaves hairlines between neighbours."""
    whole = Outline.make_compound_path(*shapes)
    moved = Outline(np.asarray(whole.vertices) + np.array(origin), whole.codes)
    axes.add_patch(PathPatch(moved, facecolor="black", edgecolor="none", linewidth=0, snap=False))


def _draw_bars(axes: Axes, target: Target, place: Place) -> None:
    left, top = place.left_mm - place.before_mm, place.top_mm - place.before_mm
    below = top + place.high_mm + GAP_MM + MARK_MM / 2
    beside = left + place.wide_mm + GAP_MM + MARK_MM / 2
    along, down = place.bars_mm
    _draw_bar(axes, (left, below), (left + along, below))
    _draw_bar(axes, (beside, top), (beside, top + down))
    words = _words(target, place.bars_mm)
    start = max(MARGIN_MM, min(left, place.paper.width_mm - MARGIN_MM - WORDS_MM))
    axes.text(start, below + MARK_MM, words, fontsize=TEXT_PT, va="top", linespacing=1.15)
    axes.text(
        beside + MARK_MM,
        top + down / 2,
        f"y: {down:g} mm",
        fontsize=TEXT_PT,
        va="center",
        ha="center",
        rotation=90,
    )


def _draw_bar(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A line with a mark across each end; its length is that from mark to mark."""
    (x0, y0), (x1, y1) = start, end
    across, up = (MARK_MM / 2, 0.0) if x0 == x1 else (0.0, MARK_MM / 2)
    for xs, ys in (
        ((x0, x1), (y0, y1)),
        ((x0 - across, x0 + across), (y0 - up, y0 + up)),
        ((x1 - across, x1 + across), (y1 - up, y1 + up)),
    ):
        axes.plot(xs, ys, color="black", linewidth=LINE_PT, solid_capstyle="butt")


def _words(target: Target, bars: tuple[float, float]) -> str:
    pitch, (along, down) = target.pitch_x_mm, bars
    return (
        f"x: {along:g} mm.  Print at 100 %, glue to a flat plate, measure both bars mark to mark\n"
        "and write into board.toml, in place of square_mm:\n"
        f"pitch_x_mm = {pitch:g} × x / {along:g},  pitch_y_mm = {pitch:g} × y / {down:g}"
    )
