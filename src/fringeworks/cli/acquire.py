"""``fringeworks acquire``: show patterns, grab the frames that show them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.output import JsonFlag, Output, print_note
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
from fringeworks.cli.stopping import stoppable
from fringeworks.errors import FormatError

if TYPE_CHECKING:
    from fringeworks.acquire import Acquisition
    from fringeworks.model import Sequence


def acquire(
    preset: PresetArgument,
    station: Annotated[
        Path, typer.Option("--station", help="station.toml: projector, camera, timing.")
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="CAPTURE", help="Folder to write the capture into.")
    ],
    axes: AxesOption = "xy",
    steps: StepsOption = None,
    periods: PeriodsOption = None,
    code: CodeOption = None,
    inverted: InvertedOption = None,
    codewords: CodewordsOption = None,
    exposures: ExposuresOption = None,
    response: CurveOption = None,
    proof: Annotated[
        bool,
        typer.Option(
            "--proof",
            help="Project a code in the corners of each pattern, and use only frames that show it.",
        ),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Begin anew in a folder that holds files already.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Show a preset's patterns one by one, grab the frame that shows each, write a capture.

    After an interruption the same command, without --overwrite, goes on where it stopped. Frames
    that came repeated, went missing or were exposed before their pattern had settled are never
    used, and counted. With --proof each frame itself must tell by a corner code that it shows its
    pattern; the corners are lost to the measurement.
    """
    output = Output(as_json=as_json)
    from fringeworks.acquire import acquire_sequence, count_taken
    from fringeworks.devices import open_station
    from fringeworks.files.station import read_station

    with output.working() as progress:
        place = read_station(station)
        taken = 0 if overwrite else count_taken(out)
        if taken:
            print_note(f"{out}: {taken} images are there from an unfinished run")
        with stoppable(), open_station(place, run=taken) as bench:
            width, height = bench.projector.width, bench.projector.height
            curve, bent = read_curve(response, width=width, height=height)
            sequence = sequence_of(
                preset,
                width=width,
                height=height,
                axes=axes,
                steps=steps,
                periods=periods,
                code=code,
                inverted=inverted,
                codewords=codewords,
                exposures=exposures,
            )
            with _rest_told(out, sequence):
                done = acquire_sequence(
                    sequence,
                    bench.projector,
                    bench.camera,
                    folder=out,
                    exposure_ms=place.exposure_ms,
                    timing=place.timing,
                    clock=bench.clock,
                    facts={**place.facts, **bent},
                    curve=curve,
                    proof=proof,
                    overwrite=overwrite,
                    progress=progress,
                )
    _report(output, done, out, proof=proof)
    output.result(
        {
            "preset": preset,
            "station": station,
            "out": out,
            "images": done.images,
            "taken": done.taken,
            "frames": {
                "stale": done.frames.stale,
                "repeated": done.frames.repeated,
                "dropped": done.frames.dropped,
                "timeouts": done.frames.timeouts,
                "misplaced": done.frames.misplaced,
            },
        }
    )


@contextmanager
def _rest_told(out: Path, sequence: Sequence) -> Iterator[None]:
    """Say what is there and what comes next where the failure itself does not."""
    from fringeworks.files.acquiring import read_acquiring
    from fringeworks.patterns import frame_names

    try:
        yield
    except (FormatError, KeyboardInterrupt, SystemExit):
        with suppress(FormatError):
            left = read_acquiring(out)
            if left is not None:
                names = [name for row in frame_names(sequence) for name in row]
                following = next((name for name in names if name not in left.images), "its end")
                print_note(
                    f"{out}: unfinished, {len(left.images)} of {len(names)} images are there; the "
                    f"same command (without --overwrite) goes on from {following}"
                )
        raise


def _report(output: Output, done: Acquisition, out: Path, *, proof: bool) -> None:
    earlier = done.images - done.taken
    before = f", {earlier} of them taken before" if earlier else ""
    output.line(f"wrote {done.images} images and capture.toml in {out}{before}")
    frames = done.frames
    facts = [
        ("passed over", f"{frames.stale} frames exposed before their pattern had settled"),
        ("repeated", f"{frames.repeated} frames, grabbed anew"),
        ("dropped", f"{frames.dropped} frames missing in the camera's count"),
        ("waits in vain", f"{frames.timeouts}, each pattern shown again"),
    ]
    if proof:
        facts.append(("misplaced", f"{frames.misplaced} frames whose corner code was another's"))
    output.facts(facts)
