"""``fringeworks convert``: a cloud in another format, frame or colour."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fringeworks.cli.output import JsonFlag, Output

if TYPE_CHECKING:
    from fringeworks.model import Cloud, Rig

ColourBy = Literal["camera", "x", "y", "z"]

FrameOption = Annotated[
    str | None,
    typer.Option(
        "--frame",
        metavar="FRAME",
        help="Frame of the points: a frame.json of `fringeworks frame`, or camera.",
    ),
]


def convert(
    cloud: Annotated[Path, typer.Argument(help="Cloud: .npz, .ply, .pcd, .xyz or .e57.")],
    out: Annotated[
        Path,
        typer.Argument(
            help="File to write: .npz, .ply, .pcd, .xyz, .e57 or .mat; meshes .stl, .obj, .glb."
        ),
    ],
    frame: FrameOption = None,
    colour: Annotated[
        ColourBy,
        typer.Option("--colour", help="What colours show: the camera's image, or a coordinate."),
    ] = "camera",
    mesh: Annotated[
        bool, typer.Option("--mesh", help="Triangles in a .ply too; meshes always have them.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Write a cloud in another format, mm (E57 and GLB: m), moved to a frame, coloured.

    Meshes join neighbouring pixels and stay open where the depth jumps: they need a cloud on the
    camera's grid. --frame needs a cloud in the camera's frame, or an .npz that knows where the
    camera stood.
    """
    output = Output(as_json=as_json)
    from fringeworks.files import read_cloud, write_cloud
    from fringeworks.files.cloud import check_cloud_suffix

    check_cloud_suffix(out)
    with output.working():
        read = read_cloud(cloud)
        if frame is not None:
            read = move_to(read, frame)
        if colour != "camera":
            from fringeworks.report.colours import paint_cloud

            read = paint_cloud(read, colour)
        write_cloud(out, read, faces=mesh)
    points = int(read.valid.sum())
    output.line(f"{cloud.name}: {points} points, frame: {read.frame}")
    output.written([out])
    output.result({"cloud": cloud, "out": out, "points": points, "frame": read.frame})


def move_to(cloud: Cloud, frame: str, rig: tuple[Path, Rig] | None = None) -> Cloud:
    """The cloud in the frame called on a command line: camera, the rig's station, or a file."""
    from fringeworks.files.frame import read_frame, station_of
    from fringeworks.measure.frames import move_cloud, to_camera

    if frame == "camera":
        return to_camera(cloud)
    if frame == "station" and rig is not None:
        path, known = rig
        return move_cloud(cloud, station_of(known, path))
    return move_cloud(cloud, read_frame(frame))
