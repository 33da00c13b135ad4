"""``fringeworks calibrate``: from captures of a board to a rig."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fringeworks.cli.arguments import GroupOption
from fringeworks.cli.extended import describe_extended, fit_captures, with_fit
from fringeworks.cli.output import JsonFlag, Output, Progress, print_note
from fringeworks.cli.residual import choose_residual, describe_residual
from fringeworks.cli.rig import print_lens, print_pose
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.model import Capture, Rig


BoardShape = Literal["flat", "paraboloid"]
Model = Literal["joint", "paper"]
Extension = Literal["none", "map", "paper"]
Residual = Literal["none", "auto"]


def calibrate(
    captures: Annotated[
        list[Path],
        typer.Argument(
            metavar="CAPTURE...", help="Captures of the board, or a folder whose subfolders are."
        ),
    ],
    board: Annotated[Path, typer.Option("--board", help="board.toml: corners and pitch, mm.")],
    out: Annotated[Path, typer.Option("--out", help="File to write: rig.json.")],
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw residuals and poses into this folder."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            metavar="FILE.html",
            help="Write a page: findings, residuals, uncertainty in mm, halves of the views.",
        ),
    ] = None,
    board_shape: Annotated[
        BoardShape,
        typer.Option(
            "--board-shape", help="flat, or paraboloid: solve for one bow of the sheet, x and y."
        ),
    ] = "flat",
    group: GroupOption = None,
    model: Annotated[
        Model,
        typer.Option(
            "--model",
            help="joint: both devices at once, from the coded axes; paper: the camera from the "
            "printed board, then the projector from a projected checkerboard (patterns "
            "paper-calibrate).",
        ),
    ] = "joint",
    extended: Annotated[
        Extension,
        typer.Option(
            "--extended",
            help="Fit the paper's ten parameters to the boards' planes, for scan --model extended: "
            "map with priors, paper the six it found, by feature points; x, else y.",
        ),
    ] = "none",
    residual: Annotated[
        Residual,
        typer.Option(
            "--residual",
            help="auto: a smooth field of what each model leaves, taken from the coordinates of "
            "every scan, where views that it was not fitted to gain by it.",
        ),
    ] = "none",
    as_json: JsonFlag = False,
) -> None:
    """Calibrate camera and projector together from captures of a board in several poses.

    Three views are the least, eight or more tilted by 20 to 40 degrees about both axes are good.
    Both axes must be coded. Writes rig.json: lenses (px), relative pose (mm), depth range (mm).
    """
    output = Output(as_json=as_json)
    folders = find_captures(captures)
    if out.suffix.lower() != ".json":
        raise UsageError(f"--out must be a .json file, got '{out}'")
    if report is not None and report.suffix.lower() != ".html":
        raise UsageError(f"--report must be a .html file, got '{report}'")
    if model == "paper" and board_shape != "flat":
        raise UsageError(f"--board-shape must be flat with --model paper, got {board_shape}")
    from fringeworks.calibrate import CalibrationSettings, calibrate_captures, calibrate_paper
    from fringeworks.files import read_board, read_capture, write_rig

    settings = CalibrationSettings(board_shape=board_shape)
    with output.working() as progress:
        target = read_board(board)
        views = read_captures(folders, output, progress, group=group)
        solve = calibrate_paper if model == "paper" else calibrate_captures
        rig = solve(views, target, settings=settings)
        fit = None
        if extended != "none":
            again = map(partial(read_capture, group=group), progress(folders, "planes"))
            fit = fit_captures(again, rig, extended)
            rig = with_fit(rig, fit)
        rig, chosen = choose_residual(rig) if residual == "auto" else (rig, None)
        write_rig(out, rig)
        drawn: list[Path] = []
        if figures is not None:
            from fringeworks.report.calibration import save_calibration

            drawn = save_calibration(rig, figures)
    summary = describe_rig(output, rig)
    if fit is not None:
        summary["extended"] = describe_extended(output, fit)
    if chosen is not None:
        summary["residual"] = describe_residual(output, chosen)
    output.written([out])
    output.written(drawn)
    if report is not None:
        summary["judged"] = write_report(output, rig, report)
    output.result({"out": out, **summary, "figures": drawn, "report": report})


def write_report(output: Output, rig: Rig, path: Path) -> dict[str, Any]:
    """Write the page about a rig; returns those of its numbers that the record does not keep."""
    from fringeworks.report.calibration_page import make_calibration_page
    from fringeworks.report.judgement import judge_calibration, summarise_judged
    from fringeworks.report.page import write_page

    judged = judge_calibration(rig)
    write_page(path, make_calibration_page(judged))
    output.written([path])
    plain = summarise_judged(judged)
    return {key: plain[key] for key in ("sigma", "systematic", "left_out")}


def find_captures(paths: Sequence[Path]) -> list[Path]:
    """The captures themselves, or all those in a folder, in the order of their numbers."""
    found: list[Path] = []
    for path in paths:
        if not path.is_dir() or (path / "capture.toml").is_file():
            found.append(path)
            continue
        inside = [child.parent for child in path.glob("*/capture.toml")]
        if not inside:
            raise UsageError(f"{path}: neither a capture nor a folder of captures (capture.toml)")
        found += sorted(inside, key=_natural)
    resolved = [path.resolve() for path in found]
    for place, path in enumerate(found):
        if not path.exists():
            raise UsageError(f"{path}: no such capture")
        if path.is_file() and path.suffix != ".toml":
            raise UsageError(f"{path} is no capture: name the folder with capture.toml in it")
        if resolved[place] in resolved[:place]:
            raise UsageError(f"{path} is given twice: every capture must be a pose of its own")
    return found


def _natural(path: Path) -> list[Any]:
    """Sorts pose_2 before pose_10."""
    parts = re.split(r"(\d+)", path.name)
    return [int(part) if part.isdigit() else part for part in parts]


def _place(path: Path) -> Path:
    """The folder of a capture that is given by it, or by its capture.toml."""
    full = path.resolve()
    return full.parent if full.is_file() else full


def read_captures(
    folders: Sequence[Path], output: Output, progress: Progress, *, group: str | None = None
) -> Iterator[Capture]:
    """One capture after the other, each with what its reader noticed."""
    from fringeworks.files import read_capture

    names = [_place(folder).name for folder in folders]
    for folder in progress(folders, "views"):
        capture, place = read_capture(folder, group=group), _place(folder)
        if names.count(place.name) > 1:  # a finding names the capture that it is about
            capture = replace(capture, name=f"{place.parent.name}/{place.name}")
        output.findings(capture.name, capture.findings)
        yield capture


def describe_rig(output: Output, rig: Rig) -> dict[str, Any]:
    """Print a calibrated rig; returns its summary."""
    from dataclasses import asdict

    from fringeworks.calibrate.projected.record import model_of, paper_figures
    from fringeworks.calibrate.record import read_record
    from fringeworks.report.summary import summarise_record, summarise_rig

    kept = read_record(rig.further)
    record, summary = summarise_record(kept), summarise_rig(rig)
    quality = None if rig.quality is None else asdict(rig.quality)
    for finding in () if kept is None else kept.findings:
        print_note(str(finding))
    model, figures = model_of(rig.further), paper_figures(rig.further)
    output.line(f"model: {model}")
    _print_views(output, record["views"], quality)
    if figures is not None:
        _print_paper(output, figures)
    _print_halves(output, record)
    for device in ("camera", "projector"):
        print_lens(output, device, summary[device])
    print_pose(output, summary)
    return {
        "model": model,
        "quality": quality,
        "paper": figures,
        **record,
        "rig": summary,
    }


def _print_views(
    output: Output, views: Sequence[dict[str, Any]], quality: dict[str, Any] | None
) -> None:
    rows = [
        (
            view["name"],
            f"{view['camera_rms_px']:.3f}",
            f"{view['projector_rms_px']:.3f}",
            f"{view['kept']} of {view['offered']}",
            ", ".join(f"{count}: {reason}" for reason, count in view["left_out"].items()),
        )
        for view in views
    ]
    if quality is not None:
        kept = f"{quality['observations_used']} of {quality['observations_offered']}"
        camera, projector = quality["camera_rms_px"], quality["projector_rms_px"]
        rows.append(("all", f"{camera:.3f}", f"{projector:.3f}", kept, ""))
    head = ("view", "camera rms px", "projector rms px", "corners kept", "left out")
    output.table(head, rows, numbers=(1, 2, 3))
    if quality is not None:
        output.line(f"  joint rms {quality['joint_rms_px']:.3f} px")


def _print_paper(output: Output, figures: dict[str, Any]) -> None:
    """What the paper reports of its calibration, beside what it reports there."""
    printed, projected = (
        f"{figures[f'{kind}_kept']} of {figures[f'{kind}_offered']} {kind} corners"
        for kind in ("printed", "projected")
    )
    bound = figures["largest_reprojection_px"]
    everything = "all {:.4f} {:.4f} px".format(*figures["camera_std_of_all_px"])
    output.line("reprojection, 1 sd of x and y, each device by itself")
    output.facts(
        [
            ("camera", _pair(figures["camera_std_px"], f"{printed} within {bound:g} px")),
            ("", f"{everything}; the paper's: 0.0987 0.0905 px"),
            ("projector", _pair(figures["projector_std_px"], projected)),
            ("", "the paper's: 0.7706 0.4851 px"),
        ]
    )


def _pair(values: Sequence[float], over: str) -> str:
    x, y = values
    return f"{x:.4f} {y:.4f} px over {over}"


def _print_halves(output: Output, record: dict[str, Any]) -> None:
    halves = record["halves"]
    if halves is not None:
        output.line(
            f"  two halves of the views differ by {1e3 * halves['rms_mm']:.1f} µm rms, "
            f"{halves['ratio']:.2f} times what they scatter by"
        )
    for reason in record["left_out"]:
        output.line(f"  left out: {reason}")
