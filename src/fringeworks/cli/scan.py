"""``fringeworks scan``: from a capture to a cloud."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from fringeworks.cli.arguments import (
    Axis,
    GroupOption,
    OrdersOption,
    ZRangeOption,
    parse_ranges,
    refuse_planned,
    refuse_planned_flag,
    require_built,
)
from fringeworks.cli.output import JsonFlag, Output, percent


def scan(
    capture: Annotated[Path, typer.Argument(help="Folder with capture.toml and its images.")],
    rig: Annotated[Path, typer.Option("--rig", help="rig.json of `fringeworks calibrate`.")],
    out: Annotated[
        Path, typer.Option("--out", metavar="CLOUD", help="File to write: .npz, .ply or .xyz.")
    ],
    axis: Annotated[
        Axis | None,
        typer.Option("--axis", help="Use this axis alone [default: all that are coded]."),
    ] = None,
    z_range: ZRangeOption = None,
    orders: OrdersOption = "auto",
    group: GroupOption = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw every stage into this folder."),
    ] = None,
    as_json: JsonFlag = False,
    model: Annotated[str, typer.Option(hidden=True)] = "full",
    exact: Annotated[
        bool, typer.Option("--exact", hidden=True, callback=refuse_planned_flag)
    ] = False,
    response: Annotated[str | None, typer.Option(hidden=True, callback=refuse_planned)] = None,
) -> None:
    """Measure: decode a capture and triangulate it with a rig into a cloud, mm, camera frame.

    Both lenses' distortion is part of the model; where both axes are coded, both are used,
    weighted by their sigma. .npz keeps the pixel grid and sigma; .ply has normals and colour.
    """
    require_built("--model", model, built="full", planned=("geometric", "extended"))
    depths = None
    if z_range is not None:
        (depths,) = parse_ranges(z_range, option="--z-range", form="MIN:MAX")
    output = Output(as_json=as_json)
    from fringeworks.files import read_capture, read_rig, write_cloud
    from fringeworks.phase.decode import decode_phases
    from fringeworks.phase.window import volume_of
    from fringeworks.pipeline import cloud_of
    from fringeworks.reconstruct.full import CloudRules
    from fringeworks.report.summary import summarise_cloud

    with output.working() as progress:
        calibrated = read_rig(rig)
        read = read_capture(capture, group=group, progress=progress)
        output.findings(read.name, read.findings)
        decoding = decode_phases(read, orders=orders, volume=volume_of(calibrated, depths))
        rules = CloudRules(axis=axis, z_range_mm=depths)
        cloud = cloud_of(read, decoding.projector_map(), calibrated, rules=rules)
        output.findings(read.name, cloud.findings)
        write_cloud(out, cloud)
        drawn: list[Path] = []
        if figures is not None:
            from fringeworks.report.cloud import save_cloud
            from fringeworks.report.decoding import save_decoding

            drawn = [*save_decoding(decoding, figures), *save_cloud(cloud, figures)]

    summary = summarise_cloud(cloud)
    describe_cloud(output, read.name, summary)
    output.written([out])
    output.written(drawn)
    output.result(
        {"capture": read.name, "rig": rig, "out": out, **summary, "figures": drawn}
        | {"findings": [str(finding) for finding in (*read.findings, *cloud.findings)]}
    )


def describe_cloud(output: Output, name: str, summary: dict[str, Any]) -> None:
    """Print a cloud's summary."""
    z, epipolar = summary["z_mm"], summary["epipolar_rms_px"]
    output.line(f"{name}: {summary['points']} points, frame: {summary['frame']}")
    facts = [
        ("pixels with a point", percent(summary["valid_share"])),
        ("depth z", f"{z['p1']:.1f} to {z['p99']:.1f} mm, median {z['median']:.1f} mm"),
        ("sigma of z", f"{summary['sigma_mm_median']:.3g} mm, median of the random part"),
    ]
    if epipolar is not None:
        facts.append(("epipolar rms", f"{epipolar:.3f} projector px"))
    output.facts(facts)
