"""What every command that shows patterns may be told of them, and the sequence that it means."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fringeworks.cli.arguments import parse_numbers
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.model import Sequence
    from fringeworks.patterns.codewords import Codewords, CodewordsName

Preset = Literal[
    "paper", "calibrate", "measure", "multi-frequency", "paper-calibrate", "double-three-step"
]
Shown = Literal[
    "paper",
    "calibrate",
    "measure",
    "multi-frequency",
    "paper-calibrate",
    "double-three-step",
    "response",
    "noise",
    "test",
]
Code = Literal["none", "gray", "complementary", "staircase", "colour"]
Axes = Literal["x", "y", "xy"]

PresetArgument = Annotated[
    Shown,
    typer.Argument(
        help="paper: 3 steps of 32 px, Gray code, code frame; calibrate: 8 steps of 32 px, "
        "inverted Gray code; measure: 8 steps of 16 px; multi-frequency: 4 steps of three "
        "periods, no code; paper-calibrate: paper's fringes and a projected checkerboard; "
        "double-three-step: three steps of 16 px twice, 60 degrees apart; "
        "response: 52 grey levels; noise: 16 grey levels, four images of each; "
        "test: 27 frames from which `fringeworks advise` tells exposure, period and steps."
    ),
]
AxesOption = Annotated[Axes, typer.Option("--axes", help="Code columns (x), rows (y) or both.")]
StepsOption = Annotated[
    int | None, typer.Option("--steps", metavar="N", help="Frames of each fringe set, 3 to 64.")
]
PeriodsOption = Annotated[
    str | None, typer.Option("--periods", metavar="PX,PX", help="Fringe periods, projector px.")
]
CodeOption = Annotated[Code | None, typer.Option("--code", help="What tells the fringe orders.")]
InvertedOption = Annotated[
    bool | None,
    typer.Option("--inverted/--no-inverted", help="Show the inverse of each Gray bit too."),
]
CodewordsOption = Annotated[
    str | None,
    typer.Option(
        "--codewords",
        metavar="NAME",
        help="Codewords of a code frame: paper, robust (survive defocus), de-bruijn (need no depth "
        "range either), periods as 2,3,4 px, or none.",
    ),
]

ExposuresOption = Annotated[
    str | None,
    typer.Option(
        "--exposures",
        metavar="MS,MS",
        help="Show all of it at each of these exposures, ms, as 2,8,32: `decode` and `scan` fuse "
        "them. [default: one, the camera's]",
    ),
]


def sequence_of(
    preset: Shown,
    *,
    width: int,
    height: int,
    axes: Axes,
    steps: int | None,
    periods: str | None,
    code: Code | None,
    inverted: bool | None,
    codewords: str | None,
    exposures: str | None = None,
) -> Sequence:
    """The sequence of a preset for a projector of this size, px; options replace its own values.

    Raises
    ------
    UsageError
        An option that is no list of numbers, or one of fringes where grey levels are shown; or as
        `patterns.make_sequence`.
    """
    from fringeworks.patterns import expose_repeatedly, make_sequence, probe_sequence
    from fringeworks.patterns.grey_levels import grey_levels, noise_levels

    if preset == "response" or preset == "noise" or preset == "test":
        once = None if preset == "noise" else exposures
        some = None if axes == "xy" else axes
        _refuse_options(preset, (some, steps, periods, code, inverted, codewords, once))
        fixed = {"response": grey_levels, "noise": noise_levels, "test": probe_sequence}[preset]
        sequence = fixed(width=width, height=height)
    else:
        sequence = make_sequence(
            preset,
            width=width,
            height=height,
            axes=("x", "y") if axes == "xy" else (axes,),
            steps=steps,
            periods_px=None if periods is None else parse_numbers(periods, option="--periods"),
            code=code,
            inverted=inverted,
            codewords_px=None if codewords is None else _parse_codewords(codewords),
        )
    if exposures is None:
        return sequence
    return expose_repeatedly(sequence, parse_numbers(exposures, option="--exposures"))


def _refuse_options(preset: Shown, options: tuple[object, ...]) -> None:
    if any(value is not None for value in options):
        shown = "frames of its own" if preset == "test" else "grey levels"
        raise UsageError(f"preset {preset} shows {shown}: no option changes them")


def _parse_codewords(text: str) -> Codewords:
    names: tuple[CodewordsName, ...] = ("paper", "robust", "de-bruijn")
    for name in names:
        if text == name:
            return name
    try:
        return parse_numbers(text, option="--codewords")
    except UsageError:
        raise UsageError(
            "--codewords must be paper, robust, de-bruijn, none, or periods in px with commas "
            f"between them, got '{text}'"
        ) from None
