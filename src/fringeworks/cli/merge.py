"""``fringeworks merge``: views of one thing as one cloud."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from fringeworks.cli.arguments import parse_numbers
from fringeworks.cli.output import JsonFlag, Output
from fringeworks.errors import UsageError

if TYPE_CHECKING:
    from fringeworks.model import Cloud, Pose

By = Literal["icp", "targets", "frame"]


def merge(
    clouds: Annotated[list[Path], typer.Argument(help="Clouds of one thing: .npz.")],
    out: Annotated[Path, typer.Option("--out", metavar="CLOUD", help="File to write: .ply...")],
    by: Annotated[
        By,
        typer.Option(
            "--by",
            help="icp: surfaces that overlap; targets: points of targets.toml; frame: as they "
            "lie, or as the turntable turned.",
        ),
    ] = "icp",
    targets: Annotated[
        Path | None, typer.Option("--targets", help="targets.toml: named points of each cloud.")
    ] = None,
    frame: Annotated[
        Path | None,
        typer.Option("--frame", help="frame.json of the turntable, for --angles."),
    ] = None,
    angles: Annotated[
        str | None,
        typer.Option("--angles", metavar="DEG,...", help="Turn of the table in each view."),
    ] = None,
    within: Annotated[
        float, typer.Option("--within", metavar="MM", help="What icp may be wrong by at first.")
    ] = 5.0,
    as_json: JsonFlag = False,
) -> None:
    """Put several scans of one thing together, mm, in the frame of the first.

    --by icp starts from --angles of a turntable where they are given, else from how the clouds
    lie, each near the one before it, and then brings all overlapping surfaces together at once.
    --by targets needs three targets that a view shares with those before it. The turn is right-
    handed about the table's z. Extra: register.
    """
    output = Output(as_json=as_json)
    turns = _angles(angles, frame, len(clouds))
    _check_use(clouds, by, targets, turned=turns is not None)
    from fringeworks.files import read_cloud, write_cloud
    from fringeworks.files.cloud import check_points_suffix
    from fringeworks.measure.merging import merge_clouds

    check_points_suffix(out)
    with output.working() as progress:
        reads = [read_cloud(path) for path in progress(clouds, "reading")]
        starts, name = _starts(reads, frame, turns)
        poses, facts = _place(reads, starts, by=by, paths=clouds, targets=targets, within=within)
        merged = merge_clouds(reads, poses, frame=name)
        write_cloud(out, merged)
    points = int(merged.valid.sum())
    output.line(f"{len(clouds)} views, {points} points, frame: {name}")
    output.facts([(key.replace("_", " "), str(value)) for key, value in facts.items()])
    output.written([out])
    from fringeworks.files.frame import describe_pose

    placed = [describe_pose(pose) for pose in poses]
    output.result(
        {"clouds": clouds, "out": out, "points": points, "frame": name, "by": by, **facts}
        | {"common_from_view": placed}
    )


def _check_use(clouds: list[Path], by: By, targets: Path | None, *, turned: bool) -> None:
    if len(clouds) < 2:
        raise UsageError(f"merge takes two clouds or more, got {len(clouds)}")
    if (by == "targets") != (targets is not None):
        raise UsageError("--by targets and --targets belong together: the file with their places")
    if by == "targets" and turned:
        raise UsageError("--by targets takes no --angles: the targets tell how the views turned")


def _angles(text: str | None, frame: Path | None, count: int) -> tuple[float, ...] | None:
    if (text is None) != (frame is None):
        raise UsageError("--angles and --frame belong together: the turns and the table's axis")
    if text is None:
        return None
    turns = parse_numbers(text, option="--angles")
    if len(turns) != count:
        raise UsageError(f"--angles must be one per cloud, {count}, got {len(turns)}")
    return tuple(math.radians(turn) for turn in turns)


def _starts(
    clouds: list[Cloud], frame: Path | None, turns: tuple[float, ...] | None
) -> tuple[list[Pose] | None, str]:
    """Where the turntable says that the views are, None without one; and the frame's name."""
    if frame is None or turns is None:
        return None, clouds[0].frame
    from fringeworks.files.frame import read_frame
    from fringeworks.measure.turntable import turn_frame

    table = read_frame(frame)
    if any(cloud.frame != "camera" for cloud in clouds):
        raise UsageError("--angles needs clouds in the camera's frame: convert --frame camera")
    return [turn_frame(table, turn).frame_from_camera for turn in turns], table.name


def _place(
    clouds: list[Cloud],
    starts: list[Pose] | None,
    *,
    by: By,
    paths: list[Path],
    targets: Path | None,
    within: float,
) -> tuple[list[Pose], dict[str, Any]]:
    """Poses of all views and what there is to tell of them."""
    from fringeworks.measure.merging import chain_coarsely, register_targets, scan_views
    from fringeworks.measure.registration import register_views
    from fringeworks.model import Pose

    if targets is not None:
        from fringeworks.files.targets import read_targets

        poses, left = register_targets(read_targets(targets, paths))
        return poses, {"targets_rms_mm": float((left**2).mean() ** 0.5), "targets": len(left)}
    if by == "frame":
        _refuse_other_frames(clouds)
        return starts or [Pose.identity() for _ in clouds], {}
    found = register_views(scan_views(clouds), starts or chain_coarsely(clouds), within_mm=within)
    facts = {"rms_mm": found.rms_mm, "matches": found.matches, "loose_motions": found.loose}
    return list(found.poses), facts


def _refuse_other_frames(clouds: list[Cloud]) -> None:
    names = sorted({cloud.frame for cloud in clouds})
    if len(names) > 1:
        raise UsageError(f"--by frame needs clouds of one frame, got {', '.join(names)}")
