"""``fringeworks preview``: the live image, its saturation and its focus."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fringeworks.cli.output import JsonFlag, Output, percent
from fringeworks.cli.stopping import stoppable

if TYPE_CHECKING:
    from fringeworks.acquire.preview import Seen
    from fringeworks.devices.viewer import Viewer
    from fringeworks.files.station import Station


def preview(
    station: Annotated[
        Path, typer.Option("--station", help="station.toml: projector, camera, exposure.")
    ],
    show: Annotated[
        Literal["white", "stripes", "black"],
        typer.Option("--show", help="What is projected; stripes (16 px) to focus the projector."),
    ] = "white",
    frames: Annotated[
        int | None,
        typer.Option(
            "--frames",
            metavar="N",
            min=1,
            help="Stop after N frames [default: when the window is closed, or Ctrl-C].",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="PNG", help="Write the last image, saturated pixels red."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Show what the camera sees, saturated pixels red, with figures of exposure and focus.

    In a window, on a display that is not the projector's; where there is none the figures are
    refreshed in the terminal. Focus is the standard deviation of the Laplacian of the image over
    its mean: turn the lens until it is largest. It compares images of one scene in one light.
    """
    output = Output(as_json=as_json)
    from fringeworks.acquire.looking import paint
    from fringeworks.acquire.preview import watch_camera
    from fringeworks.devices import open_station
    from fringeworks.files.images import write_image
    from fringeworks.files.station import read_station

    place = read_station(station)
    last: Seen | None = None
    with (
        stoppable(),
        open_station(place) as bench,
        _viewer(place, bench.camera) as window,
        suppress(KeyboardInterrupt),
    ):
        for seen in watch_camera(
            bench, exposure_ms=place.exposure_ms, timing=place.timing, show=show, frames=frames
        ):
            last = seen
            _refresh(_words(seen), as_json=as_json)
            picture = paint(seen.image, bench.camera.sensor)
            if window is not None and not window.show(picture, _words(seen)):
                break
    if last is None:
        raise KeyboardInterrupt
    _refresh("", as_json=as_json)
    if out is not None:
        write_image(out, paint(last.image, bench.camera.sensor))
    _report(output, last, out)


@contextmanager
def _viewer(place: Station, camera: Any) -> Iterator[Viewer | None]:
    """A window, where there is a display for it."""
    from fringeworks.devices.viewer import Viewer, display_beside
    from fringeworks.files.station_devices import WindowSettings

    projector = place.projector
    used = projector.display if isinstance(projector, WindowSettings) else None
    display = display_beside(used)
    if display is None:
        yield None
        return
    viewer = Viewer(width=camera.width, height=camera.height, display=display, alone=used is None)
    with closing(viewer):
        yield viewer


def _refresh(words: str, *, as_json: bool) -> None:
    """One line of a terminal that is written over."""
    if sys.stderr.isatty() and not as_json:
        sys.stderr.write(f"\r\x1b[2K{words}")
        sys.stderr.flush()


def _words(seen: Seen) -> str:
    look = seen.look
    pace = "" if seen.frames_per_s is None else f", {seen.frames_per_s:.1f} frames/s"
    return (
        f"saturated {percent(look.saturated_share)}, focus {look.focus:.4f}, mean {look.mean:.1f}, "
        f"{look.least:g} to {look.most:g}{pace}"
    )


def _report(output: Output, last: Seen, out: Path | None) -> None:
    look = last.look
    pace = "one frame alone" if last.frames_per_s is None else f"{last.frames_per_s:.1f}"
    output.facts(
        [
            ("frames", str(last.count)),
            ("frames per s", pace),
            ("saturated", percent(look.saturated_share)),
            ("focus", f"{look.focus:.4f}, sd of the Laplacian over the mean"),
            ("mean", f"{look.mean:.1f}"),
            ("levels", f"{look.least:g} to {look.most:g} of {last.full_scale:g}"),
        ]
    )
    output.written([] if out is None else [out])
    output.result(
        {
            "frames": last.count,
            "frames_per_s": last.frames_per_s,
            "saturated_share": look.saturated_share,
            "focus": look.focus,
            "mean": look.mean,
            "min": look.least,
            "max": look.most,
            "full_scale": last.full_scale,
            "out": out,
        }
    )
