"""``fringeworks advise``: what to take next, from a few test frames."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.arguments import GroupOption, require_positive
from fringeworks.cli.output import JsonFlag, Output, percent
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.diagnose.advice import Advice


def advise(
    capture: Annotated[
        Path, typer.Argument(help="Folder with capture.toml and frames of `patterns test`.")
    ],
    exposure_ms: Annotated[
        float | None,
        typer.Option(
            "--exposure-ms", metavar="MS", help="Of the test frames, if capture.toml has none."
        ),
    ] = None,
    mains_hz: Annotated[
        float, typer.Option("--mains-hz", metavar="HZ", help="Frequency of the mains: 50 or 60.")
    ] = 50.0,
    sigma_px: Annotated[
        float,
        typer.Option(
            "--sigma-px", metavar="PX", help="Noise of a projector coordinate to keep, 1 sd."
        ),
    ] = 0.02,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", help="rig.json to keep the blur in: `patterns --rig` uses it."),
    ] = None,
    group: GroupOption = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw blur and exposures into this folder."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="HTML", help="Write all of it as a page.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Propose exposures, fringe period and steps, and say what to change before.

    Any capture with fringes will do; `fringeworks patterns test` has the frames made for this. The
    next command lines are printed as they can be typed.
    """
    require_positive("--exposure-ms", 1.0 if exposure_ms is None else exposure_ms)
    require_positive("--sigma-px", sigma_px)
    if not 10 <= mains_hz <= 500:
        raise UsageError(f"--mains-hz must be 10 to 500 Hz, got {mains_hz:g}")
    output = Output(as_json=as_json)
    from fringeworks.diagnose.advice import advise as find_advice
    from fringeworks.files import read_capture, read_rig, write_rig
    from fringeworks.files.blur import rig_with_blur
    from fringeworks.report.advice import save_advice, summarise_advice, write_advice_page

    with output.working() as progress:
        known = None if rig is None else read_rig(rig)
        read = read_capture(capture, group=group, progress=progress)
        output.findings(read.name, read.findings)
        found = find_advice(
            read, group=group, exposure_ms=exposure_ms, mains_hz=mains_hz, wanted_px=sigma_px
        )
        if rig is not None and known is not None and found.blurs:
            sigmas = {axis: blur.sigma_px for axis, blur in found.blurs.items()}
            write_rig(rig, rig_with_blur(known, sigmas))
        drawn = [] if figures is None else save_advice(found, figures)
        pages = [] if report is None else [write_advice_page(report, found)]
    _describe(output, found)
    if rig is not None and found.blurs:
        output.line(f"blur kept in {rig}")
    output.written(drawn)
    output.written(pages)
    output.result(
        {**summarise_advice(found), "rig": rig, "figures": drawn, "report": report}
        | {"findings": [str(finding) for finding in read.findings]}
    )


def _describe(output: Output, found: Advice) -> None:
    from fringeworks.report.advice import commands_of, proposals_of

    output.line(f"{found.name}: {percent(found.ladder.covered_before)} of the lit pixels well seen")
    output.facts([(item.name, f"{item.value}; {item.reason}") for item in proposals_of(found)])
    for complaint in found.complaints:
        output.line(f"  change: {complaint.name}, {complaint.where}")
        output.line(f"    {complaint.message}")
        output.line(f"    {complaint.remedy}")
    output.line("next:")
    for command in commands_of(found):
        output.line(f"  {command}")
