"""``fringeworks response``: what lies between a level shown and a grey level seen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fringeworks.cli.arguments import GroupOption
from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.model import GreyCurve, Response

WayName = Literal["auto", "levels", "gray", "steps", "plane", "periods"]

ResponseOption = Annotated[
    Path | None,
    typer.Option(
        "--response",
        metavar="FILE",
        help="response.json: taken from images or phases before anything else.",
    ),
]
CurveOption = Annotated[
    Path | None,
    typer.Option(
        "--response",
        metavar="FILE",
        help="response.json with a curve of grey levels: patterns are pre-distorted by it.",
    ),
]


def response(
    capture: Annotated[Path, typer.Argument(help="Folder with capture.toml and its images.")],
    out: Annotated[Path, typer.Option("--out", help="File to write: response.json.")],
    way: Annotated[
        WayName,
        typer.Option(
            "--way",
            help="levels: frames of `patterns response`; steps: against fringes of twice the "
            "steps; gray: against a Gray code of small cells; periods: two periods of one scan "
            "against each other; plane: the scene is one flat or smooth surface. auto takes the "
            "first of them that the capture has, never plane.",
        ),
    ] = "auto",
    exponent: Annotated[
        bool,
        typer.Option(
            "--exponent",
            help="One exponent for the images in place of terms for the phase (gray and steps).",
        ),
    ] = False,
    group: GroupOption = None,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", help="rig.json to keep the response in too: scans then use it."),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw the response into this folder."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Find the response of projector and camera: gamma, and the harmonics that it makes.

    Grey levels give a curve: `patterns --response` then shows light and not levels, which holds
    at any depth. The other ways give the error of the phase, which decode and scan take away with
    --response; it holds for the same fringes, and for the blur at which it was found.
    """
    output = Output(as_json=as_json)
    from fringeworks.files import read_capture, read_rig, write_response, write_rig
    from fringeworks.files.response import describe_response, rig_with_response
    from fringeworks.phase.response_fit.find import find_response

    with output.working() as progress:
        known = None if rig is None else read_rig(rig)
        read = read_capture(capture, group=group, progress=progress)
        output.findings(read.name, read.findings)
        found = find_response(read, way=way, exponent=exponent, group=group)
        if known is not None:
            _check_size(found, known.projector.width, known.projector.height)
        write_response(out, found)
        if rig is not None and known is not None:
            write_rig(rig, rig_with_response(known, found))
        drawn: list[Path] = []
        if figures is not None:
            from fringeworks.report.response import save_response

            drawn = save_response(found, figures)
    output.line(f"{found.source}: {found.kind}, found by {found.way}")
    output.facts(_facts(found))
    output.written([out])
    if rig is not None:
        output.line(f"kept in {rig}")
    output.written(drawn)
    output.result(
        {"capture": read.name, "out": out, "rig": rig, "response": describe_response(found)}
        | {"figures": drawn, "findings": [str(finding) for finding in read.findings]}
    )


def _facts(found: Response) -> list[tuple[str, str]]:
    from fringeworks.model import GreyCurve, ImageExponent

    match found.correction:
        case GreyCurve() as curve:
            second, third = curve.harmonics
            left = curve.left
            return [
                ("levels", str(len(curve.levels))),
                ("harmonics", f"a2/a1 {second:.4f}, a3/a1 {third:.4f}"),
                ("left by every other level", f"a2/a1 {left[0]:.4f}, a3/a1 {left[1]:.4f}"),
                ("regions differ by", f"{curve.uneven:.2%} of white at most"),
            ]
        case ImageExponent() as power:
            before, after = power.before_rad, power.after_rad
            return [("error of the phase", f"{before:.3f} rad rms, {after:.3f} with it")]
        case terms:
            return [
                (
                    f"{item.period_px:.4g} px along {item.axis}, {item.steps} steps",
                    f"{item.before:.3f} -> {item.after:.3f} {_UNITS[item.unit]}",
                )
                for item in terms
            ]


_UNITS = {"rad": "rad, rms error", "px": "px, median disagreement"}


def read_asked(path: Path | None) -> Response | None:
    """The response of an option, if it was given."""
    from fringeworks.files import read_response

    return None if path is None else read_response(path)


def _check_size(found: Response, width: int, height: int) -> None:
    why = found.elsewhere(width, height)
    if why is not None:
        raise UsageError(why)


def read_curve(
    path: Path | None, *, width: int, height: int
) -> tuple[GreyCurve | None, dict[str, str]]:
    """The curve that pre-distorts a projector's patterns, and what their provenance says of it.

    Raises
    ------
    UsageError
        The file holds no curve of grey levels, another projector's, or one of bent patterns.
    """
    from fringeworks.model import GreyCurve
    from fringeworks.phase.response import PREDISTORTED

    found = read_asked(path)
    if found is None:
        return None, {}
    if not isinstance(found.correction, GreyCurve):
        raise UsageError(
            f"{path} holds {found.kind}: patterns are pre-distorted by a curve of grey levels "
            "(`fringeworks response --way levels`)"
        )
    if found.predistorted_by is not None:
        raise UsageError(
            f"{path} was found with patterns pre-distorted by {found.predistorted_by}: it says "
            "what those leave; patterns are pre-distorted by a curve of plain ones"
        )
    _check_size(found, width, height)
    return found.correction, {PREDISTORTED: f"the response of {found.source}"}


def summarise_used(used: Response | None) -> dict[str, Any] | None:
    """What a command's ``--json`` says of the response that it used."""
    return None if used is None else {"kind": used.kind, "way": used.way, "source": used.source}
