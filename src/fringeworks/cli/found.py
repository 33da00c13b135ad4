"""``fringeworks measure auto``: which forms a cloud shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.measure import (
    BoxOption,
    CloudArgument,
    FiguresOption,
    PixelsOption,
    read_region,
)
from fringeworks.cli.output import JsonFlag, Output, percent
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.measure.found import FoundForms

LEAST_PERCENT = 3.0


def auto(
    cloud: CloudArgument,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            metavar="MM",
            help="How far points may lie off their form [default: four times the local noise].",
        ),
    ] = None,
    least: Annotated[
        float,
        typer.Option("--least", metavar="PERCENT", help="Share of all points that makes a form."),
    ] = LEAST_PERCENT,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", min=0, help="Seed of the random search.")
    ] = 0,
    figures: FiguresOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Find the planes, spheres, cylinders and cones in a cloud, and measure each of them.

    The cloud is split by a random search (RANSAC) that agrees in distance and in normal; what a
    simpler form fits about as well is the simpler form, and planes that continue each other are
    one. Each form is then fitted to all of its points by least squares. Points of no form, as
    those of a free-form surface, stay unnamed. --figures draws which points belong to which.
    """
    if not 0 < least <= 100:
        raise UsageError(f"--least must be a percentage above 0, got {least:g}")
    read, region = read_region(cloud, box, pixels)
    import numpy as np

    from fringeworks.measure.found import SearchRules, find_forms
    from fringeworks.measure.region import chosen_pixels, select_points

    rules = SearchRules(tolerance_mm=tolerance, least_share=least / 100)
    points = select_points(read, region)
    output = Output(as_json=as_json)
    with output.working():
        sigma = read.sigma_mm[chosen_pixels(read, region)].astype(np.float64)
        found = find_forms(points, rules=rules, sigma_mm=sigma, rng=np.random.default_rng(seed))
    drawn = []
    if figures is not None:
        from fringeworks.report.forms import save_found

        drawn = save_found(read, region, found, figures)
    forms = _summarise(found, read.scale_sigma)
    count = "1 form" if len(forms) == 1 else f"{len(forms)} forms"
    output.line(f"{count} in {len(points)} points of {cloud.name}, frame: {read.frame}")
    output.table(
        ("", "form", "", "points", "share", "form rms mm"), _rows(found), numbers=(3, 4, 5)
    )
    output.facts(
        [
            ("local noise", f"{found.noise_mm:.4f} mm"),
            ("tolerance", f"{found.tolerance_mm:.4f} mm" + ("" if tolerance else ", by the noise")),
            ("of no form", percent(float(np.mean(found.labels < 0)))),
        ]
    )
    output.written(drawn)
    output.result(
        {
            "forms": forms,
            "noise_mm": found.noise_mm,
            "tolerance_mm": found.tolerance_mm,
            "points": len(points),
            "cloud": cloud,
            "frame": read.frame,
            "figures": drawn,
        }
    )


def _summarise(found: FoundForms, scale_sigma: float | None) -> list[dict[str, Any]]:
    from fringeworks.report.summary import summarise_form

    return [
        {"form": form.name, "share": form.share, **summarise_form(form.fit, scale_sigma)}
        for form in found.forms
    ]


def _rows(found: FoundForms) -> list[tuple[str, ...]]:
    from fringeworks.report.forms import describe_form

    rows: list[tuple[str, ...]] = []
    for place, form in enumerate(found.forms, start=1):
        _, words = describe_form(form.fit).split(", ", maxsplit=1)
        count = len(form.fit.deviations_mm)
        rms = f"{form.fit.form_rms_mm:.4f}"
        rows.append((f"{place}", form.name, words, f"{count}", percent(form.share), rms))
    return rows
