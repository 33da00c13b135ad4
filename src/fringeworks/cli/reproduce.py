"""``fringeworks reproduce``: the paper on the digital twin, end to end, beside its numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.output import JsonFlag, Output, to_json

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fringeworks.experiments.paper.chapter import Chapter


def reproduce(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for captures and results.")
    ] = Path("out/reproduce"),
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Fewer poses, rigs and repeats: under a minute, for a look."),
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Repeat the paper's experiments on the digital twin, each number beside the paper's.

    Its figures 1 to 14 and Table 1; single objects by three fringes alone; cylinder, hand and two
    isolated objects by its equations and by the full model; the speckle sensor; thirty rigs as poor
    as its own; the claims of its conclusion. Writes report.html, reproduction.json,
    reproduction.md, comparison.md (the rows that the paper has a number for), figures and the
    captures, which a second run uses again.
    """
    output = Output(as_json=as_json)
    with output.working() as progress:
        from fringeworks.experiments.paper.page import plain_values
        from fringeworks.experiments.paper.reproduce import reproduce as run

        chapters = run(out / "captures", quick=quick, progress=progress)
        values = {"out": out, "quick": quick, "chapters": plain_values(chapters)}
        paths = write_results(out, chapters, values)
    describe(output, chapters)
    output.written(paths)
    output.result({**values, "written": paths})


def write_results(
    out: Path, chapters: Mapping[str, Chapter], values: Mapping[str, object]
) -> list[Path]:
    """``report.html``, ``reproduction.json``, two tables as Markdown; figures beside them."""
    from dataclasses import replace

    from fringeworks.experiments.paper.page import compare_to_paper, make_page, write_markdown
    from fringeworks.files.atomic import write_text
    from fringeworks.report.page import write_page

    plain = {name: replace(one, numbers=to_json(one.numbers)) for name, one in chapters.items()}
    page = write_page(out / "report.html", make_page(plain, figures=out / "figures"))
    numbers, words = out / "reproduction.json", out / "reproduction.md"
    beside = out / "comparison.md"
    write_text(numbers, json.dumps(to_json(values), indent=2, allow_nan=False) + "\n")
    write_text(words, write_markdown(chapters))
    write_text(beside, compare_to_paper(chapters) + "\n")
    return [page, numbers, words, beside]


def describe(output: Output, chapters: Mapping[str, Chapter]) -> None:
    """Print the rows chapter by chapter."""
    for one in chapters.values():
        output.line(one.heading)
        rows = [(row.quantity, row.paper, row.ours, row.note) for row in one.rows]
        output.table(("", "paper", "ours", ""), rows, numbers=(1, 2))
