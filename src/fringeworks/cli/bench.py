"""``fringeworks bench``: speed and accuracy, next to the peers that are installed."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from fringeworks.cli.output import JsonFlag, Output


def bench(
    quick: Annotated[
        bool, typer.Option("--quick", help="Only see whether it runs: its numbers mean nothing.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="GROUP", help="accuracy, speed or process; may repeat."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Measure speed and accuracy, next to the peers that are installed.

    Ratios compare times taken in one run. `make bench` makes an environment with the peers.
    """
    output = Output(as_json=as_json)
    from fringeworks.bench.suite import run_suite

    with output.working() as progress:
        metrics = run_suite(quick=quick, only=only or None, progress=progress)
    output.table(
        ("metric", "value", "unit", "note"),
        [
            (item.key, "-" if item.value is None else f"{item.value:.4g}", item.unit, item.note)
            for item in metrics
        ],
        numbers=(1,),
    )
    output.result({"metrics": [asdict(item) for item in metrics]})
