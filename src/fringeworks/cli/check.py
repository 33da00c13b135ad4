"""``fringeworks check``: what is wrong with a capture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.arguments import GroupOption
from fringeworks.cli.output import JsonFlag, Output

if TYPE_CHECKING:
    from fringeworks.diagnose import Diagnosis


def check(
    capture: Annotated[Path, typer.Argument(help="Folder with capture.toml and its images.")],
    rig: Annotated[
        Path | None,
        typer.Option("--rig", help="rig.json: costs in mm, and epipolar lines are checked."),
    ] = None,
    group: GroupOption = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw each finding into this folder."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="HTML", help="Write all of it as a page.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Tell what is wrong with a capture, the costliest fault first, and what to do about it.

    Looked for are saturation, darkness, ambient light, flicker and drift of the light, motion,
    frames out of order, missing or repeated, wrong shifts, inverted or swapped Gray bits, the
    Gray code's margin, gamma, blur, light by way of other surfaces, and with --rig points off
    their epipolar lines. Costs are errors of depth (mm) with --rig, else of the projector
    coordinate (px); a pixel that is lost counts as known to a period alone. A capture with faults
    ends with status 0 too: --json says clean true or false.
    """
    output = Output(as_json=as_json)
    from fringeworks.diagnose import check_capture
    from fringeworks.files import read_capture, read_rig
    from fringeworks.report.check import (
        save_diagnosis,
        summarise_diagnosis,
        write_diagnosis_page,
    )

    with output.working() as progress:
        known = None if rig is None else read_rig(rig)
        read = read_capture(capture, group=group, progress=progress)
        output.findings(read.name, read.findings)
        found = check_capture(read, known, group=group)
        drawn = [] if figures is None else save_diagnosis(found, figures)
        pages = [] if report is None else [write_diagnosis_page(report, found)]
    _describe(output, found)
    output.written(drawn)
    output.written(pages)
    output.result({**summarise_diagnosis(found), "figures": drawn, "report": report})


def _describe(output: Output, found: Diagnosis) -> None:
    from fringeworks.report.findings import cost_words

    count = len(found.found)
    faults = f"{count} fault{'s' if count > 1 else ''}, the costliest first"
    output.line(f"{found.name}: {faults if count else 'nothing wrong was found'}")
    for finding in found.findings:
        output.line(f"  {finding.name} ({cost_words(finding)}), {finding.where}")
        output.line(f"    {finding.message}")
        output.line(f"    {finding.remedy}")
    for reason in found.unseen:
        output.line(f"  not looked for: {reason}")
