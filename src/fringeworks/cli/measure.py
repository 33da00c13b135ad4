"""``fringeworks measure``: numbers from a cloud."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.arguments import parse_ranges
from fringeworks.cli.form_words import FACTS
from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.geometry.forms.named import FormFit, FormName
    from fringeworks.measure.region import Region
    from fringeworks.model import Cloud

measure = typer.Typer(
    name="measure",
    no_args_is_help=True,
    short_help="Numbers from a cloud: forms and sections.",
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

WeightedFlag = Annotated[
    bool,
    typer.Option(
        "--weighted", help="Weigh points by their random sigma along the normal, if it is known."
    ),
]
RobustFlag = Annotated[
    bool,
    typer.Option(
        "--robust", help="Leave out what is not on the largest such form, by a random search."
    ),
]
FiguresOption = Annotated[
    Path | None, typer.Option("--figures", metavar="DIR", help="Draw what was measured here.")
]


@measure.callback()
def forms() -> None:
    """Measure forms and sections of a cloud: numbers with units."""


@measure.command(
    epilog="Example: fringeworks measure plane cloud.npz --box=-100:100,-50:50,700:900. An empty "
    "end is open: --box :,:,700:900"
)
def plane(
    cloud: CloudArgument,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    weighted: WeightedFlag = False,
    robust: RobustFlag = False,
    figures: FiguresOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a plane by orthogonal least squares: normal, offset, and how flat it is, mm.

    flatness is the range of all distances, band95 the width that holds 95 % of them, form rms
    their root mean square; no point is left out unless by --robust.
    """
    asked = _read(cloud, box, pixels, robust="plane" if robust else None)
    _measure("plane", asked, weighted=weighted, figures=figures, as_json=as_json)


@measure.command(
    epilog="Example: fringeworks measure sphere cloud.npz --box=-30:30,-30:30,600:650. An empty "
    "end is open: --box :,:,600:650"
)
def sphere(
    cloud: CloudArgument,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    weighted: WeightedFlag = False,
    robust: RobustFlag = False,
    figures: FiguresOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a sphere by orthogonal least squares: centre, radius, and how round it is, mm.

    The radius has two standard deviations: from what is left of the points, and, where the rig
    knows it, from the pitch of the board that it was calibrated with. Range is that of all
    distances, band95 the width that holds 95 % of them, form rms their root mean square. No point
    is left out unless by --robust: a box that also holds a wall gives a wrong sphere.
    """
    asked = _read(cloud, box, pixels, robust="sphere" if robust else None)
    _measure("sphere", asked, weighted=weighted, figures=figures, as_json=as_json)


@measure.command(
    epilog="Example: fringeworks measure cylinder cloud.npz --box=-60:60,-80:80,600:660. An empty "
    "end is open: --box :,:,600:660"
)
def cylinder(
    cloud: CloudArgument,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    weighted: WeightedFlag = False,
    robust: RobustFlag = False,
    figures: FiguresOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a cylinder by orthogonal least squares: axis, radius, and how round it is, mm.

    The axis is given by its point next to the points' centroid and its direction. The radius has
    two standard deviations: from what is left of the points, and, where the rig knows it, from the
    pitch of the board that it was calibrated with. Range is that of all distances, band95 the width
    that holds 95 % of them, form rms their root mean square. No point is left out unless by
    --robust: a box that also holds a wall gives a wrong cylinder.
    """
    asked = _read(cloud, box, pixels, robust="cylinder" if robust else None)
    _measure("cylinder", asked, weighted=weighted, figures=figures, as_json=as_json)


@measure.command(
    epilog="Example: fringeworks measure cone cloud.npz --box=-60:60,-80:80,600:660. An empty "
    "end is open: --box :,:,600:660"
)
def cone(
    cloud: CloudArgument,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    weighted: WeightedFlag = False,
    robust: RobustFlag = False,
    figures: FiguresOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a cone by orthogonal least squares: apex, axis, half angle, and how round it is.

    The axis runs from the apex into the cone; the half angle lies between axis and surface. Every
    standard deviation is from what is left of the points. Range is that of all distances, band95
    the width that holds 95 % of them, form rms their root mean square, mm. No point is left out
    unless by --robust: a box that also holds a wall gives a wrong cone.
    """
    asked = _read(cloud, box, pixels, robust="cone" if robust else None)
    _measure("cone", asked, weighted=weighted, figures=figures, as_json=as_json)


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is to be measured, and how many of the region's points a search left out of it."""

    path: Path
    cloud: Cloud
    region: Region
    left_out: int | None


def _read(cloud: Path, box: str | None, pixels: str | None, *, robust: FormName | None) -> _Asked:
    """The part of a cloud that the options choose; of it only the largest form, if one is named."""
    read, region = read_region(cloud, box, pixels)
    if robust is None:
        return _Asked(cloud, read, region, None)
    import numpy as np

    from fringeworks.measure.found import keep_largest
    from fringeworks.measure.region import chosen_pixels

    kept = keep_largest(read, region, robust, rng=np.random.default_rng(0))
    left_out = np.count_nonzero(chosen_pixels(read, region)) - np.count_nonzero(kept.valid)
    return _Asked(cloud, kept, region, int(left_out))


def _measure(
    form: FormName, asked: _Asked, *, weighted: bool, figures: Path | None, as_json: bool
) -> None:
    """Fit a form, say what was found, and draw it if that was asked for."""
    from fringeworks import pipeline
    from fringeworks.report.summary import summarise_form

    verbs: dict[FormName, Callable[..., FormFit]] = {
        "plane": pipeline.measure_plane,
        "sphere": pipeline.measure_sphere,
        "cylinder": pipeline.measure_cylinder,
        "cone": pipeline.measure_cone,
    }
    fit = verbs[form](asked.cloud, asked.region, weighted=weighted)
    found, drawn = summarise_form(fit, asked.cloud.scale_sigma), []
    if figures is not None:
        from fringeworks.report.forms import save_form

        drawn = save_form(asked.cloud, asked.region, fit, figures)
    output = Output(as_json=as_json)
    frame = asked.cloud.frame
    by = ", weighted" if weighted else ""
    output.line(f"{form} through {found['points']} points of {asked.path.name}, frame: {frame}{by}")
    facts = FACTS[form](found)
    if asked.left_out is not None:
        facts.append(("left out", f"{asked.left_out} points that do not lie on it"))
    output.facts(facts)
    output.written(drawn)
    output.result(
        found
        | {"weighted": weighted, "left_out": asked.left_out}
        | {"cloud": asked.path, "frame": frame, "figures": drawn}
    )


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
