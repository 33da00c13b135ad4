"""Section 4.2, figures 4 and 5: the calibration, by the paper's way and by ours."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fringeworks.calibrate.projected.record import paper_figures
from fringeworks.experiments.paper.chapter import Chapter, Grid, Row, Shown
from fringeworks.experiments.paper.lab import Lab
from fringeworks.files import read_capture
from fringeworks.model import Capture, Checkerboard, Fringe, Rig
from fringeworks.report.calibration import draw_calibration
from fringeworks.report.reproduction import draw_frames

PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2")


WORDS = (
    "The twin's board is printed without error and its corners are found to hundredths of a "
    "pixel, so that the paper's way comes out far better here than in the paper, whose "
    "0.0987 px are 0.03 mm: the size of a cheap print's errors. What rigs as poor as the "
    "paper's measure is told by the 30 drawn ones below."
)


def calibrate_both(lab: Lab) -> Chapter:
    """Reprojection errors beside the paper's, both rigs beside the truth."""
    figures = paper_figures(lab.paper_rig.further)
    assert figures is not None, "the rig was calibrated by the paper's way"
    drawn = dict(draw_calibration(lab.paper_rig))
    return Chapter(
        heading="Calibration: section 4.2, figures 4 and 5",
        words=WORDS,
        rows=(
            Row(
                "camera reprojection, sd x, y, px",
                "0.0987, 0.0905",
                _pair(figures["camera_std_px"]),
                "corners within 0.25 px",
            ),
            Row(
                "projector reprojection, sd x, y, px",
                "0.77, 0.485",
                _pair(figures["projector_std_px"]),
                "of the projected checkerboard",
            ),
            Row("joint calibration, camera rms, px", "", _rms(lab.good_rig, "camera")),
            Row("joint calibration, projector rms, px", "", _rms(lab.good_rig, "projector")),
        ),
        grids=(_beside_truth(lab),),
        pictures=(
            Shown(
                "figure_04_patterns",
                _draw_patterns(read_capture(lab.poses[0])),
                "Figure 4: printed checkerboard, projected checkerboard, one of the fringes.",
            ),
            Shown(
                "figure_05a_reprojection",
                drawn["residuals"],
                "Figure 5a: what the paper's way leaves, printed corners and projected ones.",
            ),
            Shown("figure_05b_boards", drawn["boards"], "Figure 5b: the board's poses."),
        ),
        numbers={"paper_mode": figures},
    )


def _pair(values: list[float]) -> str:
    return ", ".join(f"{value:.4f}" for value in values)


def _rms(rig: Rig, device: str) -> str:
    assert rig.quality is not None
    return f"{getattr(rig.quality, f'{device}_rms_px'):.4f}"


def _beside_truth(lab: Lab) -> Grid:
    rigs = (lab.true_rig, lab.paper_rig, lab.good_rig)
    rows = [
        (f"{device} {name}", *(f"{getattr(getattr(r, device).lens, name):.4f}" for r in rigs))
        for device in ("camera", "projector")
        for name in PARAMETERS
    ]
    rows.append(("baseline, mm", *(f"{rig.baseline_mm:.3f}" for rig in rigs)))
    return Grid("Rigs beside the truth", ("", "truth", "paper's way", "joint"), rows)


def _draw_patterns(capture: Capture) -> Figure:
    (_, board, _), (_, fringes, _) = capture.find(Checkerboard)[0], capture.find(Fringe)[0]
    white = capture.white()
    assert white is not None, "the sequence has a white frame"
    frames = {
        "printed checkerboard": np.round(white).astype(np.uint8),
        "projected checkerboard": board[0],
        "fringes, shift zero": fringes[1],
    }
    return draw_frames(frames, full_scale=capture.sensor.full_scale)
