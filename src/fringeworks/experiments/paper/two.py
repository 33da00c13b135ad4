"""Section 5's result, figure 14: two isolated objects by the code frame, beside Gray code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np

from fringeworks.experiments.code_frame import Score, frames_of, score_method
from fringeworks.experiments.paper.chapter import Chapter, Grid, Row, Shown
from fringeworks.experiments.paper.lab import Lab
from fringeworks.experiments.twin_loop import LEFT_OBJECT
from fringeworks.geometry.forms import CylinderFit
from fringeworks.measure.section import CutPlane, cut
from fringeworks.model import Cloud, CodedAxis
from fringeworks.phase.codeframe import order_by_code_frame
from fringeworks.phase.decode import decode_capture
from fringeworks.phase.orders import OrderMethod
from fringeworks.phase.paper_code import code_correlation, paper_code
from fringeworks.phase.window import volume_of
from fringeworks.pipeline import cloud_of, measure_cylinder
from fringeworks.report.canvas import Shade, map_figure
from fringeworks.report.reproduction import draw_tinted
from fringeworks.twin.scenes import CYLINDER_RADIUS_MM, two_scene

METHODS: dict[str, OrderMethod] = {
    "the paper's FFT of a fringe": paper_code,
    "correlation of a fringe": code_correlation,
    "likelihood over the region": order_by_code_frame,
}
THICK_MM = 1.0
EXTENDED, FULL = "paper, extended, paper", "joint, full"

WORDS = (
    "Cylinder and cone do not touch: three fringes do not say how many lie between them. The one "
    "further frame does; the template is a capture of the board. Held against Gray code pixel by "
    "pixel, as the paper does, and against the truth."
)


def measure_two(lab: Lab) -> Chapter:
    """Orders by every reading of the code frame, then the cylinder by every model."""
    still = lab.still(two_scene())
    frames = replace(frames_of(still.capture), window=lab.template)
    column = still.truth.column
    scores = {name: score_method(method, frames, column) for name, method in METHODS.items()}
    found = decode_capture(still.capture, orders="code-frame", volume=volume_of(lab.good_rig))
    clouds = {
        f"{rig}, {name}": cloud_of(still.capture, found, known, model=model)
        for rig in ("paper", "joint")
        for name, (known, model) in lab.models(rig).items()
    }
    radii = {name: measure_cylinder(cloud, LEFT_OBJECT) for name, cloud in clouds.items()}
    chord = _half_chord(clouds[EXTENDED])
    assert found.column is not None, "the code runs along x"
    return Chapter(
        heading="Two isolated objects: section 5, figure 14",
        words=WORDS,
        rows=[*_orders(scores), *_radii(radii, chord)],
        grids=(_grid(radii),),
        pictures=_pictures(found.column, clouds[FULL]),
        clouds=((clouds[EXTENDED], "Figure 14b: both objects by the extended model."),),
        numbers={
            "orders": {name: asdict(score) for name, score in scores.items()},
            "radius_mm": {name: fit.radius_mm for name, fit in radii.items()},
            "half_chord_mm": chord,
        },
    )


def _orders(scores: Mapping[str, Score]) -> list[Row]:
    return [
        Row(
            f"phase not as by Gray code, {name}",
            "0",
            f"{score.differs:.2%}",
            f"{score.ordered:.1%} of the pixels ordered, {score.wrong:.2%} of them wrongly",
        )
        for name, score in scores.items()
    ]


def _radii(radii: Mapping[str, CylinderFit], chord: float) -> list[Row]:
    true = f"true {CYLINDER_RADIUS_MM:g}"
    extended, full = (f"{radii[name].radius_mm:.3f}" for name in (EXTENDED, FULL))
    return [
        Row("cylinder, extended, half-chord, mm", "52.56", f"{chord:.2f}", "as far as it is lit"),
        Row("cylinder, extended, all points, mm", "", extended, true),
        Row("cylinder, full, joint rig, all points, mm", "", full, true),
    ]


def _grid(radii: Mapping[str, CylinderFit]) -> Grid:
    rows = [(name, f"{fit.radius_mm:.3f}", f"{fit.form_rms_mm:.3f}") for name, fit in radii.items()]
    caption = "The cylinder of the two objects, R = 52.5 mm, by the code frame, mm"
    return Grid(caption, ("rig, model", "radius", "form rms"), rows)


def _pictures(column: CodedAxis, cloud: Cloud) -> list[Shown]:
    assert column.phase is not None, "the capture has fringes"
    shade = Shade("absolute phase, rad")
    phase = map_figure(column.phase.phase, shade, "absolute phase by the code frame")
    tinted = draw_tinted({"cylinder and cone": cloud}, 2, label="depth z, mm")
    return [
        Shown("figure_14a_phase", phase, "Figure 14a: absolute phase."),
        Shown("figure_14c_surfaces", tinted, "Figure 14c: the surfaces, coloured by Z."),
    ]


def _half_chord(cloud: Cloud) -> float:
    """Of the section across the cylinder at half its height."""
    upright = np.array([0.0, 1.0, 0.0])
    return cut(cloud, CutPlane(upright, 0.0), LEFT_OBJECT, thickness_mm=THICK_MM).half_chord_mm
