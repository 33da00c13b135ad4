"""``fringeworks decode``: where in the projector each camera pixel's light comes from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from fringeworks.cli.arguments import (
    GroupOption,
    OrdersOption,
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
from fringeworks.errors import UsageError


def decode(
    capture: Annotated[Path, typer.Argument(help="Folder with capture.toml and its images.")],
    out: Annotated[Path, typer.Option("--out", help="File to write: phase.npz.")],
    group: GroupOption = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw every map into this folder."),
    ] = None,
    min_modulation: Annotated[
        float | None,
        typer.Option(
            "--min-modulation",
            metavar="GREY",
            help="Least modulation, grey levels [default: 8 of 255]. Five sigma of the noise "
            "hold in any case.",
        ),
    ] = None,
    orders: OrdersOption = "auto",
    rig: Annotated[
        Path | None,
        typer.Option("--rig", help="rig.json: with it, a code that repeats can be told apart."),
    ] = None,
    z_range: Annotated[
        str | None,
        typer.Option(
            "--z-range",
            metavar="MIN:MAX",
            help="Depths at which objects can be, mm, camera frame [default: the rig's volume, "
            "10 % wider].",
        ),
    ] = None,
    response: ResponseOption = None,
    motion: MotionOption = None,
    other_light: OtherLightOption = False,
    as_json: JsonFlag = False,
) -> None:
    """Decode a capture: modulation, wrapped and absolute phase, projector coordinate, sigma.

    Writes phase.npz with, per axis, the projector column or row (px, NaN where void), fringe
    order, wrapped phase (rad), modulation (grey levels) and sigma (px).
    """
    if min_modulation is not None and not min_modulation >= 0:
        raise UsageError(f"--min-modulation must be 0 or more grey levels, got {min_modulation:g}")
    if z_range is not None and rig is None:
        raise UsageError("--z-range needs --rig rig.json: depths are those in front of its camera")
    output = Output(as_json=as_json)
    from fringeworks.files import read_capture, read_rig, write_phase
    from fringeworks.files.response import response_of_rig
    from fringeworks.phase.decode import decode_phases
    from fringeworks.phase.demodulate import MaskRules
    from fringeworks.phase.gloss import notice_one_period
    from fringeworks.phase.response import choose_response, notice_response
    from fringeworks.phase.window import Volume, volume_of
    from fringeworks.report.summary import summarise_decoding

    depths = None
    if z_range is not None:
        (depths,) = parse_ranges(z_range, option="--z-range", form="MIN:MAX")
    with output.working() as progress:
        known = None if rig is None else read_rig(rig)
        volume: Volume | None = None if known is None else volume_of(known, depths)
        read = read_capture(capture, group=group, progress=progress)
        output.findings(read.name, read.findings)
        read, moved = hold_asked(read, motion)
        rules = MaskRules(other_light=other_light)
        if min_modulation is not None:
            rules = replace(rules, modulation_share=min_modulation / read.sensor.full_scale)
        kept = None if known is None else response_of_rig(known)
        used = choose_response(read, read_asked(response), kept)
        blind = notice_one_period(read.select().sequence.sets) if other_light else ()
        told = (*notice_response(read, used, kept), *blind)
        output.findings(read.name, told)
        decoding = decode_phases(read, rules=rules, orders=orders, volume=volume, response=used)
        axes = summarise_decoding(decoding)
        if not any(axis["valid_share"] for axis in axes.values()):
            decoding.projector_map()  # says why nothing can be decoded
        write_phase(out, decoding)
        drawn: list[Path] = []
        if figures is not None:
            from fringeworks.report.code_frame import save_fringes_read
            from fringeworks.report.decoding import save_decoding

            drawn = save_decoding(decoding, figures)
            drawn += save_fringes_read(read, decoding, figures, orders=orders, volume=volume)

    height, width = read.shape
    output.line(f"{read.name}: {width}x{height} px, {len(read.sequence.sets)} sets")
    for name, axis in axes.items():
        describe_axis(output, name, axis)
    tell_motion(output, moved)
    output.written([out])
    output.written(drawn)
    output.result(
        {"capture": read.name, "out": out, "axes": axes, "figures": drawn}
        | {"response": summarise_used(used), "motion": summarise_motion(moved)}
        | {"findings": [str(finding) for finding in (*read.findings, *told)]}
    )


def describe_axis(output: Output, name: str, axis: dict[str, Any]) -> None:
    """The lines of one axis."""
    valid = percent(axis["valid_share"])
    if axis["absolute"]:
        output.line(f"axis {name}: projector {axis['coordinate']} of {valid} of the pixels")
        facts = [("orders", " -> ".join(axis["route"]))]
        sigma = _number(axis["sigma_px_median"], "projector px")
    else:
        output.line(f"axis {name}: only relative, wrapped phase of {valid} of the pixels")
        facts = [("because", axis["reason"])]
        sigma = _number(axis["sigma_rad_median"], "rad")
    voids = ", ".join(f"{percent(share)} {words}" for words, share in axis["voids"].items())
    facts += [("void", voids or "none"), ("sigma", f"{sigma}, median")]
    if axis["exposures"]:
        facts.append(("exposures", describe_exposures(axis["exposures"])))
    noise = axis["noise"]
    if noise is not None:
        facts.append(("noise", f"{noise['read_grey']:.2f} grey levels, from {noise['from']}"))
    output.facts(facts)


def describe_exposures(exposures: list[dict[str, Any]]) -> str:
    """Which were fused, and of how many pixels each weighs most."""
    told = (f"{one['exposure_ms']:g} ms {percent(one['share'])}" for one in exposures)
    return f"fused; weighing most: {', '.join(told)}"


def _number(value: float | None, unit: str) -> str:
    return "unknown" if value is None else f"{value:.3g} {unit}"
