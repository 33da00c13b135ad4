"""``fringeworks twin``: a capture of a simulated scene, with its truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from fringeworks.cli.output import JsonFlag, Output, percent
from fringeworks.cli.response import CurveOption, read_curve
from fringeworks.cli.sequences import (
    AxesOption,
    CodeOption,
    CodewordsOption,
    ExposuresOption,
    InvertedOption,
    PeriodsOption,
    Shown,
    StepsOption,
    sequence_of,
)


def twin(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="cylinder, two, hand, wall, step, balls, contrast, board (14 poses), or a "
            "scene.toml.",
        ),
    ],
    rig: Annotated[str, typer.Option("--rig", metavar="RIG", help="paper, warped, or a rig.json.")],
    preset: Annotated[
        Shown, typer.Option("--preset", help="What is projected; see `fringeworks patterns`.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="CAPTURE", help="Folder to write into.")],
    sensor: Annotated[
        Path | None,
        typer.Option(
            "--sensor",
            help="sensor.toml: blur, gamma, noise, exposure, ambient light... [default: an "
            "industrial camera and a pico projector].",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", min=0, help="Seed of all that is random.")
    ] = 0,
    axes: AxesOption = "xy",
    steps: StepsOption = None,
    periods: PeriodsOption = None,
    code: CodeOption = None,
    inverted: InvertedOption = None,
    codewords: CodewordsOption = None,
    exposures: ExposuresOption = None,
    response: CurveOption = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace captures that are there already.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Simulate what a camera sees of a scene under every pattern of a preset, with the truth.

    Writes the capture and truth.npz (per camera pixel xyz in mm, projector column and row in px,
    surface), and scene.toml, sensor.toml and true_rig.json, which made it: change them and use
    them again. A scene with poses becomes one capture per pose, and board.toml beside them.
    """
    output = Output(as_json=as_json)
    from fringeworks.acquire.simulated import write_simulations
    from fringeworks.files import read_sensor
    from fringeworks.files.named import files_of, find_rig, find_scene
    from fringeworks.twin.effects import Effects

    seen, before = find_scene(scene), find_rig(rig)
    sequence = sequence_of(
        preset,
        width=before.projector.width,
        height=before.projector.height,
        axes=axes,
        steps=steps,
        periods=periods,
        code=code,
        inverted=inverted,
        codewords=codewords,
        exposures=exposures,
    )
    curve, bent = read_curve(response, width=before.projector.width, height=before.projector.height)
    effects = Effects() if sensor is None else read_sensor(sensor)
    with output.working() as progress:
        folders = write_simulations(
            seen,
            before,
            sequence,
            out,
            effects=effects,
            seed=seed,
            facts={"preset": preset, "rig": rig, **bent},
            curve=curve,
            inputs=[
                *files_of(scene),
                *files_of(rig),
                *(path for path in (sensor, response) if path),
            ],
            overwrite=overwrite,
            progress=progress,
        )
    captures = describe_captures(output, folders)
    images = sum(item.image_count for item in sequence.sets)
    output.line(f"wrote {len(folders)} x {images} images with their truth in {out}")
    output.result(
        {"scene": seen.name, "rig": rig, "preset": preset, "seed": seed, "out": out}
        | {"captures": captures}
    )


def describe_captures(output: Output, folders: list[Path]) -> list[dict[str, Any]]:
    """Print what each capture sees; returns the same."""
    from fringeworks.acquire.simulated import TRUTH_NPZ
    from fringeworks.files import read_truth
    from fringeworks.report.summary import summarise_truth

    captures: list[dict[str, Any]] = [
        {"capture": folder, "truth": folder / TRUTH_NPZ}
        | summarise_truth(read_truth(folder / TRUTH_NPZ))
        for folder in folders
    ]
    rows = [
        (
            folder.name,
            ", ".join(item["surfaces"]),
            percent(item["seen_share"]),
            percent(item["lit_share"]),
            f"{item['z_mm']['min']:.1f} to {item['z_mm']['max']:.1f}",
        )
        for folder, item in zip(folders, captures, strict=True)
    ]
    head = ("capture", "objects", "of the image", "lit of these", "depth z, mm")
    output.table(head, rows, numbers=(2, 3))
    return captures
