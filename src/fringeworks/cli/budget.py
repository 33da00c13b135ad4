"""``fringeworks budget``: where the uncertainty of a depth comes from, and how to plan a rig."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fringeworks.cli.arguments import Range, ZRangeOption, parse_ranges
from fringeworks.cli.output import JsonFlag, Output, percent
from fringeworks.cli.sequences import AxesOption, PeriodsOption, Preset, StepsOption, sequence_of
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from fringeworks.model import Rig
    from fringeworks.uncertainty.budget import Budget
    from fringeworks.uncertainty.contributions import Kind
    from fringeworks.uncertainty.planner import Choice

DEPTHS = 15
FARTHEST = 4.0
"""Depths go on to so many times the nearest, where a rig works at any distance."""

MOST_CHOICES = 8


def budget(
    rig: Annotated[str, typer.Option("--rig", metavar="RIG", help="rig.json, paper or warped.")],
    preset: Annotated[
        Preset, typer.Option("--preset", help="What is projected; see `fringeworks patterns`.")
    ] = "measure",
    axes: AxesOption = "xy",
    steps: StepsOption = None,
    periods: PeriodsOption = None,
    model: Annotated[
        Literal["geometric", "full"],
        typer.Option("--model", help="geometric: equation 1, which leaves distortion out."),
    ] = "full",
    sensor: Annotated[
        Path | None,
        typer.Option(
            "--sensor", help="sensor.toml: light, noise, gamma, blur [default: as for twin]."
        ),
    ] = None,
    z_range: ZRangeOption = None,
    plan: Annotated[
        str | None,
        typer.Option("--plan", metavar="MIN:MAX", help="Plan a rig for these depths, mm."),
    ] = None,
    sigma: Annotated[
        float | None, typer.Option("--sigma", metavar="MM", help="With --plan: wanted sigma of z.")
    ] = None,
    twin: Annotated[
        bool, typer.Option("--twin", help="Look at the noise of simulated images too.")
    ] = False,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", min=0, help="Seed of the Monte Carlo draws.")
    ] = 0,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Draw budget.png into this folder.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Tell what part of a depth's standard deviation comes from where, over depth, mm.

    Sources are in the paper's three classes: model, parameters (from the covariance that
    `calibrate` keeps in rig.json), phase (light, noise, gamma of a sensor.toml). Without --z-range
    the depths are the calibrated volume. --plan lists baseline, period and number of steps that
    reach --sigma over a range with this camera and projector.
    """
    output = Output(as_json=as_json)
    if (plan is None) != (sigma is None):
        raise UsageError("--plan and --sigma go together: --plan 500:900 --sigma 0.05")
    depths = None if z_range is None else _range(z_range, "--z-range")
    from fringeworks.files import read_sensor
    from fringeworks.files.named import find_rig
    from fringeworks.twin.effects import Effects

    known = find_rig(rig)
    effects = Effects() if sensor is None else read_sensor(sensor)
    if plan is not None and sigma is not None:
        from fringeworks.uncertainty.planner import plan as plan_rig

        wanted = _range(plan, "--plan")
        choices = plan_rig(known, wanted, sigma, effects=effects, axis="y" if axes == "y" else "x")
        _tell_plan(output, choices, wanted, sigma)
        return

    import numpy as np

    from fringeworks.report.budget import ends_and_middle, save_budget, summarise_budget
    from fringeworks.uncertainty.budget import finest_fringes, make_budget, sample_budget
    from fringeworks.uncertainty.contributions import Setting
    from fringeworks.uncertainty.seen import working_range

    sequence = sequence_of(
        preset,
        width=known.projector.width,
        height=known.projector.height,
        axes=axes,
        steps=steps,
        periods=periods,
        code=None,
        inverted=None,
        codewords=None,
    )
    setting = Setting(known, finest_fringes(sequence), effects, geometric=model == "geometric")
    works = working_range(known)
    ends = depths or known.volume_mm or (works[0], min(works[1], FARTHEST * works[0]))
    rng = np.random.default_rng(seed)
    with output.working():
        made = make_budget(setting, np.linspace(*ends, DEPTHS).tolist())
        three = [float(made.depths_mm[place]) for place in ends_and_middle(DEPTHS)]
        sampled = sample_budget(setting, three, rng=rng)
        images = None
        if twin:
            from fringeworks.experiments.budget_twin import sample_images

            images = sample_images(known, sequence, three, effects=effects, rng=rng)
        drawn = [] if out is None else [save_budget(made, out / "budget.png", sampled=sampled)]
    _tell_sources(output, made, sampled, images)
    _tell_rig(output, made, known, works)
    output.written(drawn)
    output.result(
        {"rig": rig, "model": model, **summarise_budget(made)}
        | {"monte_carlo_mm": {"depths_mm": three} | {k: v.tolist() for k, v in sampled.items()}}
        | {"images_mm": None if images is None else [values.tolist() for values in images]}
        | {"working_range_mm": list(works), "figures": drawn}
    )


def _range(text: str, option: str) -> Range:
    (found,) = parse_ranges(text, option=option, form="MIN:MAX")
    if not 0 < found[0] < found[1] < float("inf"):
        raise UsageError(f"{option} must rise from above 0, MIN:MAX in mm, got '{text}'")
    return found


def _row(kind: str, name: str, values: Iterable[float]) -> tuple[str, ...]:
    return (kind, name, *(f"{float(value):.4f}" for value in values))


def _tell_sources(
    output: Output,
    made: Budget,
    sampled: Mapping[Kind, NDArray[Any]],
    images: tuple[NDArray[Any], NDArray[Any]] | None,
) -> None:
    """Sources at near, middle and far, class by class."""
    from fringeworks.report.budget import ends_and_middle
    from fringeworks.uncertainty.budget import KINDS

    places, rows = ends_and_middle(len(made.depths_mm)), []
    for kind in KINDS:
        for one in (one for one in made.sources if one.kind == kind):
            name = one.name if one.counts else f"({one.name})"
            rows.append(_row(kind, name, one.sigma_mm[places]))
        if kind == "parameters" and made.scale_mm is not None:
            rows.append(_row(kind, "scale of the board", made.scale_mm[places]))
        rows.append(_row(kind, "together", made.of_kind(kind)[places]))
        if kind == "parameters" and made.aligned_mm is not None:
            rows.append(_row("", "of the form alone (aligned)", made.aligned_mm[places]))
        if kind in sampled and sampled[kind].any():
            rows.append(_row("", "by Monte Carlo", sampled[kind]))
        if kind == "phase" and images is not None:
            rows.append(_row("", "noise seen in simulated images", images[0]))
    rows.append(_row("all", "together", made.total_mm[places]))
    head = ("class", "sigma of z, mm, at z =", *(f"{made.depths_mm[p]:.0f} mm" for p in places))
    output.table(head, rows, numbers=(2, 3, 4))
    if made.parameters_mm is None:
        output.line("  the rig keeps no covariance: what its parameters leave open is not in it")


def _tell_rig(output: Output, made: Budget, rig: Rig, works: Range) -> None:
    """Resolution over depth, and where the rig works."""
    from fringeworks.report.budget import ends_and_middle

    places = ends_and_middle(len(made.depths_mm))
    rows = [
        ("camera pixel, mm", *(f"{made.camera_px_mm[p]:.3f}" for p in places)),
        ("one fringe of depth, mm", *(f"{made.fringe_mm[p]:.1f}" for p in places)),
        ("lit share of the image", *(percent(float(made.lit_share[p])) for p in places)),
    ]
    head = ("resolution at z =", *(f"{made.depths_mm[p]:.0f} mm" for p in places))
    output.table(head, rows, numbers=(1, 2, 3))
    output.facts(
        [
            ("baseline", f"{rig.baseline_mm:.1f} mm"),
            ("working range", f"{works[0]:.0f} to {works[1]:.0f} mm, by the overlap of the fields"),
        ]
    )


def _tell_plan(output: Output, choices: list[Choice], wanted: Range, sigma: float) -> None:
    """The best in words, some in a table, all in JSON."""
    best = choices[0]
    output.line(
        f"a baseline of {best.baseline_mm:.0f} mm with fringes of {best.period_px:g} px in "
        f"{best.steps} steps measures {wanted[0]:g} to {wanted[1]:g} mm with a sigma of z of "
        f"{best.sigma_mm[0]:.3g} mm near and {best.sigma_mm[1]:.3g} mm far (wanted {sigma:g} mm)"
    )
    rows = [
        (
            f"{one.baseline_mm:.0f}",
            f"{one.period_px:g}",
            f"{one.steps}",
            f"{one.sigma_mm[0]:.4f}",
            f"{one.sigma_mm[1]:.4f}",
            f"{min(one.lit_share):.0%}",
        )
        for one in choices[:MOST_CHOICES]
    ]
    head = ("baseline mm", "period px", "steps", "sigma near mm", "sigma far mm", "lit, least")
    output.table(head, rows, numbers=range(len(head)))
    if len(choices) > MOST_CHOICES:
        output.line(f"  and {len(choices) - MOST_CHOICES} more, which --json lists")
    listed = [asdict(choice) for choice in choices]
    output.result({"z_range_mm": list(wanted), "sigma_mm": sigma, "choices": listed})
