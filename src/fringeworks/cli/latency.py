"""``fringeworks latency``: from showing an image to frames that show it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fringeworks.cli.output import JsonFlag, Output
from fringeworks.cli.stopping import stoppable


def latency(
    station: Annotated[
        Path, typer.Option("--station", help="station.toml: projector, camera, timing.")
    ],
    flashes: Annotated[
        int,
        typer.Option("--flashes", metavar="N", min=4, max=1000, help="Changes of black and white."),
    ] = 20,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", min=0, help="Of the random waits between flashes.")
    ] = 0,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw latency.png into this folder."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Flash the projector and find how long its light takes, and what [timing] should say.

    White and black images are shown in turn, at random moments of the camera's rhythm. Partly lit
    frames tell the delay to a fraction of a frame. The advice is the longest delay found and a
    margin; it holds for this projector, camera, exposure and computer.
    """
    output = Output(as_json=as_json)
    import numpy as np

    from fringeworks.acquire.flashes import record_flashes
    from fringeworks.acquire.latency import find_latency
    from fringeworks.devices import open_station
    from fringeworks.files.station import read_station

    place = read_station(station)
    with stoppable(), output.working() as progress, open_station(place) as bench:
        record = record_flashes(
            bench.projector,
            bench.camera,
            clock=bench.clock,
            exposure_ms=place.exposure_ms,
            rng=np.random.default_rng(seed),
            flashes=flashes,
            progress=progress,
        )
    found = find_latency(record, place.timing)
    from fringeworks.report.latency import save_latency, summarise_latency

    summary = summarise_latency(found)
    delay, drawn = summary["delay_ms"], [] if figures is None else [save_latency(found, figures)]
    output.line(f"{station}: {summary['flashes']} of {flashes} flashes")
    spread = f"{delay['least']:.2f} to {delay['most']:.2f}"
    levels = f"{found.black:.0f} to {found.white:.0f} of {found.full_scale:g} grey levels"
    interval = f"{found.interval_ms:.2f} ms, unsteady by {found.unsteady_ms:.2f} ms"
    output.facts(
        [
            ("display to image", f"{delay['median']:.2f} ms ({spread})"),
            ("a change takes", f"{found.change_ms:.2f} ms, exposure {place.exposure_ms:g} ms"),
            ("frame interval", interval),
            ("flash", levels),
        ]
    )
    output.findings(str(station), found.findings)
    output.line("\n[timing]")
    output.line(f"settle_ms = {found.timing.settle_ms:.1f}")
    output.line(f"drop_frames = {found.timing.drop_frames}")
    output.written(drawn)
    output.result(
        {"station": station, **summary, "figures": drawn}
        | {"findings": [str(finding) for finding in found.findings]}
    )
