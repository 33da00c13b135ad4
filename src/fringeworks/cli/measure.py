"""``fringeworks measure``: numbers from a cloud."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fringeworks.cli.arguments import parse_ranges
from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import UsageError

measure = typer.Typer(
    name="measure", no_args_is_help=True, short_help="Numbers from a cloud: plane."
)

BOX_FORM = "X0:X1,Y0:Y1,Z0:Z1"
PIXELS_FORM = "U0:U1,V0:V1"


@measure.callback()
def forms() -> None:
    """Measure a form in a cloud: numbers with units."""


@measure.command(
    epilog="Example: fringeworks measure plane cloud.npz --box=-100:100,-50:50,700:900. An empty "
    "end is open: --box :,:,700:900"
)
def plane(
    cloud: Annotated[Path, typer.Argument(help="Cloud: .npz, .ply or .xyz, mm.")],
    box: Annotated[
        str | None,
        typer.Option("--box", metavar=BOX_FORM, help="Only points in this box, mm, cloud's frame."),
    ] = None,
    pixels: Annotated[
        str | None,
        typer.Option(
            "--pixels",
            metavar=PIXELS_FORM,
            help="Only points of these camera columns and rows, px, ends included; .npz only.",
        ),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a plane by orthogonal least squares: normal, offset, and how flat it is, mm.

    flatness is the range of all distances, band95 the width that holds 95 % of them, form rms
    their root mean square; no point is left out.
    """
    ranges = None if box is None else parse_ranges(box, option="--box", form=BOX_FORM)
    window = None if pixels is None else parse_ranges(pixels, option="--pixels", form=PIXELS_FORM)
    if window is not None and cloud.suffix.lower() != ".npz":
        raise UsageError(f"--pixels needs a cloud on the camera's grid, .npz, got '{cloud.name}'")
    from fringeworks.files import read_cloud
    from fringeworks.measure.region import Region
    from fringeworks.pipeline import measure_plane
    from fringeworks.report.summary import summarise_plane

    read = read_cloud(cloud)
    region = Region(
        box_mm=None if ranges is None else (ranges[0], ranges[1], ranges[2]),
        pixels=None if window is None else (window[0], window[1]),
    )
    found = summarise_plane(measure_plane(read, region))
    output = Output(as_json=as_json)
    output.line(f"plane through {found['points']} points of {cloud.name}, frame: {read.frame}")
    x, y, z = found["normal"]
    output.facts(
        [
            ("normal", f"{x:.6f} {y:.6f} {z:.6f}"),
            ("offset", f"{found['offset_mm']:.4f} mm"),
            ("form rms", f"{found['form_rms_mm']:.4f} mm"),
            ("band95", f"{found['band95_mm']:.4f} mm"),
            ("flatness", f"{found['flatness_mm']:.4f} mm"),
        ]
    )
    output.result({**found, "cloud": cloud, "frame": read.frame})
