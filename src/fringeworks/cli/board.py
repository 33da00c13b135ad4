"""``fringeworks board``: a calibration target to print, and its ``board.toml``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.model import Target

Kind = Literal["checkerboard", "charuco", "circles"]

PAPERS_MM = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}

MARKER_SHARE, DIAMETER_SHARE = 0.7, 0.5
DICTIONARY = "DICT_5X5_250"


def board(
    kind: Annotated[Kind, typer.Argument(help="What to print.")],
    columns: Annotated[
        int, typer.Option("--columns", min=3, max=1000, help="Inner corners, or circles, along x.")
    ],
    rows: Annotated[int, typer.Option("--rows", min=3, max=1000, help="The same along y.")],
    square: Annotated[
        float, typer.Option("--square-mm", help="Side of a square, or from circle to circle.")
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE.pdf", help="The page; board.toml goes beside it.")
    ],
    marker: Annotated[
        float | None,
        typer.Option("--marker-mm", help="Side of a ChArUco marker [default: 0.7 squares]."),
    ] = None,
    dictionary: Annotated[
        str | None,
        typer.Option(
            "--dictionary", help=f"OpenCV's dictionary of ChArUco markers [default: {DICTIONARY}]."
        ),
    ] = None,
    diameter: Annotated[
        float | None,
        typer.Option("--diameter-mm", help="Of a circle [default: half of --square-mm]."),
    ] = None,
    paper: Annotated[
        str, typer.Option("--paper", metavar="NAME|WxH", help="a4, a3, letter, or mm as 600x400.")
    ] = "a4",
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a page and a board.toml that are there.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Print a calibration target at true size, with bars that tell what the printer made of it.

    Print the page at 100 %, measure both bars and write the pitch into the board.toml beside it:
    its error is the error of every length that the rig measures.
    """
    output = Output(as_json=as_json)
    sheet = parse_paper(paper)
    if out.suffix.lower() != ".pdf":
        raise UsageError(f"--out must end in .pdf, got '{out}'")
    description = out.with_name("board.toml")
    for path in (out, description):
        if path.exists() and not overwrite:
            raise UsageError(f"{path} is there already: choose another --out, or --overwrite")
    _refuse_foreign(kind, marker=marker, dictionary=dictionary, diameter=diameter)
    from fringeworks.files import write_board
    from fringeworks.report.board import Paper, place_target, target_figure, write_page

    target = _target(kind, (columns, rows), square, sizes=(marker, diameter), dictionary=dictionary)
    sheet_of_paper = Paper(*sheet, name=paper)
    place = place_target(target, sheet_of_paper)
    page = target_figure(target, sheet_of_paper)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_board(description, target)
    write_page(page, out)
    along, down = place.bars_mm
    output.line(f"{kind}, {columns} x {rows} of {square:g} mm on {place.paper}")
    output.line(f"print it at 100 %, measure the bars of {along:g} mm (x) and {down:g} mm (y)")
    output.line(f"wrote {out} and {description}")
    output.result({"out": out, "board": description, "bars_mm": [along, down]})


def parse_paper(text: str) -> tuple[float, float]:
    """``a4`` or ``600x400``: width and height, mm."""
    match = re.fullmatch(r"(\d{2,4}(?:\.\d+)?)\s*[xX×]\s*(\d{2,4}(?:\.\d+)?)", text.strip())
    if match is not None:
        return float(match[1]), float(match[2])
    if text.lower() not in PAPERS_MM:
        names = ", ".join(PAPERS_MM)
        raise UsageError(f"--paper must be {names}, or WIDTHxHEIGHT in mm, got '{text}'")
    return PAPERS_MM[text.lower()]


def _refuse_foreign(
    kind: Kind, *, marker: float | None, dictionary: str | None, diameter: float | None
) -> None:
    for option, value, owner in (
        ("--marker-mm", marker, "charuco"),
        ("--dictionary", dictionary, "charuco"),
        ("--diameter-mm", diameter, "circles"),
    ):
        if value is not None and kind != owner:
            raise UsageError(f"{option} is for {owner}, not for {kind}")


def _target(
    kind: Kind,
    counts: tuple[int, int],
    square: float,
    *,
    sizes: tuple[float | None, float | None],
    dictionary: str | None,
) -> Target:
    from fringeworks.model import CharucoTarget, CheckerboardTarget, CirclesTarget

    marker, diameter = sizes
    if kind == "charuco":
        side = round(MARKER_SHARE * square, 2) if marker is None else marker
        return CharucoTarget(*counts, square, square, side, dictionary or DICTIONARY)
    if kind == "circles":
        size = DIAMETER_SHARE * square if diameter is None else diameter
        return CirclesTarget(*counts, square, square, size)
    return CheckerboardTarget(*counts, square, square)
