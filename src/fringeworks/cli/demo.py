"""``fringeworks demo``: the whole line on a real capture, its numbers beside the reference's."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.calibrate import find_captures, read_captures
from fringeworks.cli.output import JsonFlag, Output, Progress, print_note, to_json

if TYPE_CHECKING:
    from fringeworks.model import Capture, CheckerboardTarget, Rig

DATA_VARIABLE = "FRINGEWORKS_DATA"


@dataclass(frozen=True, slots=True)
class DemoSet:
    """A real calibration capture with what plain OpenCV makes of it (its README)."""

    folder: str
    camera_rms_px: float
    projector_rms_px: float
    joint_rms_px: float
    baseline_mm: float


DEMO_SETS = (
    DemoSet("sample/procam-half", 0.179, 0.248, 0.222, 672.4),
    DemoSet("real/procam-graycode", 0.333, 0.218, 0.288, 673.5),
)

SHOWN = ("square_mean_mm", "square_sd_mm", "plane_rms_mm", "plane_predicted_rms_mm")
"""Columns of the table of boards."""


def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")] = (
        Path("out/demo")
    ),
    quick: Annotated[
        bool, typer.Option("--quick", help="Measure one board instead of all; no figures.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Run the whole line on a real capture and print its numbers beside the reference's.

    Calibrates from the poses of procam-half (kamino410/procam-calibration, MIT), scans the first
    and measures the board's squares on the clouds. Writes rig.json, cloud.npz, cloud.ply,
    demo.json and figures. The capture is looked for in $FRINGEWORKS_DATA.
    """
    output = Output(as_json=as_json)
    data = data_folder()
    chosen = next((item for item in DEMO_SETS if (data / item.folder).is_dir()), None)
    if chosen is None:
        print_note(describe_lack(data))
        raise typer.Exit(1)
    from fringeworks.cli.calibrate import describe_rig

    folders = find_captures([data / chosen.folder])
    with output.working() as progress:
        rig, board = calibrate_demo(data / chosen.folder, folders, output, progress)
        boards = list(measure_boards(folders[: 1 if quick else None], (rig, board), out, progress))
        figures = [] if quick else draw_demo(folders[0], rig, out, progress)
    output.line(f"demo on {data / chosen.folder}")
    summary = describe_rig(output, rig)
    rows = compare(chosen, rig)
    output.line("beside plain OpenCV on the same images")
    output.table(
        ("", "here", "OpenCV"),
        [(name, f"{here:.3f} {unit}", f"{there:.3f} {unit}") for name, here, there, unit in rows],
        numbers=(1, 2),
    )
    output.line(f"boards on their clouds, mm; true squares {board.pitch_x_mm:g} mm")
    output.table(
        ("board", "squares, mean", "sd", "plane rms", "rms predicted by sigma"),
        [(item["name"], *(f"{item[key]:.3f}" for key in SHOWN)) for item in boards],
        numbers=(1, 2, 3, 4),
    )
    values = {
        "capture": chosen.folder,
        "out": out,
        **summary,
        "boards": boards,
        "comparison": [
            {"name": name, "value": here, "opencv": there, "unit": unit}
            for name, here, there, unit in rows
        ],
        "files": [out / "rig.json", out / "cloud.npz", out / "cloud.ply", *figures],
    }
    from fringeworks.files.atomic import write_text

    write_text(out / "demo.json", json.dumps(to_json(values), indent=2, allow_nan=False) + "\n")
    output.line(f"wrote rig.json, cloud.npz, cloud.ply, demo.json in {out}")
    output.written(figures)
    output.result(values)


def data_folder() -> Path:
    """Where real captures are: `$FRINGEWORKS_DATA`, else ``../shared/data`` beside the checkout."""
    named = os.environ.get(DATA_VARIABLE)
    if named:
        return Path(named)
    checkout = Path(__file__).resolve().parents[3]
    beside = checkout if (checkout / "pyproject.toml").is_file() else Path.cwd()
    return beside.parent / "shared" / "data"


def describe_lack(data: Path) -> str:
    """What the demo would need, and how to get it."""
    names = " or ".join(item.folder for item in DEMO_SETS)
    return (
        f"demo: nothing to run on. It needs a real capture, {names}, and {data} has neither.\n"
        "The images are other people's and not part of this project: examples/README.md names "
        "their public\nrepository and the script that lays them out. Then set "
        f"{DATA_VARIABLE} to that folder and run the demo again.\n"
        "A simulated demo, which needs no images, is planned."
    )


def calibrate_demo(
    folder: Path, folders: Sequence[Path], output: Output, progress: Progress
) -> tuple[Rig, CheckerboardTarget]:
    """The rig of all poses."""
    from fringeworks.calibrate import calibrate_captures
    from fringeworks.files import read_board

    board = read_board(folder / "board.toml")
    return calibrate_captures(read_captures(folders, output, progress), board), board


def measure_boards(
    folders: Sequence[Path], used: tuple[Rig, CheckerboardTarget], out: Path, progress: Progress
) -> Iterator[dict[str, Any]]:
    """Scan each pose and measure its board; the first one's cloud and the rig are written."""
    from fringeworks.files import read_capture, write_cloud, write_rig
    from fringeworks.pipeline import measure_board, scan

    rig, board = used
    write_rig(out / "rig.json", rig)
    for folder in progress(folders, "scanning"):
        capture: Capture = read_capture(folder)
        cloud = scan(capture, rig)
        if folder == folders[0]:
            write_cloud(out / "cloud.npz", cloud)
            write_cloud(out / "cloud.ply", cloud)
        measured = measure_board(cloud, rig, board, view=capture.name)
        if measured is None:
            continue
        spacing, plane = measured
        yield {
            "name": capture.name,
            "square_mean_mm": spacing.mean_mm,
            "square_sd_mm": spacing.sd_mm,
            "squares": len(spacing.all_mm),
            "plane_rms_mm": plane.fit.form_rms_mm,
            "plane_points": len(plane.fit.deviations_mm),
            "plane_predicted_rms_mm": plane.predicted_rms_mm,
        }


def draw_demo(folder: Path, rig: Rig, out: Path, progress: Progress) -> list[Path]:
    """Figures of the calibration and of every stage of the first scan."""
    from fringeworks.files import read_capture
    from fringeworks.phase.decode import decode_phases
    from fringeworks.pipeline import cloud_of
    from fringeworks.report.calibration import draw_calibration
    from fringeworks.report.canvas import save_figure
    from fringeworks.report.cloud import draw_cloud
    from fringeworks.report.decoding import draw_decoding

    capture = read_capture(folder)
    decoding = decode_phases(capture)
    cloud = cloud_of(capture, decoding.projector_map(), rig)
    drawn = [*draw_calibration(rig), *draw_decoding(decoding), *draw_cloud(cloud)]
    return [
        save_figure(figure, out / "figures" / f"{name}.png")
        for name, figure in progress(drawn, "drawing")
    ]


def compare(chosen: DemoSet, rig: Rig) -> list[tuple[str, float, float, str]]:
    """Rows of name, our number, plain OpenCV's, unit."""
    assert rig.quality is not None
    return [
        ("camera rms", rig.quality.camera_rms_px, chosen.camera_rms_px, "px"),
        ("projector rms", rig.quality.projector_rms_px, chosen.projector_rms_px, "px"),
        ("joint rms", rig.quality.joint_rms_px, chosen.joint_rms_px, "px"),
        ("baseline", rig.baseline_mm, chosen.baseline_mm, "mm"),
    ]
