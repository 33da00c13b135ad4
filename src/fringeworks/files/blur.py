"""The blur that a rig keeps under `transfer`: that of both devices together, projector px."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from fringeworks.files.validation import Table, validated
from fringeworks.model import AXES, Axis, Rig

RIG_KEY = "transfer"

Blur = Annotated[float, Field(gt=0, le=1000)]


class BlurTable(Table):
    """Standard deviations of the point spread along x and y."""

    x: Blur | None = None
    y: Blur | None = None


class TransferTable(Table):
    """What a rig keeps under `transfer`."""

    blur_px: BlurTable


def blur_of_rig(rig: Rig) -> dict[Axis, float]:
    """Blur along each axis, projector px, 1 sd; empty where the rig keeps none.

    Raises
    ------
    FormatError
        It keeps something else there.
    """
    table = rig.further.get(RIG_KEY)
    if table is None:
        return {}
    blur = validated(TransferTable, table, Path(f"rig, {RIG_KEY}")).blur_px
    known = {axis: getattr(blur, axis) for axis in AXES}
    return {axis: sigma for axis, sigma in known.items() if sigma is not None}


def rig_with_blur(rig: Rig, sigmas_px: Mapping[Axis, float]) -> Rig:
    """The rig that keeps these blurs, projector px."""
    return replace(rig, further={**rig.further, RIG_KEY: {"blur_px": dict(sigmas_px)}})
