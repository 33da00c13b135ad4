"""``fringeworks import`` and ``export``: calibrations of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from fringeworks.cli.arguments import parse_size
from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import UsageError

Unit = Literal["mm", "cm", "m"]
Format = Literal["opencv", "mat", "ros"]


def import_rig(
    file: Annotated[
        Path, typer.Argument(help="OpenCV or SLStudio .yml, .yaml, .xml; MATLAB .mat.")
    ],
    out: Annotated[Path, typer.Option("--out", help="File to write: rig.json.")],
    camera: Annotated[
        str | None,
        typer.Option("--camera", metavar="WxH", help="Camera's size, px, where the file lacks it."),
    ] = None,
    projector: Annotated[
        str | None,
        typer.Option("--projector", metavar="WxH", help="Projector's size, px, likewise."),
    ] = None,
    unit: Annotated[
        Unit | None, typer.Option("--unit", help="Unit of the file's lengths [default: mm].")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Make a rig.json from a stereo calibration of another program; the camera is its first device.

    Lengths become mm, principal points px with pixel centres at whole numbers. The rig has no
    record of its calibration, so that verify judges it by fixed limits.
    """
    output = Output(as_json=as_json)
    if out.suffix.lower() != ".json":
        raise UsageError(f"--out must be a .json file, got '{out}'")
    sizes = (_size(camera, "--camera"), _size(projector, "--projector"))
    from fringeworks.files import write_rig
    from fringeworks.files.exchange import Given, read_foreign
    from fringeworks.report.summary import summarise_rig

    rig = read_foreign(file, Given(*sizes, unit))
    write_rig(out, rig)
    summary = summarise_rig(rig)
    for name in ("camera", "projector"):
        lens = summary[name]
        output.line(
            f"{name}: {lens['width']}x{lens['height']} px, focal length {lens['fx']:.2f} px"
        )
    output.line(f"baseline {rig.baseline_mm:.2f} mm")
    output.written([out])
    output.result({"out": out, "rig": summary})


def export_rig(
    rig: Annotated[Path, typer.Argument(help="rig.json to export.")],
    to: Annotated[Format, typer.Option("--to", help="Format to write.")],
    out: Annotated[Path, typer.Option("--out", help="File: .yml or .xml, .mat; for ros a folder.")],
    as_json: JsonFlag = False,
) -> None:
    """Write a rig for other programs: OpenCV's YAML or XML, MATLAB's .mat, ROS camera_info.

    Lengths are mm, in ROS m. Residuals, covariance and volume stay behind.
    """
    output = Output(as_json=as_json)
    from fringeworks.files import read_rig
    from fringeworks.files.exchange import write_matlab, write_opencv, write_ros

    writers = {"opencv": write_opencv, "mat": write_matlab, "ros": write_ros}
    written = writers[to](out, read_rig(rig))
    output.written(written)
    output.result({"rig": rig, "format": to, "files": written})


def _size(text: str | None, option: str) -> tuple[int, int] | None:
    if text is None:
        return None
    try:
        return parse_size(text)
    except UsageError as error:
        raise UsageError(str(error).replace("--projector", option)) from None
