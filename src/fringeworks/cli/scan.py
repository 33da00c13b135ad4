"""``fringeworks scan``: from a capture, or from a station, to a cloud."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from fringeworks.cli.arguments import (
    Axis,
    GroupOption,
    OrdersOption,
    ZRangeOption,
    parse_ranges,
)
from fringeworks.cli.motion import (
    MotionOption,
    OtherLightOption,
    hold_asked,
    summarise_motion,
    tell_motion,
)
from fringeworks.cli.output import JsonFlag, Output, percent
from fringeworks.cli.response import ResponseOption, read_asked, summarise_used
from fringeworks.cli.station_scan import (
    Asked,
    KeepOption,
    PresetOption,
    StationOption,
    take_or_read,
)

Model = Literal["geometric", "extended", "full"]


def scan(
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="CLOUD", help="File to write: .npz, .ply or others of `convert`."
        ),
    ],
    capture: Annotated[
        Path | None, typer.Argument(help="Folder with capture.toml and its images; or --station.")
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", help="rig.json of `fringeworks calibrate` [default: the station's]."),
    ] = None,
    station: StationOption = None,
    preset: PresetOption = "measure",
    keep: KeepOption = None,
    axis: Annotated[
        Axis | None,
        typer.Option("--axis", help="Use this axis alone [default: all that are coded]."),
    ] = None,
    z_range: ZRangeOption = None,
    frame: Annotated[
        str | None,
        typer.Option(
            "--frame",
            metavar="FRAME",
            help="Frame of the points: a frame.json, or station, which the rig keeps "
            "[default: camera].",
        ),
    ] = None,
    orders: OrdersOption = "auto",
    group: GroupOption = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw every stage into this folder."),
    ] = None,
    as_json: JsonFlag = False,
    model: Annotated[
        Model,
        typer.Option(
            "--model",
            help="full: both lenses' distortion; geometric: the paper's equations 1 to 3, of one "
            "axis, the projector a pinhole; extended: its 4 to 7, by calibrate --extended.",
        ),
    ] = "full",
    exact: Annotated[
        bool,
        typer.Option(
            "--exact", help="Solve the full model at every pixel rather than by its table."
        ),
    ] = False,
    response: ResponseOption = None,
    motion: MotionOption = None,
    other_light: OtherLightOption = False,
) -> None:
    """Measure: decode a capture and triangulate it with a rig into a cloud, mm, camera frame.

    --station takes the capture now, and keeps no images unless --keep says where.
    Both lenses' distortion is part of the model; where both axes are coded, both are used,
    weighted by their sigma (--model has the paper's models, of one axis). Depths come from a
    table that is within 1 um of the model, unless --exact. .npz keeps the pixel grid and sigma;
    .ply has normals and colour.
    """
    depths = None
    if z_range is not None:
        (depths,) = parse_ranges(z_range, option="--z-range", form="MIN:MAX")
    asked = Asked(capture=capture, rig=rig, station=station, preset=preset, keep=keep)
    asked.check()
    output = Output(as_json=as_json)
    from fringeworks.cli.convert import move_to
    from fringeworks.files import write_cloud
    from fringeworks.files.response import response_of_rig
    from fringeworks.phase.demodulate import MaskRules
    from fringeworks.phase.response import choose_response
    from fringeworks.pipeline import scan as scan_capture
    from fringeworks.pipeline import scan_stages
    from fringeworks.reconstruct.full import CloudRules
    from fringeworks.report.summary import summarise_cloud

    with output.working() as progress:
        read, calibrated = take_or_read(asked, group=group, progress=progress)
        output.findings(read.name, read.findings)
        read, moved = hold_asked(read, motion)
        rules = CloudRules(axis=axis, z_range_mm=depths, exact=exact)
        used = choose_response(read, read_asked(response), response_of_rig(calibrated))
        options: dict[str, Any] = {"orders": orders, "cloud_rules": rules, "model": model}
        options |= {"response": used, "mask_rules": MaskRules(other_light=other_light)}
        if figures is None:
            cloud = scan_capture(read, calibrated, **options)
        else:
            cloud, decoding = scan_stages(read, calibrated, **options)
        output.findings(read.name, cloud.findings)
        known = (asked.rig_source, calibrated)
        write_cloud(out, cloud if frame is None else move_to(cloud, frame, known))
        drawn: list[Path] = []
        if figures is not None:
            from fringeworks.report.cloud import save_cloud
            from fringeworks.report.decoding import save_decoding

            drawn = [*save_decoding(decoding, figures), *save_cloud(cloud, figures)]

    summary = summarise_cloud(cloud)
    describe_cloud(output, read.name, summary)
    tell_motion(output, moved)
    output.written([out])
    output.written(drawn)
    output.result(
        {"capture": read.name, "rig": asked.rig_source, "out": out, **summary, "figures": drawn}
        | {"response": summarise_used(used), "motion": summarise_motion(moved)}
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
    if summary["systematic_mm_median"] is not None:
        median = summary["systematic_mm_median"]
        facts.append(("", f"{median:.3g} mm, median of the systematic part, by the calibration"))
    heads = ["pixels without one", *[""] * len(summary["reasons"])]
    lost = zip(heads, summary["reasons"].items(), strict=False)
    facts += [(head, f"{percent(share)} {words}") for head, (words, share) in lost]
    if epipolar is not None:
        facts.append(("epipolar rms", f"{epipolar:.3f} projector px"))
    output.facts(facts)
