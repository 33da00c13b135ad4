"""The demo's report: what the twin's loop and the real capture gave, on one page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from fringeworks.experiments.real_boards import RealLine, compare_rig
from fringeworks.experiments.truth import Bias
from fringeworks.experiments.twin_loop import Scanned, TwinLoop
from fringeworks.report.blocks import (
    Block,
    CloudView,
    Details,
    Gallery,
    Number,
    Numbers,
    Page,
    Picture,
    Section,
    Table,
    Text,
    Verdict,
)
from fringeworks.report.calibration import draw_calibration
from fringeworks.report.canvas import map_figure, save_figure, signed_shade
from fringeworks.report.capture import draw_capture
from fringeworks.report.cloud import draw_cloud
from fringeworks.report.decoding import draw_decoding

SIGMA_HOLDS = (0.9, 1.1)
"""Predicted over observed sigma that counts as right."""

WIDE = ("residuals", "coverage", "cloud")
"""Of them, those that need the page's width."""

MARGIN_PX = 8
"""Around what a map of errors shows."""

LENS_ROWS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")

CAPTIONS = {
    "residuals": "What the calibration leaves at every corner, px.",
    "views": "The same, view by view.",
    "coverage": "Where the corners lie in both images, and which way each one misses.",
    "boards": "Camera, projector and the poses of the board.",
    "modulation_x": "Modulation of the fringes.",
    "wrapped_x": "Wrapped phase of the fringes.",
    "order_x": "Fringe order, from the Gray code.",
    "column": "The coordinate: which projector column lights each pixel.",
    "depth": "Depth of the cloud.",
    "sigma_mm": "Random part of its uncertainty, as predicted pixel by pixel.",
    "cloud": "The cloud from three sides.",
}
"""The figures that the page shows, by name, and what is said under each."""


def make_demo_page(
    loop: TwinLoop, real: RealLine | None, values: Mapping[str, Any], *, figures: Path
) -> Page:
    """The page; `values` are the numbers as JSON holds them, `figures` where pictures are kept."""
    cylinder, two = loop.scans
    sections = [
        Section("A cylinder, measured", _cylinder_blocks(loop, cylinder, figures)),
        Section("Two isolated objects", _two_blocks(two)),
        Section("The calibration behind it", _calibration_blocks(loop, figures)),
        Section("Every stage on the way", _stage_blocks(cylinder, figures)),
    ]
    if real is not None:
        sections.append(Section("The same line on a real capture", _real_blocks(real)))
    sections.append(Section("All numbers", [Details("demo.json", values)]))
    return Page(
        title="From patterns to a measured radius",
        lead=_lead(loop),
        sections=sections,
    )


def _lead(loop: TwinLoop) -> str:
    camera, projector = loop.true_rig.camera, loop.true_rig.projector
    images = sum(item.image_count for item in loop.sequence.sets)
    return (
        f"A simulated camera of {camera.width}x{camera.height} px and projector of "
        f"{projector.width}x{projector.height} px were calibrated from {loop.poses} poses of a "
        f"printed board, {images} images each, and measured two scenes. Lenses, pixels, blur, "
        "noise, ambient light and flicker are those of real devices; because the scenes are "
        "known, every number stands beside its truth."
    )


def _cylinder_blocks(loop: TwinLoop, scanned: Scanned, figures: Path) -> list[Block]:
    found, bias, ratio = scanned.cylinder, loop.bias, loop.sigma_ratio
    low, high = SIGMA_HOLDS
    held = Verdict("good", "sigma holds") if low <= ratio <= high else Verdict("bad", "does not")
    numbers = Numbers(
        [
            radius_number(scanned),
            Number(
                "form rms",
                f"{1e3 * found.form_rms_mm:.0f} µm",
                f"truth 0; noise alone, as sigma predicts, {1e3 * loop.predicted_form_mm:.0f} µm",
            ),
            Number(
                "bias, 95 % of the points below",
                f"{1e3 * bias.depth_p95_mm:.1f} µm",
                "of the depth, scanned without noise, after rigid alignment",
            ),
            Number("predicted over observed sigma", f"{ratio:.3f}", "truth 1", verdict=held),
        ]
    )
    return [
        numbers,
        CloudView(scanned.cloud, "The cylinder's cloud, in the camera's frame."),
        Picture(
            save_figure(draw_bias(bias), figures / "bias.png"),
            "What a scan without noise still gets wrong after rigid alignment, along the normal.",
            "Map of the systematic error over the cylinder",
        ),
    ]


def radius_number(scanned: Scanned) -> Number:
    """A cylinder's radius beside the true one."""
    found, true = scanned.cylinder, scanned.true_radius_mm
    error = 1e3 * (found.radius_mm - true)
    return Number("radius", f"{found.radius_mm:.3f} mm", f"truth {true:.3f} mm, {error:+.0f} µm")


def draw_bias(bias: Bias) -> Figure:
    """Map of the signed error along the normal."""
    reach = 2 * bias.normal_p95_mm * 1e3
    shade = signed_shade("error along the normal, µm", reach)
    title = f"error without noise, 95 % below {1e3 * bias.normal_p95_mm:.1f} µm"
    figure = map_figure(1e3 * bias.normal_mm, shade, title)
    rows, columns = np.nonzero(np.isfinite(bias.normal_mm))
    # Closer: reduced to fewer pixels than it has, a ripple of both signs would turn grey.
    figure.axes[0].set_xlim(columns.min() - MARGIN_PX, columns.max() + MARGIN_PX)
    figure.axes[0].set_ylim(rows.max() + MARGIN_PX, rows.min() - MARGIN_PX)
    return figure


def _two_blocks(scanned: Scanned) -> list[Block]:
    return [
        Text(
            "Between objects that do not touch, fringes cannot be counted; the code says which "
            "fringe is which. The cylinder stands on the left, a cone on the right."
        ),
        Numbers([radius_number(scanned)]),
        CloudView(scanned.cloud, "Cylinder and cone, in the camera's frame."),
    ]


def _calibration_blocks(loop: TwinLoop, figures: Path) -> list[Block]:
    quality = loop.rig.quality
    assert quality is not None
    return [
        Numbers(
            [
                Number("camera rms", f"{quality.camera_rms_px:.3f} px"),
                Number("projector rms", f"{quality.projector_rms_px:.3f} px"),
                Number(
                    "baseline",
                    f"{loop.rig.baseline_mm:.3f} mm",
                    f"truth {loop.true_rig.baseline_mm:.3f} mm",
                ),
            ]
        ),
        Table(
            ("", "camera, found", "truth", "projector, found", "truth"),
            tuple(_lens_rows(loop)),
            numbers=(1, 2, 3, 4),
            caption="Lenses: focal lengths and principal point in px, and distortion",
        ),
        *_save(draw_calibration(loop.rig), figures),
    ]


def _lens_rows(loop: TwinLoop) -> Iterator[tuple[str, ...]]:
    pairs = [
        (getattr(loop.rig, device).lens, getattr(loop.true_rig, device).lens)
        for device in ("camera", "projector")
    ]
    for name in LENS_ROWS:
        digits = 2 if name in ("fx", "fy", "cx", "cy") else 5
        values = (getattr(lens, name) for pair in pairs for lens in pair)
        yield (name, *(f"{value:.{digits}f}" for value in values))


def _stage_blocks(scanned: Scanned, figures: Path) -> list[Block]:
    frames = Picture(
        save_figure(draw_capture(scanned.capture), figures / "capture.png"),
        "Some of the images that the simulated camera took.",
        "Four frames of the capture",
    )
    stages = [*draw_decoding(scanned.decoding), *draw_cloud(scanned.cloud)]
    return [frames, *_save(stages, figures)]


def _save(drawn: Iterable[tuple[str, Figure]], figures: Path) -> list[Block]:
    """The figures that have a caption, each as a file too: wide ones alone, the others in pairs."""
    pictures = {
        name: Picture(save_figure(figure, figures / f"{name}.png"), CAPTIONS[name], CAPTIONS[name])
        for name, figure in drawn
        if name in CAPTIONS
    }
    pairs = [picture for name, picture in pictures.items() if name not in WIDE]
    return [*(pictures[name] for name in WIDE if name in pictures), Gallery(pairs)]


def _real_blocks(line: RealLine) -> list[Block]:
    rows = [
        (
            f"{row.name}, {row.unit}",
            f"{row.kept:.3f}",
            "" if row.over_all is None else f"{row.over_all:.3f}",
            f"{row.opencv:.3f}",
        )
        for row in compare_rig(line)
    ]
    boards = [
        (
            name,
            f"{spacing.mean_mm:.3f}",
            f"{spacing.sd_mm:.3f}",
            f"{plane.fit.form_rms_mm:.3f}",
            f"{plane.predicted_rms_mm:.3f}",
        )
        for name, spacing, plane in line.boards
    ]
    blocks: list[Block] = [
        Text(
            f"`{line.chosen.folder}` (kamino410/procam-calibration, MIT): a Gray code alone on a "
            f"board of {line.board.pitch_x_mm:g} mm squares, three metres away."
        ),
        Table(
            ("", "kept corners", "all corners", "plain OpenCV, all corners"),
            rows,
            numbers=(1, 2, 3),
            caption="The rig beside what plain OpenCV was recorded with",
        ),
        Table(
            ("board", "squares, mean", "sd", "plane rms", "rms predicted by sigma"),
            boards,
            numbers=(1, 2, 3, 4),
            caption="Boards on their clouds, mm",
        ),
    ]
    if line.first is not None:
        blocks.append(CloudView(line.first.cloud, "The first pose's board and room."))
    return blocks
