"""``calibrate --extended``: the paper's ten parameters, fitted and told."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

from fringeworks.cli.output import Output

if TYPE_CHECKING:
    from fringeworks.calibrate.extended.fit import ExtendedFit
    from fringeworks.model import Capture, Rig


def fit_captures(
    captures: Iterable[Capture], rig: Rig, mode: Literal["map", "paper"]
) -> ExtendedFit:
    """Fit them to the captures that the rig was calibrated from."""
    from fringeworks.calibrate.extended.points import fit_captures as fit

    return fit(captures, rig, mode=mode)


def with_fit(rig: Rig, fit: ExtendedFit) -> Rig:
    """The rig with what was fitted, and with how: its page tells it."""
    from fringeworks.calibrate.extended.words import FIT_KEY, summarise_fit

    further = {**rig.further, FIT_KEY: summarise_fit(fit)}
    return replace(rig, extended=fit.extended, further=further)


def describe_extended(output: Output, fit: ExtendedFit) -> dict[str, Any]:
    """Print a fit; returns its summary."""
    from fringeworks.calibrate.extended.words import describe_fit, summarise_fit, tabulate_fit

    output.line(f"extended model, fitted by {fit.mode}")
    head = ("", "unit", "value", "sigma", "prior sigma", "ratio")
    output.table(head, tabulate_fit(fit), numbers=(2, 3, 4, 5))
    for line in describe_fit(fit):
        output.line(f"  {line}")
    return summarise_fit(fit)
