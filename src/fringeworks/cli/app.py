"""The verbs, and the exit status of what goes wrong in them (see ``docs/formats.md``)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from fringeworks import __version__
from fringeworks.cli.accept import accept
from fringeworks.cli.acquire import acquire
from fringeworks.cli.advise import advise
from fringeworks.cli.bench import bench
from fringeworks.cli.board import board
from fringeworks.cli.budget import budget
from fringeworks.cli.calibrate import calibrate
from fringeworks.cli.check import check
from fringeworks.cli.compare import change, compare
from fringeworks.cli.convert import convert
from fringeworks.cli.decode import decode
from fringeworks.cli.demo import demo
from fringeworks.cli.devices import devices
from fringeworks.cli.exchange import export_rig, import_rig
from fringeworks.cli.found import auto
from fringeworks.cli.frame import frame
from fringeworks.cli.latency import latency
from fringeworks.cli.measure import measure
from fringeworks.cli.merge import merge
from fringeworks.cli.noise import noise
from fringeworks.cli.output import print_error
from fringeworks.cli.patterns import patterns
from fringeworks.cli.preview import preview
from fringeworks.cli.reproduce import reproduce
from fringeworks.cli.response import response
from fringeworks.cli.scan import scan
from fringeworks.cli.sections import section
from fringeworks.cli.twin import twin
from fringeworks.cli.verify import verify
from fringeworks.cli.watch import watch
from fringeworks.errors import FringeworksError

INTERRUPTED = 130


ALONG_THE_LINE = (
    "patterns",
    "devices",
    "preview",
    "latency",
    "acquire",
    "twin",
    "board",
    "calibrate",
    "verify",
    "import",
    "export",
    "advise",
    "check",
    "response",
    "noise",
    "decode",
    "scan",
    "watch",
    "convert",
    "frame",
    "merge",
    "measure",
    "compare",
    "change",
    "accept",
    "budget",
    "demo",
    "reproduce",
    "bench",
)


class Verbs(TyperGroup):
    """Turns the package's own errors into one line and their exit status."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Verbs in the order of the line; typer would put groups last."""
        return sorted(super().list_commands(ctx), key=ALONG_THE_LINE.index)

    def invoke(self, ctx: Any) -> Any:
        """Run a verb."""
        try:
            return super().invoke(ctx)
        except FringeworksError as error:
            print_error(str(error))
            raise typer.Exit(error.exit_status) from None
        except KeyboardInterrupt:
            print_error("interrupted", label="")
            raise typer.Exit(INTERRUPTED) from None


app = typer.Typer(
    cls=Verbs,
    rich_markup_mode=None,  # plain help takes half the time
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Lengths are mm, image coordinates px with pixel centres at whole numbers. Exit status: "
    "0 done, 1 the data cannot give a result, 2 wrong use, 3 a device failed.",
)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"fringeworks {__version__}")
        raise typer.Exit


@app.callback()
def fringeworks(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """3D measurement by fringe projection: patterns, calibration, decoding, clouds, numbers."""


def _add(verb: Callable[..., None], *, short: str, example: str, name: str | None = None) -> None:
    app.command(name, short_help=short, epilog=f"Example: fringeworks {example}")(verb)


_add(
    patterns,
    short="Images for a projector, and their capture.toml.",
    example="patterns measure --projector 1920x1080 --out patterns/",
)
_add(
    devices,
    short="Which projectors and cameras are there.",
    example="devices",
)
_add(
    preview,
    short="The live image, its saturation and its focus.",
    example="preview --station station.toml",
)
_add(
    latency,
    short="How long the projector's light takes; what to wait for.",
    example="latency --station station.toml --figures figures/",
)
_add(
    acquire,
    short="Show patterns, grab the frames, write a capture.",
    example="acquire measure --station station.toml --out capture/",
)
_add(
    twin,
    short="A capture of a simulated scene, with its truth.",
    example="twin cylinder --rig paper --preset paper --out capture/",
)
_add(
    board,
    short="A target to print, and its board.toml.",
    example="board checkerboard --columns 11 --rows 8 --square-mm 20 --out board.pdf",
)
_add(
    calibrate,
    short="From captures of a board to a rig.",
    example="calibrate captures/ --board board.toml --out rig.json --figures figures/",
)
_add(
    verify,
    short="Does a rig still hold: one new capture of a board.",
    example="verify capture/ --rig rig.json --board board.toml",
)
_add(
    import_rig,
    name="import",  # a word of the language
    short="A rig from OpenCV, SLStudio or MATLAB.",
    example="import calibration.yml --out rig.json --camera 1280x1024 --projector 1920x1080",
)
_add(
    export_rig,
    name="export",
    short="A rig for OpenCV, MATLAB or ROS.",
    example="export rig.json --to opencv --out calibration.yml",
)
_add(
    advise,
    short="Exposures, period and steps to take, from test frames.",
    example="advise test/ --exposure-ms 10 --report advice.html",
)
_add(
    check,
    short="What is wrong with a capture, and what to do about it.",
    example="check capture/ --rig rig.json --report check.html",
)
_add(
    response,
    short="What gamma makes of the fringes, to be taken away.",
    example="response capture/ --out response.json --figures figures/",
)
_add(
    noise,
    short="A camera's gain, read noise and black level.",
    example="noise flats/ --dark capped/ --write capture/ --figures figures/",
)
_add(
    decode,
    short="Phases and projector coordinates of a capture.",
    example="decode capture/ --out phase.npz --figures figures/",
)
_add(
    scan,
    short="From a capture and a rig to a cloud.",
    example="scan capture/ --rig rig.json --out cloud.ply --z-range 500:900 "
    "(or: scan --station station.toml --out cloud.ply)",
)
_add(
    watch,
    short="Scan after scan, logged; zones that fill (no safety function).",
    example="watch --station station.toml --out watched/ --every 10 --zone "
    "bench=-50:50,-50:50,600:680",
)
_add(
    convert,
    short="A cloud in another format, frame or colour; meshes.",
    example="convert cloud.npz part.stl --frame frame.json",
)
app.add_typer(frame)
_add(
    merge,
    short="Scans of one thing from several sides as one cloud.",
    example="merge view_*.npz --out whole.ply --frame table.json --angles 0,60,120,180,240,300",
)
measure.command(
    epilog="Example: fringeworks measure auto cloud.npz --figures figures/. Smaller forms: "
    "--least 0.5; rougher ones: --tolerance 1"
)(auto)
measure.command(
    epilog="Example: fringeworks measure section cloud.npz --along y --range 20:60 --figures "
    "figures/"
)(section)
app.add_typer(measure)
_add(
    compare,
    short="How far a cloud lies from a mesh or another cloud.",
    example="compare cloud.npz part.stl --align --tolerance 0.1 --figures figures/",
)
_add(
    change,
    short="What changed between two scans, in mm and mm^3.",
    example="change before.npz after.npz --figures figures/",
)
_add(
    accept,
    short="Acceptance test: PF, PS, SD, F against limits.",
    example="accept plan.toml --out out/accept (or: accept --twin)",
)
_add(
    budget,
    short="Where the uncertainty comes from, over depth.",
    example="budget --rig rig.json --out figures/",
)
_add(
    demo,
    short="The whole loop, simulated and on a real capture.",
    example="demo --out out/demo",
)
_add(
    reproduce,
    short="The paper's experiments, beside its numbers.",
    example="reproduce --out out/reproduce --quick",
)
_add(
    bench,
    short="Speed and accuracy, next to peers.",
    example="bench --json",
)
