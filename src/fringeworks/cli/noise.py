"""``fringeworks noise``: gain, read noise, black level and full scale of a camera."""

from __future__ import annotations

import math
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fringeworks.cli.arguments import GroupOption
from fringeworks.cli.output import JsonFlag, Output

if TYPE_CHECKING:
    from fringeworks.phase.photon_transfer.nouns import Estimate, PhotonTransfer


def noise(
    captures: Annotated[
        list[Path],
        typer.Argument(
            metavar="CAPTURE...", help="Captures of one camera whose sets have repeats."
        ),
    ],
    dark: Annotated[
        list[Path] | None,
        typer.Option(
            "--dark", metavar="CAPTURE", help="Capture with the lens capped, for the black level."
        ),
    ] = None,
    group: GroupOption = None,
    write: Annotated[
        list[Path] | None,
        typer.Option(
            "--write",
            metavar="CAPTURE",
            help="Put the figures into [camera] of this capture.toml too; may be given often.",
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw the curve into this folder."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Measure a camera's noise by photon transfer, and print its [camera] table.

    What repeats of a frame differ by is noise; its variance grows with the level by the gain.
    Flat levels serve (`patterns noise`), and so do fringes with repeats. Vignetting, fixed
    pattern and flicker of the light cancel. The black level takes frames with the lens capped
    (--dark) or one pattern at several exposures.
    """
    output = Output(as_json=as_json)
    from fringeworks.files import read_capture
    from fringeworks.files.camera import lay_out_camera, write_camera
    from fringeworks.phase.photon_transfer.measure import measure_noise
    from fringeworks.report.noise import summarise_noise

    with output.working() as progress:
        read = [read_capture(path, group=group, progress=progress) for path in captures]
        capped = [read_capture(path, progress=progress) for path in dark or ()]
        for capture in (*read, *capped):
            output.findings(capture.name, capture.findings)
        found = measure_noise(read, dark=capped)
        output.findings(read[0].name, found.findings)
        table = _table_of(found)
        written = [write_camera(path, table) for path in write or ()]
        drawn: list[Path] = []
        if figures is not None:
            from fringeworks.report.noise import save_noise

            drawn = save_noise(found, figures)
    output.line(f"{', '.join(item.name for item in read)}: noise by photon transfer")
    output.facts(_facts(found))
    output.line()
    output.line(lay_out_camera(table))
    for path in written:
        output.line(f"kept in {path}")
    output.written(drawn)
    findings = [*chain.from_iterable(item.findings for item in (*read, *capped)), *found.findings]
    output.result(
        {"captures": captures, **summarise_noise(found), "camera": table}
        | {"written": written, "figures": drawn}
        | {"findings": [str(finding) for finding in findings]}
    )


def _table_of(found: PhotonTransfer) -> dict[str, float]:
    """Keys of ``[camera]`` with six digits; full scale only where it was seen."""
    sensor = found.sensor
    table = {
        "full_scale": sensor.full_scale if found.saturates else None,
        "black_level": sensor.black_level,
        "gain": sensor.gain,
        "read_noise": sensor.read_noise,
    }
    return {key: float(f"{value:.6g}") for key, value in table.items() if value is not None}


def _facts(found: PhotonTransfer) -> list[tuple[str, str]]:
    way = {"dark": "dark frames", "exposures": "exposures", "assumed": "assumed, not measured"}
    black, read = found.black_level, found.read_noise
    return [
        ("gain", f"{_words(found.gain)} grey levels of variance per level"),
        ("read noise", f"{_words(read)} grey levels ({found.read_noise_e:.3g} electrons)"),
        ("black level", f"{_words(black)} grey levels, {way[found.black_way]}"),
        ("full scale", f"{found.full_scale:g}, {'seen' if found.saturates else 'as stated'}"),
        ("full well", f"{found.full_well_e:.4g} electrons"),
        ("off the line", f"{found.misfit:.1%} rms of the variance"),
        *_linearity(found),
    ]


def _linearity(found: PhotonTransfer) -> list[tuple[str, str]]:
    line = found.linearity
    return [] if line is None else [("linearity", f"{line.least:+.2%} to {line.most:+.2%}")]


def _words(item: Estimate) -> str:
    known = "" if math.isnan(item.sigma) else f" +- {item.sigma:.2g}"
    return f"{item.value:.5g}{known}"
