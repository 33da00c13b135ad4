"""``fringeworks measure``: numbers from a cloud."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from fringeworks.cli.arguments import parse_ranges
from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.measure.region import Region
    from fringeworks.model import Cloud

measure = typer.Typer(
    name="measure",
    no_args_is_help=True,
    short_help="Numbers from a cloud: plane, sphere, cylinder.",
)

BOX_FORM = "X0:X1,Y0:Y1,Z0:Z1"
PIXELS_FORM = "U0:U1,V0:V1"

CloudArgument = Annotated[Path, typer.Argument(help="Cloud: .npz, .ply or .xyz, mm.")]
BoxOption = Annotated[
    str | None,
    typer.Option("--box", metavar=BOX_FORM, help="Only points in this box, mm, cloud's frame."),
]
PixelsOption = Annotated[
    str | None,
    typer.Option(
        "--pixels",
        metavar=PIXELS_FORM,
        help="Only points of these camera columns and rows, px, ends included; .npz only.",
    ),
]

Values: TypeAlias = dict[str, Any]


@measure.callback()
def forms() -> None:
    """Measure a form in a cloud: numbers with units."""


@measure.command(
    epilog="Example: fringeworks measure plane cloud.npz --box=-100:100,-50:50,700:900. An empty "
    "end is open: --box :,:,700:900"
)
def plane(
    cloud: CloudArgument,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a plane by orthogonal least squares: normal, offset, and how flat it is, mm.

    flatness is the range of all distances, band95 the width that holds 95 % of them, form rms
    their root mean square; no point is left out.
    """
    read, region = read_region(cloud, box, pixels)
    from fringeworks.pipeline import measure_plane
    from fringeworks.report.summary import summarise_plane

    found = summarise_plane(measure_plane(read, region), read.scale_sigma)
    facts = [
        ("normal", _numbers(found["normal"], digits=6)),
        ("offset", f"{found['offset_mm']:.4f} mm"),
        *_scale("offset", found),
        *_spread(found),
        ("flatness", f"{found['flatness_mm']:.4f} mm"),
    ]
    _tell("plane", {**found, "cloud": cloud, "frame": read.frame}, facts, as_json=as_json)


@measure.command(
    epilog="Example: fringeworks measure sphere cloud.npz --box=-30:30,-30:30,600:650. An empty "
    "end is open: --box :,:,600:650"
)
def sphere(
    cloud: CloudArgument,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a sphere by orthogonal least squares: centre, radius, and how round it is, mm.

    The radius has two standard deviations: from what is left of the points, and, where the rig
    knows it, from the pitch of the board that it was calibrated with. Range is that of all
    distances, band95 the width that holds 95 % of them, form rms their root mean square. No point
    is left out: a box that also holds a wall gives a wrong sphere.
    """
    read, region = read_region(cloud, box, pixels)
    from fringeworks.pipeline import measure_sphere
    from fringeworks.report.summary import summarise_sphere

    found = summarise_sphere(measure_sphere(read, region), read.scale_sigma)
    facts = [("centre", _numbers(found["centre_mm"], digits=4) + " mm"), *_radius(found)]
    _tell("sphere", {**found, "cloud": cloud, "frame": read.frame}, facts, as_json=as_json)


@measure.command(
    epilog="Example: fringeworks measure cylinder cloud.npz --box=-60:60,-80:80,600:660. An empty "
    "end is open: --box :,:,600:660"
)
def cylinder(
    cloud: CloudArgument,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a cylinder by orthogonal least squares: axis, radius, and how round it is, mm.

    The axis is given by its point next to the points' centroid and its direction. The radius has
    two standard deviations: from what is left of the points, and, where the rig knows it, from the
    pitch of the board that it was calibrated with. Range is that of all distances, band95 the width
    that holds 95 % of them, form rms their root mean square. No point is left out: a box that also
    holds a wall gives a wrong cylinder.
    """
    read, region = read_region(cloud, box, pixels)
    from fringeworks.pipeline import measure_cylinder
    from fringeworks.report.summary import summarise_cylinder

    found = summarise_cylinder(measure_cylinder(read, region), read.scale_sigma)
    facts = [
        ("axis point", _numbers(found["axis_point_mm"], digits=4) + " mm"),
        ("axis direction", _numbers(found["axis_direction"], digits=6)),
        *_radius(found),
    ]
    _tell("cylinder", {**found, "cloud": cloud, "frame": read.frame}, facts, as_json=as_json)


def read_region(cloud: Path, box: str | None, pixels: str | None) -> tuple[Cloud, Region]:
    """The cloud and the part of it that the options choose.

    Raises
    ------
    UsageError
        Options that are no ranges, or pixels of a cloud that has no grid.
    """
    ranges = None if box is None else parse_ranges(box, option="--box", form=BOX_FORM)
    window = None if pixels is None else parse_ranges(pixels, option="--pixels", form=PIXELS_FORM)
    if window is not None and cloud.suffix.lower() != ".npz":
        raise UsageError(f"--pixels needs a cloud on the camera's grid, .npz, got '{cloud.name}'")
    from fringeworks.files import read_cloud
    from fringeworks.measure.region import Region

    region = Region(
        box_mm=None if ranges is None else (ranges[0], ranges[1], ranges[2]),
        pixels=None if window is None else (window[0], window[1]),
    )
    return read_cloud(cloud), region


def _radius(found: Values) -> list[tuple[str, str]]:
    sigma = f"{found['radius_sigma_mm']:.2g} mm by the points' scatter, each on its own"
    return [
        ("radius", f"{found['radius_mm']:.4f} mm"),
        ("radius sigma", sigma),
        *_scale("radius", found),
        *_spread(found),
        ("range", f"{found['range_mm']:.4f} mm"),
    ]


def _scale(length: str, found: Values) -> list[tuple[str, str]]:
    """What the calibration board's pitch adds to the length's uncertainty, if that is known."""
    sigma = found[f"{length}_scale_sigma_mm"]
    if sigma is None:
        return []
    return [(f"{length} scale sigma", f"{sigma:.2g} mm by the calibration board's pitch")]


def _spread(found: Values) -> list[tuple[str, str]]:
    return [
        ("form rms", f"{found['form_rms_mm']:.4f} mm"),
        ("band95", f"{found['band95_mm']:.4f} mm"),
    ]


def _numbers(values: Iterable[float], *, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)


def _tell(form: str, found: Values, facts: Iterable[tuple[str, str]], *, as_json: bool) -> None:
    output = Output(as_json=as_json)
    cloud, frame = found["cloud"].name, found["frame"]
    output.line(f"{form} through {found['points']} points of {cloud}, frame: {frame}")
    output.facts(facts)
    output.result(found)
