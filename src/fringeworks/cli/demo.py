"""``fringeworks demo``: the whole loop on the digital twin, then on a real capture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.output import JsonFlag, Output, Progress, print_note, to_json

if TYPE_CHECKING:
    from fringeworks.experiments.real_boards import RealLine
    from fringeworks.experiments.twin_loop import TwinLoop


def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")] = (
        Path("out/demo")
    ),
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Five poses of the board, and one board of the real capture."),
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Simulate, calibrate, scan and measure, beside the truth; then the same on a real capture.

    The twin of a small rig shows patterns to a board in fourteen poses, to a cylinder and to two
    isolated objects; no hardware is needed. Writes the captures, rig.json, clouds, figures,
    demo.json and report.html, which opens in any browser. Real images are looked for in
    $FRINGEWORKS_DATA.
    """
    output = Output(as_json=as_json)
    with output.working() as progress:
        loop, real = run_demo(out, progress, quick=quick)
        values = {
            "out": out,
            "report": out / "report.html",
            "twin": describe_loop(output, loop),
            "real": describe_real(output, real),
        }
        write_results(out, loop, real, values)
    output.line(f"wrote report.html, demo.json, figures, captures and clouds in {out}")
    output.result(values)


def run_demo(out: Path, progress: Progress, *, quick: bool) -> tuple[TwinLoop, RealLine | None]:
    """Both parts; the second is None where its images are not here."""
    from fringeworks.experiments.real_boards import find_real_set, run_real_line
    from fringeworks.experiments.twin_loop import run_twin_loop

    loop = run_twin_loop(out / "twin", quick=quick, progress=progress)
    chosen = find_real_set()
    if chosen is None:
        return loop, None
    return loop, run_real_line(chosen, out / "real", quick=quick, progress=progress)


def write_results(out: Path, loop: TwinLoop, real: RealLine | None, values: dict[str, Any]) -> None:
    """``demo.json``, the numbers as ``--json`` prints them, and ``report.html``."""
    from fringeworks.experiments.demo_page import make_demo_page
    from fringeworks.files.atomic import write_text
    from fringeworks.report.page import write_page

    plain = to_json(values)
    write_text(out / "demo.json", json.dumps(plain, indent=2, allow_nan=False) + "\n")
    page = make_demo_page(loop, real, plain, figures=out / "figures")
    write_page(out / "report.html", page)


def describe_loop(output: Output, loop: TwinLoop) -> dict[str, Any]:
    """Print the twin's numbers beside the truth; returns them."""
    from fringeworks.report.summary import summarise_rig

    quality, (cylinder, two), form = loop.rig.quality, loop.scans, loop.predicted_form_mm
    assert quality is not None
    rows = [
        ("cylinder, radius", "mm", cylinder.cylinder.radius_mm, cylinder.true_radius_mm),
        ("cylinder, form rms", "mm", cylinder.cylinder.form_rms_mm, 0.0),
        ("cylinder, depth bias p95", "mm", loop.bias.depth_p95_mm, 0.0),
        ("predicted over observed sigma", "", loop.sigma_ratio, 1.0),
        ("two objects, cylinder's radius", "mm", two.cylinder.radius_mm, two.true_radius_mm),
        ("baseline", "mm", loop.rig.baseline_mm, loop.true_rig.baseline_mm),
    ]
    output.line(f"digital twin, calibrated from {loop.poses} poses of a board")
    output.table(
        ("", "measured", "truth", ""),
        [(name, f"{value:.4f}", f"{truth:.4f}", unit) for name, unit, value, truth in rows],
        numbers=(1, 2),
    )
    output.line(
        f"  calibration rms: camera {quality.camera_rms_px:.3f} px, "
        f"projector {quality.projector_rms_px:.3f} px; "
        f"form rms that noise alone makes: {form:.4f} mm"
    )
    return {
        "poses": loop.poses,
        "measures": [
            {"name": name, "unit": unit or None, "measured": value, "truth": truth}
            for name, unit, value, truth in rows
        ],
        "form_rms_predicted_mm": form,
        "bias_normal_p95_mm": loop.bias.normal_p95_mm,
        "rig": summarise_rig(loop.rig),
        "true_rig": summarise_rig(loop.true_rig),
    }


def describe_real(output: Output, line: RealLine | None) -> dict[str, Any] | None:
    """Print the real capture's numbers beside recorded ones, or what it would take."""
    if line is None:
        print_note(describe_lack())
        return None
    from fringeworks.cli.calibrate import describe_rig

    output.line(f"real capture {line.path}")
    return {
        "capture": line.chosen.folder,
        **describe_rig(output, line.rig),
        "comparison": describe_comparison(output, line),
        "boards": describe_boards(output, line),
    }


def describe_lack() -> str:
    """What the real part would need, and how to get it."""
    from fringeworks.experiments.real_boards import REAL_SETS
    from fringeworks.files import data_folder
    from fringeworks.files.data import DATA_VARIABLE

    names = " or ".join(item.folder for item in REAL_SETS)
    return (
        f"The second part needs a real capture, {names}, and {data_folder()} has neither: left "
        "out.\nIts images are other people's and not part of this project: examples/README.md "
        f"says where they are\npublic and how to lay them out; then set {DATA_VARIABLE}."
    )


def describe_comparison(output: Output, line: RealLine) -> list[dict[str, Any]]:
    """Print the rig's numbers beside those that plain OpenCV was recorded with."""
    from dataclasses import asdict

    from fringeworks.experiments.real_boards import compare_rig

    rows = [asdict(row) for row in compare_rig(line)]
    keys = ("kept", "over_all", "opencv")
    output.line("rms in px and baseline in mm; plain OpenCV as recorded with the data, all corners")
    output.table(
        ("", "kept corners", "all corners", "plain OpenCV"),
        [(row["name"], *(_show(row[key]) for key in keys)) for row in rows],
        numbers=(1, 2, 3),
    )
    return rows


def _show(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def describe_boards(output: Output, line: RealLine) -> list[dict[str, Any]]:
    """Print what was measured on each board."""
    boards = [
        {
            "name": name,
            "square_mean_mm": spacing.mean_mm,
            "square_sd_mm": spacing.sd_mm,
            "plane_rms_mm": plane.fit.form_rms_mm,
            "plane_predicted_rms_mm": plane.predicted_rms_mm,
            "squares": len(spacing.all_mm),
            "plane_points": len(plane.fit.deviations_mm),
        }
        for name, spacing, plane in line.boards
    ]
    output.line(f"boards on their clouds, mm; true squares {line.board.pitch_x_mm:g} mm")
    head = ("board", "squares, mean", "sd", "plane rms", "rms predicted by sigma")
    rows = [tuple(_cell(value) for value in list(board.values())[: len(head)]) for board in boards]
    output.table(head, rows, numbers=(1, 2, 3, 4))
    return boards


def _cell(value: object) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
