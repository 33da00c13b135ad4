"""``fringeworks decode``: where in the projector each camera pixel's light comes from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from fringeworks.cli.arguments import (
    GroupOption,
    OrdersOption,
    parse_ranges,
    refuse_planned,
)
from fringeworks.cli.output import JsonFlag, Output, percent
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
    as_json: JsonFlag = False,
    response: Annotated[str | None, typer.Option(hidden=True, callback=refuse_planned)] = None,
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
    from fringeworks.phase.decode import decode_phases
    from fringeworks.phase.demodulate import MaskRules
    from fringeworks.phase.window import Volume, volume_of
    from fringeworks.report.summary import summarise_decoding

    depths = None
    if z_range is not None:
        (depths,) = parse_ranges(z_range, option="--z-range", form="MIN:MAX")
    with output.working() as progress:
        volume: Volume | None = None if rig is None else volume_of(read_rig(rig), depths)
        read = read_capture(capture, group=group, progress=progress)
        output.findings(read.name, read.findings)
        rules = MaskRules()
        if min_modulation is not None:
            rules = MaskRules(modulation_share=min_modulation / read.sensor.full_scale)
        decoding = decode_phases(read, rules=rules, orders=orders, volume=volume)
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
    output.written([out])
    output.written(drawn)
    output.result(
        {"capture": read.name, "out": out, "axes": axes, "figures": drawn}
        | {"findings": [str(finding) for finding in read.findings]}
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
    noise = axis["noise"]
    if noise is not None:
        facts.append(("noise", f"{noise['read_grey']:.2f} grey levels, from {noise['from']}"))
    output.facts(facts)


def _number(value: float | None, unit: str) -> str:
    return "unknown" if value is None else f"{value:.3g} {unit}"
