"""The parameters of a calibration with their standard deviations, in tables for a page."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from fringeworks.calibrate.adjust.covariance import Covariance
from fringeworks.calibrate.adjust.state import parameter_names
from fringeworks.calibrate.judge.uncertainty import state_of
from fringeworks.model import Rig
from fringeworks.report.blocks import Table

PARTS = ("camera", "projector", "projector_from_camera", "board")
"""What all views share; the poses of the boards are of no use later."""

MOST_CORRELATIONS = 10
SIGNIFICANT = 2
"""Digits of a standard deviation; of its value as many decimals."""


def parameter_values(rig: Rig, board_shape: Mapping[str, float]) -> dict[str, float]:
    """What all views share, by name."""
    shared = dict(zip(parameter_names(()), state_of(rig).vector.tolist(), strict=True))
    return {**shared, **{f"board.{name}": value for name, value in board_shape.items()}}


def parameter_table(rig: Rig, covariance: Covariance, board_shape: Mapping[str, float]) -> Table:
    """Every parameter that was solved for."""
    values = parameter_values(rig, board_shape)
    rows = [
        (f"`{name}`", *with_sigma(values[name], sigma), _unit(name))
        for name, sigma in covariance.only(*PARTS).sigma.items()
    ]
    return Table(
        ("parameter", "value", "1 sd", "unit"),
        rows,
        numbers=(1, 2),
        caption="What was solved for; the turn is a rotation vector",
    )


def correlation_table(covariance: Covariance) -> Table:
    """The strongest correlations: what the views hardly tell apart."""
    rows = [
        (f"`{one}`", f"`{other}`", f"{value:+.3f}")
        for one, other, value in covariance.only(*PARTS).correlations(MOST_CORRELATIONS)
    ]
    return Table(
        ("parameter", "and", "correlation"),
        rows,
        numbers=(2,),
        caption="The strongest correlations: what the views hardly tell apart",
    )


def with_sigma(value: float, sigma: float) -> tuple[str, str]:
    """Both with as many decimals as the standard deviation has two digits for."""
    if not 0 < sigma < math.inf:
        return f"{value:g}", f"{sigma:g}"
    decimals = max(0, SIGNIFICANT - 1 - math.floor(math.log10(sigma)))
    return f"{value:.{decimals}f}", f"{sigma:.{decimals}f}"


def baseline_sigma(rig: Rig, covariance: Covariance) -> float:
    """Standard deviation of the baseline, mm: that of the translation along itself."""
    along = rig.projector_from_camera.translation_mm / rig.baseline_mm
    pose = covariance.only("projector_from_camera")
    chosen = [pose.names.index(f"projector_from_camera.t{axis}_mm") for axis in "xyz"]
    return float(np.sqrt(along @ pose.matrix[np.ix_(chosen, chosen)] @ along))


def _unit(name: str) -> str:
    last = name.rsplit(".", 1)[1]
    if last in ("fx", "fy", "cx", "cy"):
        return "px"
    return last.rsplit("_", 1)[1] if "_" in last else ""
