"""``fringeworks acquire``: show patterns, grab the frames that show them."""

from __future__ import annotations

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

if TYPE_CHECKING:
    from fringeworks.acquire import Acquisition


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
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Begin anew in a folder that holds files already.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Show a preset's patterns one by one, grab the frame that shows each, write a capture.

    After an interruption the same command, without --overwrite, goes on where it stopped. Frames
    that came repeated, went missing or were exposed before their pattern had settled are never
    used, and counted.
    """
    output = Output(as_json=as_json)
    import numpy as np

    from fringeworks.acquire import acquire_sequence, count_taken
    from fringeworks.devices import open_station
    from fringeworks.files.station import read_station

    with output.working() as progress:
        place = read_station(station)
        sequence = sequence_of(
            preset,
            width=place.rig.projector.width,
            height=place.rig.projector.height,
            axes=axes,
            steps=steps,
            periods=periods,
            code=code,
            inverted=inverted,
            codewords=codewords,
            exposures=exposures,
        )
        projector = place.rig.projector
        curve, bent = read_curve(response, width=projector.width, height=projector.height)
        taken = 0 if overwrite else count_taken(out)
        if taken:
            print_note(f"{out}: {taken} images are there from an unfinished run")
        # A run that goes on must not draw the noise of the first one again.
        rng = np.random.default_rng([place.seed, taken])
        with open_station(place, rng=rng) as bench:
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
                overwrite=overwrite,
                progress=progress,
            )
    _report(output, done, out)
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
            },
        }
    )


def _report(output: Output, done: Acquisition, out: Path) -> None:
    earlier = done.images - done.taken
    before = f", {earlier} of them taken before" if earlier else ""
    output.line(f"wrote {done.images} images and capture.toml in {out}{before}")
    frames = done.frames
    output.facts(
        [
            ("passed over", f"{frames.stale} frames exposed before their pattern had settled"),
            ("repeated", f"{frames.repeated} frames, grabbed anew"),
            ("dropped", f"{frames.dropped} frames missing in the camera's count"),
            ("waits in vain", f"{frames.timeouts}, each pattern shown again"),
        ]
    )
