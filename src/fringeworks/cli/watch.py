"""``fringeworks watch``: scan after scan, to a log and a folder of clouds; zones looked at."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.arguments import ZRangeOption, parse_ranges
from fringeworks.cli.output import JsonFlag, Output, percent
from fringeworks.cli.response import CurveOption, read_curve
from fringeworks.cli.sequences import (
    AxesOption,
    CodeOption,
    CodewordsOption,
    InvertedOption,
    PeriodsOption,
    Preset,
    StepsOption,
    sequence_of,
)
from fringeworks.cli.stopping import stoppable
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.files.station import Station
    from fringeworks.files.watch_log import ScanRow
    from fringeworks.measure.zones import Zone
    from fringeworks.model import GreyCurve
    from fringeworks.model.frame import Frame
    from fringeworks.watch import Scanned, Totals, Watching

GIGABYTE = 10**9
SHOWN_SCANS = 10
ZONE_FORM = "X0:X1,Y0:Y1,Z0:Z1"


def watch(
    station: Annotated[
        Path | None, typer.Option("--station", help="station.toml, with the rig that measures.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for log and clouds.")
    ] = None,
    preset: Annotated[
        Preset, typer.Option("--preset", help="Which patterns, as `acquire` has them.")
    ] = "measure",
    axes: AxesOption = "x",
    steps: StepsOption = None,
    periods: PeriodsOption = None,
    code: CodeOption = None,
    inverted: InvertedOption = None,
    codewords: CodewordsOption = None,
    response: CurveOption = None,
    z_range: ZRangeOption = None,
    every: Annotated[
        float, typer.Option("--every", min=0, metavar="S", help="From scan to scan, seconds.")
    ] = 0.0,
    count: Annotated[
        int | None, typer.Option("--count", min=1, help="How many scans [default: no end].")
    ] = None,
    max_gb: Annotated[
        float,
        typer.Option("--max-gb", min=0.001, help="Size of the folder of clouds; the oldest go."),
    ] = 2.0,
    most_failures: Annotated[
        int, typer.Option("--most-failures", min=1, help="Failed scans in a row that end it.")
    ] = 10,
    zone: Annotated[
        list[str] | None,
        typer.Option(
            "--zone", metavar=f"NAME={ZONE_FORM}", help="A box to look at, mm; may repeat."
        ),
    ] = None,
    frame: Annotated[
        str,
        typer.Option("--frame", help="Of zones and clouds: camera, or the rig's station."),
    ] = "camera",
    least_points: Annotated[
        int, typer.Option("--least-points", min=1, help="Fewer points are no alarm.")
    ] = 1,
    least_mm3: Annotated[
        float, typer.Option("--least-mm3", min=0, help="Less occupied volume is no alarm.")
    ] = 0.0,
    show: Annotated[
        Path | None,
        typer.Option("--show", metavar="DIR", help="Only tell what such a folder's log holds."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Scan again and again: measures to DIR/watch.sqlite, clouds to DIR/clouds.

    Images stay in memory. Of each zone: points inside by more than noise, the volume from them on
    away from the camera, the share that was not seen, the nearest point, alarm or none. This is
    NO SAFETY FUNCTION: nothing here may protect people. Ctrl-C ends it with the log complete, and
    the same command goes on.
    """
    output = Output(as_json=as_json)
    if show is not None:
        show_log(output, show)
        return
    if station is None or out is None:
        raise UsageError("watch needs --station and --out (or --show alone)")
    from fringeworks.files.station import read_station
    from fringeworks.measure.zones import ZoneRules
    from fringeworks.watch import Totals, Watching
    from fringeworks.watch import watch as watch_station

    with output.working():
        place = read_station(station)
        curve, bent = _curve(response, place)
        watching = Watching(
            zones=parse_zones(zone or []),
            rules=ZoneRules(least_points=least_points, least_mm3=least_mm3),
            frame=_frame_of(frame, place, station),
            z_range_mm=_depths(z_range),
            curve=curve,
            every_s=every,
            count=count,
            most_failures=most_failures,
            most_bytes=round(max_gb * GIGABYTE),
        )

        def sequence(width: int, height: int) -> Any:
            return sequence_of(
                preset,
                width=width,
                height=height,
                axes=axes,
                steps=steps,
                periods=periods,
                code=code,
                inverted=inverted,
                codewords=codewords,
            )

        totals = Totals()
        settings = {"preset": preset, "axes": axes, **_describe(watching), **bent}
        scans = watch_station(place, sequence, out, watching, settings=settings)
        try:
            with stoppable(), closing(scans):
                _tell_scans(output, scans, totals)
        finally:
            _tell_totals(output, totals, out)


def parse_zones(texts: list[str]) -> tuple[Zone, ...]:
    """``NAME=X0:X1,Y0:Y1,Z0:Z1`` each; UsageError for another form, or one name twice."""
    from fringeworks.measure.zones import Zone

    zones = []
    for text in texts:
        name, _, box = text.partition("=")
        x, y, z = parse_ranges(box, option=f"--zone {name}", form=ZONE_FORM)
        zones.append(Zone(name.strip(), (x, y, z)))
    names = [zone.name for zone in zones]
    if len(set(names)) < len(names):
        raise UsageError(f"--zone: each zone must have a name of its own, got {', '.join(names)}")
    return tuple(zones)


def show_log(output: Output, folder: Path) -> None:
    """The last scans of a log, and what their zones said."""
    from fringeworks.files.watch_log import CAVEAT, read_watch_log
    from fringeworks.watch import LOG

    scans, zones = read_watch_log(folder / LOG, last=SHOWN_SCANS)
    for row in scans:
        output.line(_scan_line(row))
        for found in (found for found in zones if found.scan == row.scan):
            output.line(f"      {_zone_line(found.zone, found)}")
    output.line(f"zones are {CAVEAT}")
    output.result({"scans": [asdict(row) for row in scans], "zones": [asdict(z) for z in zones]})


def _curve(path: Path | None, station: Station) -> tuple[GreyCurve | None, dict[str, str]]:
    """What pre-distorts the patterns; a station without a rig is refused by `watch` itself."""
    if station.rig is None:
        return None, {}
    projector = station.rig.projector
    return read_curve(path, width=projector.width, height=projector.height)


def _frame_of(name: str, station: Station, path: Path) -> Frame | None:
    from fringeworks.files.frame import station_of

    if name not in ("camera", "station"):
        raise UsageError(f"--frame must be camera or station, got '{name}'")
    if name == "camera" or station.rig is None:
        return None
    return station_of(station.rig, path)


def _depths(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    (depths,) = parse_ranges(text, option="--z-range", form="MIN:MAX")
    return depths


def _describe(watching: Watching) -> dict[str, Any]:
    """Zones and rules for the log."""
    return {
        "zones": {zone.name: zone.box_mm for zone in watching.zones},
        "rules": asdict(watching.rules),
        "frame": watching.frame.name if watching.frame else "camera",
    }


def _tell_scans(output: Output, scans: Iterator[Scanned], totals: Totals) -> None:
    for made in scans:
        totals.add(made)
        output.line(_scan_line(made.row))
        for name, found in made.zones.items():
            output.line(f"      {_zone_line(name, found)}")


def _scan_line(row: ScanRow) -> str:
    head = f"{row.scan:>5}  {row.started_utc[11:19]}"
    if row.failure is not None:
        return f"{head}  failed: {row.failure}"
    assert row.valid_share is not None  # it has a cloud
    sigma_mm = math.nan if row.sigma_mm is None else row.sigma_mm  # the log keeps NaN as NULL
    return f"{head}  {row.points} points, {percent(row.valid_share)}, sigma {sigma_mm:.3g} mm"


def _zone_line(name: str, found: Any) -> str:
    """Of an `Occupation` or its row in the log."""
    state = "ALARM" if found.alarm else "free"
    near = f", nearest {found.nearest_mm:.1f} mm" if found.points else ""
    return (
        f"{name}: {state}, {found.points} points, {found.occupied_mm3 / 1000:.3g} cm^3{near}, "
        f"{percent(found.unseen_share)} unseen"
    )


def _tell_totals(output: Output, totals: Totals, out: Path) -> None:
    from fringeworks.files.watch_log import CAVEAT

    told = totals.summary()
    output.line(
        f"{told['scans']} scans, {told['failed']} failed, {told['scans_per_s']:.3g} a second"
    )
    output.facts([(name, percent(share)) for name, share in told["shares"].items()])
    for name, alarms in told["alarms"].items():
        output.line(f"{name}: {alarms} alarms; {CAVEAT}")
    output.result({"out": out, **told, "caveat": CAVEAT})
