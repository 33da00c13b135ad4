"""``fringeworks compare`` and ``change``: a cloud against a surface, a scan against another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.arguments import require_positive
from fringeworks.cli.output import JsonFlag, Output, percent

if TYPE_CHECKING:
    from fringeworks.measure.reference import Reference
    from fringeworks.measure.registration import Registration
    from fringeworks.model import Cloud

NARROW = 1.005
"""Noise that is wider than told by less reads as 1.00 times."""

FiguresOption = Annotated[
    Path | None, typer.Option("--figures", metavar="DIR", help="Draw into this folder.")
]
ReportOption = Annotated[
    Path | None, typer.Option("--report", help="Write all of it as one HTML page.")
]


def compare(
    cloud: Annotated[
        Path, typer.Argument(help="Cloud: .npz keeps its map; .ply, .pcd, .xyz, .e57.")
    ],
    reference: Annotated[
        Path, typer.Argument(help="Mesh: .stl, .obj, .ply with faces; or a cloud on its grid.")
    ],
    align: Annotated[
        bool, typer.Option("--align", help="First bring the cloud to the reference.")
    ] = False,
    within: Annotated[
        float,
        typer.Option("--within", metavar="MM", help="Points further off are not compared."),
    ] = 5.0,
    tolerance: Annotated[
        float | None,
        typer.Option("--tolerance", metavar="MM", help="Tell the share within this, both ways."),
    ] = None,
    scale: Annotated[
        float, typer.Option("--scale", help="mm per unit of a mesh's file, as 25.4 or 1000.")
    ] = 1.0,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="CLOUD", help="Write the cloud, coloured by deviation."),
    ] = None,
    figures: FiguresOption = None,
    report: ReportOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Signed deviation of a cloud from a mesh or another cloud, mm: positive is outside.

    Outside is where a mesh's normals point, and towards the sensor of a cloud. Points without a
    counterpart are left out and counted: further off than --within, or beside an open border.
    --align moves the cloud until the distances are least (extra register); both must lie near
    each other, a tenth of their size or so. It hides whatever error a motion can explain.
    """
    output = Output(as_json=as_json)
    from fringeworks.files import read_cloud, write_cloud
    from fringeworks.files.cloud import check_cloud_suffix
    from fringeworks.files.reference import read_reference
    from fringeworks.measure.deviation import compare_cloud
    from fringeworks.measure.frames import shift_cloud
    from fringeworks.report.deviation import (
        Comparison,
        make_comparison_page,
        paint_deviations,
        save_comparison,
        summarise_comparison,
    )

    if out is not None:
        check_cloud_suffix(out)
    if tolerance is not None:
        require_positive("--tolerance", tolerance)
    with output.working():
        read, surface = read_cloud(cloud), read_reference(reference, scale=scale)
        placed = _align(read, surface, within) if align else None
        pose = None if placed is None else placed.poses[1]
        found = compare_cloud(read, surface, pose=pose, within_mm=within)
        left = None if placed is None else placed.rms_mm
        compared = Comparison(cloud.name, reference.name, found, tolerance, left)
        written = [] if figures is None else save_comparison(compared, figures)
        if report is not None:
            from fringeworks.report.page import write_page

            written.append(write_page(report, make_comparison_page(compared)))
        if out is not None:
            painted = paint_deviations(read, compared)
            write_cloud(
                out, painted if pose is None else shift_cloud(painted, pose, reference.stem)
            )
            written.append(out)
    summary = summarise_comparison(compared)
    _describe(output, compared.cloud, reference.name, summary, placed)
    _written(output, written)
    output.result({"cloud": cloud, "reference": reference, **summary, "files": written})


def _written(output: Output, paths: list[Path]) -> None:
    """Say which files there are now, folder by folder."""
    for folder in dict.fromkeys(path.parent for path in paths):
        output.written([path for path in paths if path.parent == folder])


def _align(cloud: Cloud, surface: Reference, within: float) -> Registration:
    from fringeworks.measure.registration import align_coarsely, register_cloud

    points = cloud.points()
    start = align_coarsely(points, surface.corners.mean(axis=1))
    return register_cloud(points, surface, start=start, within_mm=within)


def _describe(
    output: Output,
    cloud: str,
    reference: str,
    summary: dict[str, Any],
    placed: Registration | None,
) -> None:
    output.line(f"{cloud} against {reference}: {summary['points']} points, positive outside")
    if placed is not None:
        loose = f"; {placed.loose} motions are not held by the surface" if placed.loose else ""
        output.line(f"  aligned by {placed.matches} points, {placed.rms_mm:.4f} mm rms{loose}")
    low, high = summary["quantiles_mm"]["p2.5"], summary["quantiles_mm"]["p97.5"]
    facts = [
        ("mean", f"{summary['mean_mm']:+.4f} mm, median {summary['median_mm']:+.4f} mm"),
        ("sd", f"{summary['sd_mm']:.4f} mm, rms {summary['rms_mm']:.4f} mm"),
        ("95 % between", f"{low:+.4f} and {high:+.4f} mm"),
        ("range", f"{summary['min_mm']:+.4f} to {summary['max_mm']:+.4f} mm"),
    ]
    if summary["noise_rms_mm"] is not None:
        facts.append(("noise", f"{summary['noise_rms_mm']:.4f} mm rms by the points' own sigma"))
    if summary["within_share"] is not None:
        share = percent(summary["within_share"])
        facts.append(("within", f"{share} of the points within {summary['tolerance_mm']:g} mm"))
    left_out = f"{summary['beyond']} points too far off, {summary['border']} beside the border"
    output.facts([*facts, ("not compared", left_out)])


def change(
    before: Annotated[Path, typer.Argument(help="Earlier scan: .npz.")],
    after: Annotated[Path, typer.Argument(help="Later scan by the same rig, which stood still.")],
    window: Annotated[
        int, typer.Option("--window", metavar="PX", help="Odd width of the window averaged over.")
    ] = 9,
    least: Annotated[
        float, typer.Option("--least", metavar="MM", help="Smallest change that counts.")
    ] = 0.1,
    false_alarm: Annotated[
        float,
        typer.Option("--false-alarm", help="Probability that noise alone gives any region."),
    ] = 1e-3,
    figures: FiguresOption = None,
    report: ReportOption = None,
    as_json: JsonFlag = False,
) -> None:
    """What changed between two scans of a scene: where, by how much, how many mm^3.

    Lengths are mm along the line of sight, positive towards the camera, volumes mm^3. The scans'
    own sigma tells change from noise; what the rig gets wrong cancels, as long as it stands
    still. Nothing found ends with status 0: --json says changed true or false.
    """
    output = Output(as_json=as_json)
    from fringeworks.files import read_cloud
    from fringeworks.measure.change import ChangeRules, find_change
    from fringeworks.report.change import (
        HEAD,
        make_change_page,
        region_rows,
        save_change,
        summarise_change,
    )

    with output.working():
        rules = ChangeRules(window, least, false_alarm)
        found = find_change(read_cloud(before), read_cloud(after), rules)
        written = [] if figures is None else save_change(found, figures)
        if report is not None:
            from fringeworks.report.page import write_page

            written.append(write_page(report, make_change_page(found, before.name, after.name)))
    summary = summarise_change(found)
    count = len(found.regions)
    words = f"{count} region{'' if count == 1 else 's'}" if count else "nothing changed"
    output.line(f"{before.name} to {after.name}: {words}")
    if count:
        output.table(HEAD, region_rows(found), numbers=(2, 3, 4, 5))
        output.line(f"  in all {summary['volume_mm3']:+.1f} mm^3")
    factor = (
        f", {found.noise_factor:.2f} times what the scans say"
        if found.noise_factor > NARROW
        else ""
    )
    output.facts(
        [
            ("compared", f"{percent(summary['compared_share'])} of the pixels"),
            ("noise", f"{summary['sigma_mm_median']:.3g} mm per pixel, 1 sd{factor}"),
        ]
    )
    _written(output, written)
    output.result({"before": before, "after": after, **summary, "files": written})
