"""``fringeworks frame``: named frames, from a board, from 3-2-1 datum points, of a turntable."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.measure import BoxOption, PixelsOption, read_region
from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.model import Rig
    from fringeworks.model.frame import Frame

frame = typer.Typer(
    name="frame",
    no_args_is_help=True,
    short_help="Where clouds are: a board's frame, a 3-2-1 datum, a turntable.",
)

OutOption = Annotated[Path, typer.Option("--out", help="File to write: frame.json.")]
RigOption = Annotated[Path, typer.Option("--rig", help="rig.json of the captures.")]
BoardOption = Annotated[Path, typer.Option("--board", help="board.toml: corners and pitch, mm.")]
KeepFlag = Annotated[
    bool,
    typer.Option("--keep", help="Also keep it in the rig, for `scan --frame station`."),
]
NameOption = Annotated[str, typer.Option("--name", help="What the frame is called.")]

POINTS_FORM = "'U,V U,V ...'"


@frame.callback()
def frames() -> None:
    """Find a named frame and write it as frame.json, for `convert`, `scan` and `merge`."""


@frame.command(
    epilog="Example: fringeworks frame board capture/ --rig rig.json --board board.toml --out "
    "frame.json"
)
def board(
    capture: Annotated[Path, typer.Argument(help="Folder with one capture of a board.")],
    rig: RigOption,
    target: BoardOption,
    out: OutOption,
    name: NameOption = "board",
    keep: KeepFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """The frame of a board that lies where it is wanted: origin in its first inner corner.

    x runs along the board's columns, y along its rows, z into the board. Its corners are
    triangulated, so that the frame has the cloud's own errors.
    """
    output = Output(as_json=as_json)
    from fringeworks.calibrate.held.located import locate_board
    from fringeworks.files import read_board, read_capture, read_rig
    from fringeworks.measure.frames import fit_frame

    with output.working() as progress:
        known = read_rig(rig)
        read = read_capture(capture, progress=progress)
        output.findings(read.name, read.findings)
        found, left = fit_frame(*locate_board(read, known, read_board(target)), name=name)
    rms = float(((left**2).sum(axis=1).mean()) ** 0.5)
    output.line(f"frame {name} from {len(left)} corners, {rms:.4f} mm rms from their places")
    facts = {"corners": len(left), "rms_mm": rms}
    _finish(output, found, (out, (rig, known) if keep else None), facts)


@frame.command(
    epilog="Example: fringeworks frame datum cloud.npz --box=-50:50,-50:50,690:710 --line "
    "'120,300 480,310' --origin 120,300 --out frame.json"
)
def datum(
    cloud: Annotated[Path, typer.Argument(help="Cloud on the camera's grid: .npz.")],
    line: Annotated[
        str,
        typer.Option(
            "--line", metavar=POINTS_FORM, help="Camera pixels of two points or more: x runs so."
        ),
    ],
    origin: Annotated[
        str, typer.Option("--origin", metavar="U,V", help="Camera pixel beside the origin.")
    ],
    out: OutOption,
    box: BoxOption = None,
    pixels: PixelsOption = None,
    name: NameOption = "station",
    rig: Annotated[
        Path | None, typer.Option("--rig", help="rig.json to keep it in, with --keep.")
    ] = None,
    keep: KeepFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """A 3-2-1 datum: a plane, a line in it, a point on that.

    --box or --pixels choose the plane's points; z is its normal, towards the camera. x runs along
    --line from its first point to its last; the origin is on that line beside --origin.
    """
    if keep != (rig is not None):
        raise UsageError("--keep and --rig belong together: the file to keep the frame in")
    output = Output(as_json=as_json)
    ends, corners = parse_pixels(line, "--line"), parse_pixels(origin, "--origin")
    if len(ends) < 2 or len(corners) > 1:
        raise UsageError("--line takes two pixels or more, and --origin one")
    from fringeworks.files import read_rig
    from fringeworks.measure.frames import find_station

    read, region = read_region(cloud, box, pixels)
    found = find_station(read, region, line_px=ends, origin_px=corners[0], name=name)
    known = None if rig is None else (rig, read_rig(rig))
    output.line(f"frame {name} by 3-2-1 from {cloud.name}")
    _finish(output, found, (out, known), {"cloud": cloud})


@frame.command(
    epilog="Example: fringeworks frame turntable turned/* --rig rig.json --board board.toml --out "
    "table.json"
)
def turntable(
    captures: Annotated[list[Path], typer.Argument(help="Captures of a board, table turned.")],
    rig: RigOption,
    target: BoardOption,
    out: OutOption,
    name: NameOption = "table",
    as_json: JsonFlag = False,
) -> None:
    """The frame of a turntable as it stood in the first capture: z its axis.

    The board stands on the table anyhow, and is seen at three angles or more, over a right angle
    in all. `merge --frame table.json --angles 0,60,...` then puts scans of other things together.
    """
    output = Output(as_json=as_json)
    from fringeworks.calibrate.held.located import find_turntable
    from fringeworks.files import read_board, read_capture, read_rig

    with output.working() as progress:
        known, nominal = read_rig(rig), read_board(target)
        reads = [read_capture(path) for path in progress(captures, "reading")]
        found = find_turntable(reads, known, nominal, name=name)
    degrees = [math.degrees(angle) for angle in found.angles_rad]
    output.line(f"frame {name} from {found.corners} corners in {len(reads)} views")
    output.facts([("corners", f"{found.rms_mm:.4f} mm rms from their circles")])
    rows = [(read.name, f"{angle:.4f}") for read, angle in zip(reads, degrees, strict=True)]
    output.table(("view", "angle, degrees"), rows, numbers=(1,))
    facts = {"corners": found.corners, "rms_mm": found.rms_mm, "angles_deg": degrees}
    _finish(output, found.table, (out, None), facts)


def parse_pixels(text: str, option: str) -> list[tuple[float, float]]:
    """``U,V U,V``: camera pixels with blanks between them."""
    try:
        pairs = [tuple(float(part) for part in pair.split(",")) for pair in text.split()]
    except ValueError:
        pairs = []
    if not pairs or any(len(pair) != 2 or not all(map(math.isfinite, pair)) for pair in pairs):
        raise UsageError(f"{option} must be pixels as 120,300 with blanks between, got '{text}'")
    return [(pair[0], pair[1]) for pair in pairs]


def _finish(
    output: Output,
    found: Frame,
    where: tuple[Path, tuple[Path, Rig] | None],
    facts: dict[str, Any],
) -> None:
    """Write the frame, and into the rig where it is to be kept; tell."""
    from fringeworks.files.frame import describe_pose, keep_station, write_frame

    out, kept = where
    write_frame(out, found)
    written = [out]
    if kept is not None:
        keep_station(*kept, found)
        written.append(kept[0])
    output.written(written[:1])
    output.written(written[1:])
    pose = describe_pose(found.frame_from_camera)
    output.result({"frame": found.name, "frame_from_camera": pose, **facts, "files": written})
