"""``fringeworks bench``: speed and accuracy, next to the peers that are installed; studies."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.output import JsonFlag, Output, to_json
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.experiments.study import Study

MOST_SEEDS = 1000


def bench(
    study: Annotated[
        str | None,
        typer.Argument(
            metavar="[STUDY]",
            help="A study in place of the metrics: calibration, check, extended, models, orders, "
            "watch, zones. Minutes each; a second run of calibration, orders or models goes on "
            "where the first was cut off.",
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Only see whether it runs: its numbers mean nothing.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="GROUP", help="accuracy, speed or process; may repeat."),
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option("--seeds", min=1, max=MOST_SEEDS, help="How often a study is repeated."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for a study's table, figure and trials; out/STUDY unless told.",
        ),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Measure speed and accuracy, next to the peers that are installed.

    Ratios compare times taken in one run. `make bench` makes an environment with the peers. A
    study repeats a whole loop on the digital twin and tells what came of it, beside the peers.
    """
    output = Output(as_json=as_json)
    if study is not None:
        if only:
            raise UsageError("--only chooses metrics: leave it out for a study")
        if quick and seeds is not None:
            raise UsageError("--quick runs one trial of each kind: leave --seeds out")
        run_study(study, output, (out or Path("out") / study), seeds=seeds, quick=quick)
        return
    if seeds is not None or out is not None:
        raise UsageError("--seeds and --out belong to a study: fringeworks bench calibration")
    measure(output, quick=quick, only=only or None)


def measure(output: Output, *, quick: bool, only: list[str] | None) -> None:
    """All metrics, or those of the groups in `only`."""
    from fringeworks.bench.suite import run_suite

    with output.working() as progress:
        metrics = run_suite(quick=quick, only=only, progress=progress)
    output.table(
        ("metric", "value", "unit", "note"),
        [
            (item.key, "-" if item.value is None else f"{item.value:.4g}", item.unit, item.note)
            for item in metrics
        ],
        numbers=(1,),
    )
    output.result({"metrics": [asdict(item) for item in metrics]})


def run_study(name: str, output: Output, out: Path, *, seeds: int | None, quick: bool) -> None:
    """Make a study and write ``NAME.json`` and ``NAME.png`` into `out`."""
    from fringeworks.experiments.studies import named_study

    make = named_study(name)
    with output.working() as progress:
        made = make(out, seeds=seeds, quick=quick, progress=progress)
        paths = write_study(made, out, name)
    output.line(made.title)
    output.table(made.head, made.rows, numbers=range(1, len(made.head)))
    for note in made.notes:
        output.line(f"  {note}")
    output.written(paths)
    output.result({**describe_study(made), "written": paths})


def write_study(made: Study, out: Path, name: str) -> list[Path]:
    """The study's numbers and its picture."""
    from fringeworks.files.atomic import write_text
    from fringeworks.report.canvas import save_figure

    numbers = out / f"{name}.json"
    text = json.dumps(to_json(describe_study(made)), indent=2, allow_nan=False)
    write_text(numbers, text + "\n")
    return [numbers, save_figure(made.draw(), out / f"{name}.png")]


def describe_study(made: Study) -> dict[str, Any]:
    """Everything but the picture, in plain values."""
    rows = [dict(zip(made.head, row, strict=True)) for row in made.rows]
    return {"title": made.title, "table": rows, "notes": made.notes, **made.numbers}
