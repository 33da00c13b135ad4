"""``fringeworks verify``: does the rig still hold, in mm."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.output import JsonFlag, Output

if TYPE_CHECKING:
    from fringeworks.calibrate.held.verify import Verification
    from fringeworks.model import Rig


def verify(
    capture: Annotated[Path, typer.Argument(help="Folder with one new capture of a board.")],
    rig: Annotated[Path, typer.Option("--rig", help="rig.json to verify.")],
    board: Annotated[Path, typer.Option("--board", help="board.toml: corners and pitch, mm.")],
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw the residuals into this folder."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Tell from one new capture of a board whether the rig still holds, and which part moved.

    Lengths are mm. The board's pose comes from the camera alone; how far the projector misses it
    along the epipolar lines is an error of depth, across them no surface explains it. Limits are
    what the calibration's own views have. A rig that has moved ends with status 0 too: --json
    says holds true or false.
    """
    output = Output(as_json=as_json)
    from fringeworks.calibrate.held.verify import verify_capture
    from fringeworks.files import read_board, read_capture, read_rig
    from fringeworks.report.verify import save_verification, summarise_verification

    with output.working() as progress:
        known, target = read_rig(rig), read_board(board)
        read = read_capture(capture, progress=progress)
        output.findings(read.name, read.findings)
        found = verify_capture(read, known, target)
        drawn = [] if figures is None else save_verification(found, known, figures)
    _describe(output, found, known)
    output.written(drawn)
    output.result({**summarise_verification(found, known), "rig": rig, "figures": drawn})


def _describe(output: Output, found: Verification, rig: Rig) -> None:
    output.line(f"{found.name}: the rig {found.verdict}")
    if found.moved is not None:
        output.line(f"  {found.moved.sentence}")
    misfit, limits = found.misfit, found.limits
    rows = [
        ("camera rms", misfit.camera_rms_px, limits.camera_rms_px),
        ("projector rms", misfit.projector_rms_px, limits.projector_rms_px),
        ("along the epipolar lines, mean", misfit.along_px, limits.along_px),
        ("across the epipolar lines, mean", misfit.across_px, limits.across_px),
    ]
    listed = [(name, f"{value:.3f}", f"{limit:.3f}") for name, value, limit in rows]
    output.table(("", "px", "limit px"), listed, numbers=(1, 2))
    output.line(f"  limits: {found.limits_from}")
    used = len(found.seen.board)
    output.facts(
        [
            ("across the epipolar lines", f"{found.epipolar_rms_px:.3f} px rms"),
            ("depth error", f"{found.depth_error_mm:+.4f} mm, mean"),
            ("squares", f"{found.squares_mean_mm:.4f} mm, sd {found.squares_sd_mm:.4f} mm"),
            ("scale", f"{found.scale:+.3%} against the board"),
            *_scale_sigma(rig),
            ("plane", f"{found.plane_rms_mm:.4f} mm rms of the corners"),
            ("corners used", f"{used} of {len(found.seen.view.reasons)}"),
        ]
    )


def _scale_sigma(rig: Rig) -> list[tuple[str, str]]:
    """How well the rig knows its scale; the board that gave it cannot tell that it is wrong."""
    if rig.scale_sigma is None:
        return []
    known = f"{rig.scale_sigma:.3%} of every length, 1 sd, by the pitch of the rig's own board"
    return [("scale sigma", known)]
