"""Figures 1 and 3: the geometry of equation 1 and the set-up, from the twin's rig."""

from __future__ import annotations

from fringeworks.calibrate.record import read_record
from fringeworks.experiments.paper.chapter import Chapter, Row, Shown
from fringeworks.experiments.paper.lab import Lab
from fringeworks.report.reproduction import draw_geometry
from fringeworks.report.scene import draw_scene

WORKING_MM = 600.0
PAPER_WIDTH_MM = 360.0
"""Of the projected image at 600 mm."""


def show_setup(lab: Lab) -> Chapter:
    """What stands on the bench, in numbers of the true rig."""
    rig, record = lab.true_rig, read_record(lab.good_rig.further)
    assert record is not None, "a rig that was just calibrated keeps its record"
    camera, projector = rig.camera, rig.projector
    pixel = WORKING_MM / camera.lens.fx
    width = projector.width * WORKING_MM / projector.lens.fx
    words = (
        "The paper gives the devices, the working distance and the width of the projected image; "
        "baseline, focal lengths and board poses are chosen so that these come out. Phase runs "
        "along the projector's columns here, along its rows in the paper: what it calls X of the "
        "cylinder is y of ours."
    )
    return Chapter(
        heading="Geometry and set-up: section 2 and 4.1, figures 1 and 3",
        words=words,
        rows=(
            Row("camera, px", "752x480", f"{camera.width}x{camera.height}"),
            Row(
                "camera pixel at 600 mm, mm", "about 0.30", f"{pixel:.3f}", "0.03 mm for 0.0987 px"
            ),
            Row("projector, px", "608x684", f"{projector.width}x{projector.height}"),
            Row("projected width at 600 mm, mm", f"{PAPER_WIDTH_MM:g}", f"{width:.0f}"),
            Row(
                "projector column at 600 mm, mm",
                "0.414",
                f"{width / projector.width:.3f}",
                "360 mm over 608 columns is 0.592: the paper's is a mirror's edge",
            ),
            Row("baseline, mm", "", f"{rig.baseline_mm:.1f}"),
        ),
        pictures=(
            Shown("figure_01_geometry", draw_geometry(rig), "Figure 1: the geometry, to scale."),
            Shown(
                "figure_03_setup",
                draw_scene(lab.good_rig, record.views[:3]),
                "Figure 3: camera, projector and the board in three poses.",
            ),
        ),
        numbers={"baseline_mm": rig.baseline_mm, "camera_px_mm": pixel, "width_mm": width},
    )
