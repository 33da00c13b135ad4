"""``fringeworks demo``: the whole line on a real capture, its numbers beside recorded ones."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.calibrate import describe_rig, find_captures, read_captures
from fringeworks.cli.output import JsonFlag, Output, Progress, print_note, to_json

if TYPE_CHECKING:
    from fringeworks.model import Capture, CheckerboardTarget, Cloud, Rig
    from fringeworks.phase.decode import Decoding


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
    """Run the whole line on a real capture and print its numbers beside recorded ones.

    Calibrates from the poses of procam-half (kamino410/procam-calibration, MIT), scans the first
    and measures the board's squares on the clouds. Writes rig.json, cloud.npz, cloud.ply,
    demo.json and figures. The capture is looked for in $FRINGEWORKS_DATA.
    """
    output = Output(as_json=as_json)
    from fringeworks.files import data_folder

    data = data_folder()
    chosen = next((item for item in DEMO_SETS if (data / item.folder).is_dir()), None)
    if chosen is None:
        print_note(describe_lack(data))
        raise typer.Exit(1)
    with output.working() as progress:
        found = run_line(data / chosen.folder, out, output, progress, quick=quick)
    output.line(f"demo on {data / chosen.folder}")
    values = {
        "capture": chosen.folder,
        "out": out,
        **describe_rig(output, found.rig),
        "boards": found.boards,
        "comparison": describe_comparison(output, chosen, found.rig),
        "files": [out / "rig.json", out / "cloud.npz", out / "cloud.ply", *found.figures],
    }
    describe_boards(output, found)
    write_values(out / "demo.json", values)
    output.line(f"wrote rig.json, cloud.npz, cloud.ply, demo.json in {out}")
    output.written(found.figures)
    output.result(values)


def describe_lack(data: Path) -> str:
    """What the demo would need, and how to get it."""
    from fringeworks.files.data import DATA_VARIABLE

    names = " or ".join(item.folder for item in DEMO_SETS)
    return (
        f"demo: nothing to run on. It needs a real capture, {names}, and {data} has neither.\n"
        "The images are other people's and not part of this project: examples/README.md names "
        "their public\nrepository and the script that lays them out. Then set "
        f"{DATA_VARIABLE} to that folder and run the demo again.\n"
        "A simulated demo, which needs no images, is planned."
    )


@dataclass(frozen=True, slots=True)
class Found:
    """What the line has found: the rig, each board's numbers, and the paths of the figures."""

    rig: Rig
    board: CheckerboardTarget
    boards: list[dict[str, Any]]
    figures: list[Path]


@dataclass(frozen=True, slots=True)
class Scanned:
    """A pose at every stop of the line."""

    capture: Capture
    decoding: Decoding
    cloud: Cloud


def run_line(folder: Path, out: Path, output: Output, progress: Progress, *, quick: bool) -> Found:
    """Calibrate from all poses, scan each (`quick`: the first) and measure its board."""
    from fringeworks.calibrate import calibrate_captures
    from fringeworks.files import read_board, write_cloud, write_rig

    board, poses = read_board(folder / "board.toml"), find_captures([folder])
    rig = calibrate_captures(read_captures(poses, output, progress), board)
    write_rig(out / "rig.json", rig)
    boards: list[dict[str, Any]] = []
    figures: list[Path] = []
    for place, scanned in enumerate(scan_poses(poses[: 1 if quick else None], rig, progress)):
        boards += measure_pose(scanned, rig, board)
        if place == 0:
            write_cloud(out / "cloud.npz", scanned.cloud)
            write_cloud(out / "cloud.ply", scanned.cloud)
            figures = [] if quick else draw_demo(scanned, rig, out / "figures", progress)
    return Found(rig, board, boards, figures)


def scan_poses(poses: Sequence[Path], rig: Rig, progress: Progress) -> Iterator[Scanned]:
    """Each pose read, decoded and triangulated once."""
    from fringeworks.files import read_capture
    from fringeworks.phase.decode import decode_phases
    from fringeworks.pipeline import cloud_of

    for pose in progress(poses, "scanning"):
        capture = read_capture(pose)
        decoding = decode_phases(capture)
        yield Scanned(capture, decoding, cloud_of(capture, decoding.projector_map(), rig))


def measure_pose(scanned: Scanned, rig: Rig, board: CheckerboardTarget) -> list[dict[str, Any]]:
    """The board's squares and plane on its cloud; nothing where the rig does not use the view."""
    from fringeworks.pipeline import measure_board

    measured = measure_board(scanned.cloud, rig, board, view=scanned.capture.name)
    if measured is None:
        return []
    spacing, plane = measured
    return [
        {
            "name": scanned.capture.name,
            "square_mean_mm": spacing.mean_mm,
            "square_sd_mm": spacing.sd_mm,
            "squares": len(spacing.all_mm),
            "plane_rms_mm": plane.fit.form_rms_mm,
            "plane_points": len(plane.fit.deviations_mm),
            "plane_predicted_rms_mm": plane.predicted_rms_mm,
        }
    ]


def draw_demo(scanned: Scanned, rig: Rig, folder: Path, progress: Progress) -> list[Path]:
    """Figures of the calibration and of every stage of a scan."""
    from fringeworks.report.calibration import draw_calibration
    from fringeworks.report.canvas import save_figures
    from fringeworks.report.cloud import draw_cloud
    from fringeworks.report.decoding import draw_decoding

    scan = [*draw_decoding(scanned.decoding), *draw_cloud(scanned.cloud)]
    return save_figures(progress([*draw_calibration(rig), *scan], "drawing"), folder)


def write_values(path: Path, values: dict[str, Any]) -> None:
    """The numbers as ``--json`` prints them."""
    from fringeworks.files.atomic import write_text

    write_text(path, json.dumps(to_json(values), indent=2, allow_nan=False) + "\n")


def describe_comparison(output: Output, chosen: DemoSet, rig: Rig) -> list[dict[str, Any]]:
    """Print the rig's numbers beside those that plain OpenCV was recorded with."""
    rows = compare(chosen, rig)
    output.line("rms in px and baseline in mm; plain OpenCV as recorded with the data, all corners")
    output.table(
        ("", "kept corners", "all corners", "plain OpenCV"),
        [(row["name"], *(_show(row[key]) for key in ("kept", "all", "opencv"))) for row in rows],
        numbers=(1, 2, 3),
    )
    return rows


def _show(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def describe_boards(output: Output, found: Found) -> None:
    """Print what was measured on each board."""
    output.line(f"boards on their clouds, mm; true squares {found.board.pitch_x_mm:g} mm")
    output.table(
        ("board", "squares, mean", "sd", "plane rms", "rms predicted by sigma"),
        [(item["name"], *(f"{item[key]:.3f}" for key in SHOWN)) for item in found.boards],
        numbers=(1, 2, 3, 4),
    )


def compare(chosen: DemoSet, rig: Rig) -> list[dict[str, Any]]:
    """Rows of name, unit, and the number over kept corners, over all corners, and OpenCV's."""
    from fringeworks.calibrate.record import read_record

    record, quality = read_record(rig.further), rig.quality
    assert record is not None
    assert quality is not None
    camera, projector, joint = record.rms_of_all_px
    numbers = (
        ("camera rms", "px", quality.camera_rms_px, camera, chosen.camera_rms_px),
        ("projector rms", "px", quality.projector_rms_px, projector, chosen.projector_rms_px),
        ("joint rms", "px", quality.joint_rms_px, joint, chosen.joint_rms_px),
        ("baseline", "mm", rig.baseline_mm, None, chosen.baseline_mm),
    )
    return [
        dict(zip(("name", "unit", "kept", "all", "opencv"), row, strict=True)) for row in numbers
    ]
