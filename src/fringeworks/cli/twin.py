"""``fringeworks twin``: a capture of a simulated scene, with its truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fringeworks.cli.output import JsonFlag, Output, percent
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

if TYPE_CHECKING:
    from fringeworks.model import Rig
    from fringeworks.twin.scene import Scene
    from fringeworks.twin.truth import Truth


def twin(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="cylinder, two, hand, wall, step, balls, board (14 poses), or a scene.toml.",
        ),
    ],
    rig: Annotated[str, typer.Option("--rig", metavar="RIG", help="paper, warped, or a rig.json.")],
    preset: Annotated[
        Preset, typer.Option("--preset", help="What is projected; see `fringeworks patterns`.")
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
    from fringeworks.files.sensor import read_sensor
    from fringeworks.files.simulation import write_simulations
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
    )
    effects = Effects() if sensor is None else read_sensor(sensor)
    with output.working() as progress:
        folders = write_simulations(
            seen,
            before,
            sequence,
            out,
            effects=effects,
            seed=seed,
            overwrite=overwrite,
            progress=progress,
        )
    captures = describe_captures(output, folders)
    images = sum(item.image_count for item in sequence.sets)
    output.line(f"wrote {len(folders)} x {images} images with their truth in {out}")
    output.result({"scene": seen.name, "rig": rig, "out": out, "captures": captures})


def find_scene(name: str) -> Scene:
    """A scene by its file or name."""
    from fringeworks.files.scene import read_scene
    from fringeworks.twin.scenes import named_scene

    return read_scene(Path(name)) if _is_file(name) else named_scene(name)


def find_rig(name: str) -> Rig:
    """A rig by its file or name."""
    from fringeworks.files import read_rig
    from fringeworks.twin.scenes import named_rig

    return read_rig(Path(name)) if _is_file(name) else named_rig(name)


def _is_file(name: str) -> bool:
    """Names have no suffix; a folder that happens to be called like one is not meant."""
    return Path(name).is_file() or Path(name).suffix != ""


def describe_captures(output: Output, folders: list[Path]) -> list[dict[str, Any]]:
    """Print what each capture sees; returns the same."""
    from fringeworks.files.simulation import TRUTH_NPZ
    from fringeworks.files.truth import read_truth

    captures = [_summarise(folder, read_truth(folder / TRUTH_NPZ)) for folder in folders]
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


def _summarise(folder: Path, truth: Truth) -> dict[str, Any]:
    import numpy as np

    seen = truth.surface >= 0
    depth = truth.xyz[..., 2][seen]
    return {
        "capture": folder,
        "truth": folder / "truth.npz",
        "surfaces": [
            name for place, name in enumerate(truth.names) if (truth.surface == place).any()
        ],
        "seen_share": float(np.mean(seen)),
        "lit_share": float(np.mean(np.isfinite(truth.column[seen]))),
        "z_mm": {"min": float(depth.min()), "max": float(depth.max())},
    }
