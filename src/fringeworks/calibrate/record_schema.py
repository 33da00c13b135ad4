"""The record of a calibration as it stands in the rig's file."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

from fringeworks.calibrate.adjust.state import SHAPE_NAMES
from fringeworks.calibrate.judge.cross_validate import Trial
from fringeworks.model import Finding

FARTHEST = 1e9
"""Of all that is measured, mm or px: what squares of it can be summed."""

Bounded = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Distance = Annotated[float, Field(ge=0, le=FARTHEST)]
Triple: TypeAlias = tuple[Bounded, Bounded, Bounded]
Pair: TypeAlias = tuple[Bounded | None, Bounded | None]
Sigmas: TypeAlias = tuple[Distance | None, Distance | None]
Residuals: TypeAlias = tuple[float | None, float | None]
"""Of corners left out too, however far they are off."""

Maps: TypeAlias = list[list[list[Distance | None]]]
NotNegative = Annotated[float, Field(ge=0)]


class RecordPart(BaseModel):
    """Keys that nobody reads back, such as the settings, are free."""

    model_config = ConfigDict(strict=False, allow_inf_nan=False)


class PoseTable(RecordPart):
    """camera_from_board."""

    rotation: tuple[Triple, Triple, Triple]
    translation_mm: Triple


class SitesTable(RecordPart):
    """See `Sites`."""

    camera_px: list[tuple[float, float]]
    projector_px: list[tuple[float, float]]
    sigma_px: list[tuple[float, float]]


class ViewTable(RecordPart):
    """See `ViewRecord`."""

    name: str
    image: str
    camera_from_board: PoseTable
    camera_rms_px: NotNegative
    projector_rms_px: NotNegative
    reasons: list[str]
    board_mm: list[Triple]
    camera_px: list[Pair]
    projector_px: list[Pair]
    camera_sigma_px: list[Sigmas]
    projector_sigma_px: list[Sigmas]
    dense: SitesTable | None = None
    camera_residual_px: list[Residuals]
    projector_residual_px: list[Residuals]


class FailedTable(RecordPart):
    """A capture that gave no view."""

    name: str
    reason: str


class RmsTable(RecordPart):
    """Root mean squares, px."""

    camera: NotNegative
    projector: NotNegative
    joint: NotNegative


class HalvesTable(RecordPart):
    """See `Halves`; what follows from the maps is not read back."""

    difference_mm: Maps
    predicted_mm: Maps


class RecordTable(RecordPart):
    """See `CalibrationRecord`; rigs of earlier versions lack what has a default."""

    rms_of_all_px: RmsTable
    views: Annotated[list[ViewTable], Field(min_length=1)]
    findings: list[Finding]
    failed_captures: list[FailedTable]
    board_shape: dict[str, float] = Field(default_factory=lambda: dict.fromkeys(SHAPE_NAMES, 0.0))
    k3: list[Trial] = Field(default_factory=list)
    halves: HalvesTable | None = None
    left_out: list[str] = Field(default_factory=list)
