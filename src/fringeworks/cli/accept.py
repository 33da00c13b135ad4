"""``fringeworks accept``: an acceptance test in the manner of VDI/VDE 2634-2."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.output import JsonFlag, Output, Progress, to_json
from fringeworks.cli.sequences import Preset
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.measure.acceptance import Certificate, Lot
    from fringeworks.measure.acceptance.certificate import Words


def accept(
    plan: Annotated[
        Path | None,
        typer.Argument(
            metavar="PLAN",
            help="plan.toml: artefacts, limits, and a cloud or a capture per position.",
        ),
    ] = None,
    twin: Annotated[
        bool,
        typer.Option("--twin", help="In place of a plan: the paper's rig on the digital twin."),
    ] = False,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", help="rig.json that scans the captures [default: the plan's]."),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            "--data",
            metavar="DIR",
            help="Folder of the plan's clouds and captures [default: its own].",
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the certificate.")
    ] = Path("out/accept"),
    preset: Annotated[
        Preset | None, typer.Option("--preset", help="What the twin projects [default: paper].")
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", metavar="N", min=0, help="Of the twin's noise.")
    ] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Only see whether the twin's test runs: few small positions."),
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Test a sensor on artefacts: ball 10 times (PF, PS), ball bar 7 (SD), flat 6 (F), mm.

    In the manner of VDI/VDE 2634-2: at most 3 per mille of a form's points are left out. Limits
    are shrunk by the test's own uncertainty before anything conforms (ISO 14253-1). Beside the
    ranges stand the width of 95 % of the points, what noise alone would make, and everyday words.
    Writes acceptance.html, acceptance.json and figures into --out. A test that fails ends with
    status 0 too: --json says outcome. The twin's rig and clouds are kept in --out, and a run that
    was cut off goes on.
    """
    _check(plan, twin=twin, of_plan=(rig, data), of_twin=(preset, seed, quick or None))
    output = Output(as_json=as_json)
    from fringeworks.experiments.acceptance import run_plan
    from fringeworks.files.acceptance import read_plan

    with output.working() as progress:
        if plan is None:
            plan = make_twin(out, preset or "paper", seed or 0, quick=quick, progress=progress)
        found = run_plan(read_plan(plan), data or plan.parent, rig=rig, progress=progress)
        written = write_certificate(found, out)
    output.findings(found.name, found.findings)
    describe(output, found)
    output.written(written)
    from fringeworks.report.acceptance import summarise_certificate

    output.result({**summarise_certificate(found), "plan": plan, "written": written})


def _check(
    plan: Path | None, *, twin: bool, of_plan: tuple[object, ...], of_twin: tuple[object, ...]
) -> None:
    if twin == (plan is not None):
        raise UsageError("give either a plan or --twin: fringeworks accept plan.toml")
    if twin and any(value is not None for value in of_plan):
        raise UsageError("--rig and --data belong to a plan; the twin makes its own")
    if not twin and any(value is not None for value in of_twin):
        raise UsageError("--preset, --seed and --quick belong to --twin")


def make_twin(out: Path, preset: Preset, seed: int, *, quick: bool, progress: Progress) -> Path:
    """The twin's plan, with rig and clouds beside it."""
    from fringeworks.experiments.acceptance_twin import prepare_twin

    return prepare_twin(out / "twin", preset=preset, seed=seed, quick=quick, progress=progress)


def write_certificate(found: Certificate, out: Path) -> list[Path]:
    """The page and the numbers; pictures in ``figures``."""
    from fringeworks.files.atomic import write_text
    from fringeworks.report.acceptance import summarise_certificate
    from fringeworks.report.acceptance_page import make_acceptance_page
    from fringeworks.report.page import write_page

    numbers = out / "acceptance.json"
    plain = to_json(summarise_certificate(found))
    write_text(numbers, json.dumps(plain, indent=2, allow_nan=False) + "\n")
    page = make_acceptance_page(found, figures=out / "figures")
    return [write_page(out / "acceptance.html", page), numbers]


def describe(output: Output, found: Certificate) -> None:
    """Print every quantity beside its limit, then the everyday words."""
    from fringeworks.report.acceptance import OUTCOME_WORDS

    output.line(f"{found.name}: {OUTCOME_WORDS[found.outcome]}")
    head = ("", "", "positions", "worst, mm", "at", "U, mm", "limit, mm", "")
    output.table(head, [_row(lot) for lot in found.lots], numbers=(2, 3, 5, 6))
    output.facts(_facts(found.words))


def _row(lot: Lot) -> tuple[str, ...]:
    from fringeworks.report.acceptance import MEANINGS, OUTCOME_WORDS

    worst, sign = lot.worst, "+" if lot.quantity in ("PS", "SD") else ""
    value = ("-", "-", "-")
    if worst is not None:
        value = (f"{worst.value_mm:{sign}.4f}", worst.name, f"{worst.u95_mm:.4f}")
    return (
        lot.quantity,
        MEANINGS[lot.quantity],
        f"{len(lot.counted)} of {lot.needed}",
        *value,
        "-" if lot.limit_mm is None else f"{lot.limit_mm:g}",
        OUTCOME_WORDS[lot.outcome],
    )


def _facts(words: Words) -> list[tuple[str, str]]:
    """Those that were measured."""
    lengths: list[tuple[str, float | None, str]] = [
        ("point precision", words.point_precision_mm, "1 sd of one point, across a flat"),
        ("local planarity", words.local_planarity_mm, "rms about patches a tenth of a flat wide"),
        ("global planarity", words.global_planarity_mm, "range of the patches' means, worst flat"),
    ]
    facts = [
        (name, f"{value:.4f} mm, {what}") for name, value, what in lengths if value is not None
    ]
    if words.dimension_trueness is not None:
        trueness = (
            f"{words.dimension_trueness:+.3%} at worst, {words.dimension_error_share:+.3%} mean"
        )
        facts.append(("dimension trueness", trueness))
    return facts
