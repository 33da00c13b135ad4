"""``fringeworks patterns``: images for a projector, and their ``capture.toml``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.arguments import parse_size
from fringeworks.cli.output import JsonFlag, Output, progress_bars
from fringeworks.cli.response import CurveOption, read_curve
from fringeworks.cli.sequences import (
    AxesOption,
    CodeOption,
    CodewordsOption,
    ExposuresOption,
    InvertedOption,
    PeriodsOption,
    PresetArgument,
    StepsOption,
    sequence_of,
)
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.model import PatternSet, Sequence


def _print_presets(asked: bool) -> None:
    if not asked:
        return
    from fringeworks.patterns import PRESETS, explain_preset

    for name in PRESETS:
        typer.echo(f"{name}: {explain_preset(name)}")
    raise typer.Exit


def patterns(
    preset: PresetArgument,
    projector: Annotated[
        str, typer.Option("--projector", metavar="WxH", help="Size of the projector's image, px.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder to write into.")],
    axes: AxesOption = "xy",
    steps: StepsOption = None,
    periods: PeriodsOption = None,
    code: CodeOption = None,
    inverted: InvertedOption = None,
    codewords: CodewordsOption = None,
    exposures: ExposuresOption = None,
    bits: Annotated[int, typer.Option("--bits", help="Depth of the images, 8 to 16.")] = 8,
    response: CurveOption = None,
    rig: Annotated[
        Path | None,
        typer.Option(
            "--rig", help="rig.json with the blur of `advise --rig`: the period of least noise."
        ),
    ] = None,
    listed: Annotated[
        bool,
        typer.Option(
            "--list",
            callback=_print_presets,
            is_eager=True,
            help="Print why each preset takes its number of steps.",
        ),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Write into a folder that holds files already.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Write the images that a projector shows, and the capture.toml that describes them.

    Put the camera's images under the same names beside a copy of that capture.toml, and the
    folder is a capture. Options replace what the preset says.
    """
    width, height = parse_size(projector)
    output = Output(as_json=as_json)
    from fringeworks import __version__
    from fringeworks.files import write_sequence
    from fringeworks.patterns import explain_preset, render_sequence

    sequence = sequence_of(
        preset,
        width=width,
        height=height,
        axes=axes,
        steps=steps,
        periods=periods if rig is None else _period_of(rig, periods),
        code=code,
        inverted=inverted,
        codewords=codewords,
        exposures=exposures,
    )
    curve, bent = read_curve(response, width=width, height=height)
    refuse_occupied(out, overwrite=overwrite)
    with progress_bars() as progress:
        write_sequence(
            sequence,
            (list(frames) for _, frames in render_sequence(sequence, bits=bits, curve=curve)),
            out,
            provenance={"patterns": f"fringeworks {__version__}, preset {preset}", **bent},
            overwrite=overwrite,
            progress=progress,
        )
    output.line(f"{preset} for {width}x{height} px")
    for source in bent.values():
        output.line(f"pre-distorted by {source}")
    sets = describe_sets(output, sequence)
    count = sum(len(item["images"]) for item in sets)
    output.line(f"wrote {count} images and capture.toml in {out}")
    why = None
    if preset != "response" and preset != "noise" and preset != "test":
        why = explain_preset(preset)
    output.result(
        {
            "preset": preset,
            "projector": {"width": width, "height": height},
            "out": out,
            "images": count,
            "sets": sets,
            "explained": why,
            "predistorted_by": next(iter(bent.values()), None),
        }
    )


def _period_of(rig: Path, periods: str | None) -> str:
    """The period of least noise by the blur that a rig keeps.

    Raises
    ------
    UsageError
        Periods are given besides, or the rig keeps no blur.
    """
    if periods is not None:
        raise UsageError("--rig takes the period from the rig's blur: leave --periods out")
    from fringeworks.diagnose.advice_blur import best_even_period
    from fringeworks.files import read_rig
    from fringeworks.files.blur import blur_of_rig

    sigmas = blur_of_rig(read_rig(rig))
    if not sigmas:
        raise UsageError(f"{rig} keeps no blur; `fringeworks advise TEST --rig {rig}` writes it")
    return f"{best_even_period(max(sigmas.values())):g}"


def describe_sets(output: Output, sequence: Sequence) -> list[dict[str, Any]]:
    """Print what each set shows and its first image; returns all of them."""
    from fringeworks.patterns import frame_names

    named = zip(sequence.sets, frame_names(sequence), strict=True)
    sets: list[dict[str, Any]] = [
        {"pattern": _describe(item), "exposure_ms": item.exposure_ms, "images": files}
        for item, files in named
    ]
    rows = [(_shown(item), str(len(item["images"])), item["images"][0]) for item in sets]
    output.table(("set", "images", "first"), rows, numbers=(1,))
    return sets


def _shown(item: dict[str, Any]) -> str:
    exposed = "" if item["exposure_ms"] is None else f", {item['exposure_ms']:g} ms"
    return f"{item['pattern']}{exposed}"


def refuse_occupied(folder: Path, *, overwrite: bool) -> None:
    """A folder with files in it may hold a measurement under the very names of the patterns."""
    from fringeworks.files.capture_writing import check_folder

    check_folder(folder)
    if overwrite or not folder.exists():
        return
    held = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
    if held:
        raise UsageError(
            f"{folder} holds {len(held)} files already (first: {held[0]}); choose another folder, "
            "or --overwrite if they may be replaced"
        )


def _describe(item: PatternSet) -> str:
    """A set in words."""
    from fringeworks.model import Codeword, Colour, Fringe, GrayCode, Staircase, Uniform

    match item.pattern:
        case Fringe(axis=axis, period_px=period):
            return f"fringes along {axis}, period {period:g} px"
        case GrayCode(axis=axis, cell_px=cell, complementary=complementary, inverted=inverted):
            extras = complementary * ", complementary" + inverted * ", inverted"
            return f"Gray code along {axis}, cells of {cell:g} px{extras}"
        case Codeword(axis=axis, codewords_px=codewords):
            return f"code frame along {axis}, {len(codewords)} codewords"
        case Staircase(axis=axis, levels=levels):
            return f"staircase along {axis}, {levels} levels"
        case Colour(axis=axis, palette=palette):
            return f"colours along {axis}, {len(palette)} fringes"
        case Uniform(level=level):
            return {0.0: "black", 1.0: "white"}.get(level, f"grey, level {level:g}")
        case other:
            return type(other).__name__.lower()
