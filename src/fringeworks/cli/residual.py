"""``calibrate --residual``: fields of what the models leave, chosen and told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fringeworks.cli.output import Output
from fringeworks.errors import CalibrationError

if TYPE_CHECKING:
    from fringeworks.calibrate.residual.choose import Choice
    from fringeworks.model import Rig


def choose_residual(rig: Rig) -> tuple[Rig, Sequence[Choice] | str]:
    """The rig with the fields that its calibration wants, and what came of each.

    Or the rig as it is, and why its calibration cannot tell: it has been solved, and is not lost.
    """
    from fringeworks.calibrate.residual.choose import choose_fields

    try:
        chosen = choose_fields(rig)
    except CalibrationError as error:
        return rig, str(error)
    fields = tuple(choice.field for choice in chosen if choice.field is not None)
    return replace(rig, residual=fields), chosen


def describe_residual(
    output: Output, chosen: Sequence[Choice] | str
) -> list[dict[str, Any]] | dict[str, str]:
    """Print what came of it; returns a summary."""
    output.line("residual field")
    if isinstance(chosen, str):
        output.line(f"  left out: {chosen}")
        return {"left_out": chosen}
    for choice in chosen:
        output.line(f"  {choice.words}")
    return [
        {
            "model": choice.model,
            "axis": choice.axis,
            "order": None if choice.field is None else choice.field.order,
            "rms_px": choice.rms_px[0],
            "rms_with_px": choice.rms_px[1],
            "words": choice.words,
        }
        for choice in chosen
    ]
