"""Section 5's code frame: Table 1 and figures 11 to 13."""

from __future__ import annotations

from dataclasses import asdict, replace

from matplotlib.figure import Figure

from fringeworks.experiments.code_frame import (
    IDEAL_OFFSET_HZ,
    TABLE_1,
    Printed,
    Seen,
    draw_code_frame,
    frames_of,
    ideal_hz,
    measure_codewords,
)
from fringeworks.experiments.paper.chapter import Chapter, Grid, Row, Shown
from fringeworks.experiments.paper.lab import Lab
from fringeworks.phase.codeword_names import table_hz
from fringeworks.phase.paper_code import read_code_frame
from fringeworks.twin.scenes import two_scene, wall_scene

PERIOD_PX = 32.0
CAPTIONS = {
    "code_pattern": ("figure_11_pattern", "Figure 11: the designed pattern."),
    "code_profile": ("figure_12_profile", "Figure 12: fringe, codewords and wrapped phase."),
    "code_frame_x": ("figure_13a_points", "Figure 13a: the code frame on both objects."),
    "code_fringes_x": ("figure_13b_crossings", "Figure 13b: zero crossings about the points."),
    "code_spectra_x": ("figure_13c_spectra", "Figure 13c: frequencies by FFT."),
}


def read_codes(lab: Lab) -> Chapter:
    """Table 1 on a wall, and the paper's example on two objects."""
    wall, two = lab.still(wall_scene()), lab.still(two_scene())
    seen = measure_codewords(frames_of(wall.capture), wall.truth.column)
    frames = replace(frames_of(two.capture), window=lab.template)
    cylinder, cone = sorted(read_code_frame(frames).regions, key=lambda one: one.period.pixel[1])
    far = [row for row in TABLE_1 if not _within(row, seen[row.period_px])]
    said = "; ".join(
        f"{row.period_px:g} px stands {_beyond(row, seen[row.period_px]):.2f} Hz outside"
        for row in far
    )
    assert cylinder.order is not None, "its codeword is certain and the template admits one order"
    assert cone.order is not None, "as the cylinder's"
    return Chapter(
        heading="The code frame: section 5, Table 1, figures 11 to 13",
        words=(
            "Table 1's ideal column is the peak of a zero-mean cosine of 30 samples, in a unit in "
            "which a fringe of 32 samples lasts 0.2 s, plus 0.5. Its second row comes out as 53.7: "
            "the paper's 53.2 is the same peak without the 0.5. The captured column is of every "
            "whole fringe on a wall that fills the view, median and half of what holds the middle "
            f"80 %. Within the paper's tolerances{': all' if not far else ', but ' + said}.\n\n"
            "Equation 13 must read Φ_cyl^a = Φ_cyl^r - 2πk; there is no equation 14."
        ),
        rows=(
            *(_row(row, seen[row.period_px]) for row in TABLE_1),
            Row("codewords of cylinder and cone", "p2, p1",
                f"p{cylinder.codeword + 1}, p{cone.codeword + 1}"),
            Row("difference of their orders", "5", f"{cone.order - cylinder.order}"),
        ),
        grids=(_grid(seen),),
        pictures=[Shown(*_named(name, figure)) for name, figure in draw_code_frame(frames)],
        numbers={
            "ideal_hz": {f"{row.period_px:g}": ideal_hz(row.period_px) for row in TABLE_1},
            "captured": {f"{word:g}": asdict(one) for word, one in seen.items()},
            "outside_tolerance_px": [row.period_px for row in far],
        },
    )  # fmt: skip


def _named(name: str, figure: Figure) -> tuple[str, Figure, str]:
    """As `Shown` takes them."""
    file, caption = CAPTIONS[name]
    return file, figure, caption


def _beyond(row: Printed, seen: Seen) -> float:
    """How far, Hz, the median lies outside the paper's tolerance; below 0 inside it."""
    return abs(seen.median_hz - row.captured_hz) - row.tolerance_hz


def _within(row: Printed, seen: Seen) -> bool:
    return _beyond(row, seen) <= 0


def _row(row: Printed, seen: Seen) -> Row:
    ideal = ideal_hz(row.period_px)
    bare = f", {ideal - IDEAL_OFFSET_HZ:.1f} without the half bin" if row.period_px == 3 else ""
    return Row(
        f"Table 1, {row.period_px:g} px: ideal; captured, Hz",
        f"{row.ideal_hz}; {row.captured_hz:g} ± {row.tolerance_hz:g}",
        f"{ideal:.1f}; {seen.median_hz:.1f} ± {seen.spread_hz:.1f}",
        ("" if _within(row, seen) else "captured is outside") + bare.removeprefix(", "),
    )


def _grid(seen: dict[float, Seen]) -> Grid:
    head = ("codeword", "160 / p + 1", "captured, median", "spread", "fringes", "rightly named")
    rows = [
        (
            f"{word:g} px",
            f"{table_hz(PERIOD_PX / word):.2f}",
            f"{one.median_hz:.2f}",
            f"{one.spread_hz:.2f}",
            f"{one.fringes}",
            f"{one.right:.1%}",
        )
        for word, one in seen.items()
    ]
    return Grid("Every whole fringe of the wall, Hz", head, rows)
