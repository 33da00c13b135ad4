"""``fringeworks measure section``: a cut through a cloud, or radii of many along an axis."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.arguments import parse_numbers, parse_ranges
from fringeworks.cli.measure import (
    BoxOption,
    CloudArgument,
    FiguresOption,
    PixelsOption,
    read_region,
)
from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import MeasurementError, UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fringeworks.geometry.forms.circle import CircleFit
    from fringeworks.measure.region import Region
    from fringeworks.measure.section import RadiusSeries, Section, Slicer
    from fringeworks.model import Cloud

    Direction = tuple[NDArray[np.float64], float]

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
RANGE_FORM = "MIN:MAX"
MOST_SECTIONS = 10_000


def section(
    cloud: CloudArgument,
    along: Annotated[
        str,
        typer.Option(
            "--along",
            metavar="DIRECTION",
            help="What the planes cut across: x, y, z, NX,NY,NZ, or cylinder: the fitted axis.",
        ),
    ] = "cylinder",
    at: Annotated[
        float | None,
        typer.Option("--at", metavar="MM", help="Where to cut [default: through the centroid]."),
    ] = None,
    span: Annotated[
        str | None,
        typer.Option("--range", metavar=RANGE_FORM, help="Many sections, from here to there, mm."),
    ] = None,
    step: Annotated[
        float, typer.Option("--step", metavar="MM", help="With --range: between two sections.")
    ] = 1.0,
    thickness: Annotated[
        float | None,
        typer.Option(
            "--thickness", metavar="MM", help="Cut a slab: for clouds without the camera's grid."
        ),
    ] = None,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    figures: FiguresOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Cut a cloud by a plane: the curve, half its chord, and the radius of the arc through it, mm.

    half-chord is the paper's radius: half the distance of the section's end points A and B. It
    lacks what cannot be seen and has the noise of two points; the arc is fitted to all of them.
    --range makes a series of sections, with mean and standard deviation of both. Places are
    measured along the direction from the frame's origin; with --along cylinder from the centroid.
    """
    if at is not None and span is not None:
        raise UsageError("--at is for one section, --range for many: use one of them")
    places = None if span is None else _places(span, step)
    read, region = read_region(cloud, box, pixels)
    from fringeworks.measure.section import CutPlane, make_slicer, radius_series

    slicer = make_slicer(read, region, thickness_mm=thickness)
    normal, origin = _direction(along, read, region, slicer)
    output = Output(as_json=as_json)
    output.line(f"section of {cloud.name} across {along}, frame: {read.frame}")
    if places is not None:
        series = radius_series(slicer, normal, [origin + place for place in places])
        found = _tell_series(output, series, places, figures)
    else:
        middle = float((slicer.points @ normal).mean()) - origin
        place = middle if at is None else at
        cut = slicer.cut(CutPlane(normal, origin + place))
        found = {"at_mm": place, **_tell_section(output, cut, place, figures)}
    place_of = {"along": [float(value) for value in normal], "origin_mm": origin}
    output.result({**found, **place_of, "cloud": cloud, "frame": read.frame})


def _places(span: str, step: float) -> list[float]:
    """Where to cut, both ends included."""
    ((low, high),) = parse_ranges(span, option="--range", form=RANGE_FORM)
    if not (math.isfinite(low) and math.isfinite(high)):
        raise UsageError(f"--range must have both ends, {RANGE_FORM} in mm, got '{span}'")
    if not 0 < step < math.inf:
        raise UsageError(f"--step must be above 0 mm, got {step:g}")
    count = int((high - low) / step + 1e-9) + 1
    if count > MOST_SECTIONS:
        raise UsageError(f"--step {step:g} makes {count} sections, more than {MOST_SECTIONS}")
    return [low + place * step for place in range(count)]


def _direction(along: str, cloud: Cloud, region: Region, slicer: Slicer) -> Direction:
    """Normal of the planes, and where along it places begin to count, mm."""
    import numpy as np

    if along == "cylinder":
        from fringeworks.pipeline import measure_cylinder

        axis = measure_cylinder(cloud, region).axis_direction
        return axis, float((slicer.points @ axis).mean())
    if along in AXES:
        return np.array(AXES[along]), 0.0
    numbers = np.array(parse_numbers(along, option="--along"))
    length = float(np.linalg.norm(numbers))
    if len(numbers) != 3 or not 0 < length < math.inf:
        raise UsageError(f"--along must be x, y, z, cylinder or NX,NY,NZ, got '{along}'")
    return numbers / length, 0.0


def _tell_section(
    output: Output, cut: Section, place: float, figures: Path | None
) -> dict[str, Any]:
    """One section in words, and its values."""
    arc, reason = _arc_of(cut)
    a, b = cut.ends_mm.tolist()
    facts = [
        ("at", f"{place:.3f} mm, {len(cut.points_mm)} points"),
        ("end point A", " ".join(f"{value:.3f}" for value in a) + " mm"),
        ("end point B", " ".join(f"{value:.3f}" for value in b) + " mm"),
        ("half-chord", f"{cut.half_chord_mm:.4f} mm"),
    ]
    if arc is None:
        facts.append(("arc", f"none: {reason}"))
    else:
        facts.append(("arc radius", f"{arc.radius_mm:.4f} mm"))
        facts.append(("arc radius sigma", f"{arc.radius_sigma_mm:.2g} mm by the points' scatter"))
        facts.append(("arc form rms", f"{arc.form_rms_mm:.4f} mm"))
    output.facts(facts)
    drawn = []
    if figures is not None:
        from fringeworks.report.section import save_section

        drawn = save_section(cut, arc, figures)
        output.written(drawn)
    return {
        "points": len(cut.points_mm),
        "end_a_mm": a,
        "end_b_mm": b,
        "half_chord_mm": cut.half_chord_mm,
        "radius_mm": None if arc is None else arc.radius_mm,
        "radius_sigma_mm": None if arc is None else arc.radius_sigma_mm,
        "form_rms_mm": None if arc is None else arc.form_rms_mm,
        "figures": drawn,
    }


def _arc_of(cut: Section) -> tuple[CircleFit | None, str]:
    """The arc, or why there is none."""
    try:
        return cut.fit_arc(), ""
    except MeasurementError as error:
        return None, str(error)


def _tell_series(
    output: Output, series: RadiusSeries, places: list[float], figures: Path | None
) -> dict[str, Any]:
    """Many sections in words, and their values."""
    from dataclasses import replace

    import numpy as np

    shown = replace(series, at_mm=np.array(places))
    columns = {"half_chord": series.half_chord_mm, "radius": series.radius_mm}
    summary = {
        f"{name}_{what}_mm": value
        for name, values in columns.items()
        for what, value in (("mean", series.mean_mm(values)), ("sd", series.sd_mm(values)))
    }
    words = ("half-chord", "arc radius")
    output.facts(
        [
            ("sections", f"{series.measured} of {len(places)} from {places[0]:g} mm on"),
            *(
                (word, f"mean {series.mean_mm(values):.4f} mm, sd {series.sd_mm(values):.4f} mm")
                for word, values in zip(words, columns.values(), strict=True)
            ),
            ("arc radius sigma", f"{float(np.nanmedian(series.radius_sigma_mm)):.2g} mm, median"),
        ]
    )
    drawn = []
    if figures is not None:
        from fringeworks.report.section import save_series

        drawn = save_series(shown, figures)
        output.written(drawn)
    return {
        "sections": series.measured,
        **summary,
        "at_mm": places,
        "half_chord_mm": series.half_chord_mm.tolist(),
        "radius_mm": series.radius_mm.tolist(),
        "radius_sigma_mm": series.radius_sigma_mm.tolist(),
        "figures": drawn,
    }
