"""An acceptance plan as it stands in its file: keys, types and bounds."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from fringeworks.files.validation import Table
from fringeworks.measure.acceptance.artefacts import REFERENCE_C, CalibratedLength, Form
from fringeworks.measure.acceptance.trimming import MOST_PER_MILLE
from fringeworks.measure.region import Region

PLAN_FORMAT = "fringeworks-acceptance/1"

MOST_MM = 1e6
MOST_POSITIONS = 1000

Name = Annotated[str, Field(min_length=1, max_length=200)]
Source = Annotated[str, Field(min_length=1, max_length=1000)]
Length = Annotated[float, Field(gt=0, le=MOST_MM)]
Uncertainty = Annotated[float, Field(ge=0, le=MOST_MM)]
Expansion = Annotated[float, Field(ge=-1e-2, le=1e-2)]
Celsius = Annotated[float, Field(ge=-273.15, le=1000)]
Ends = Annotated[list[float], Field(min_length=2, max_length=2)]
Box = Annotated[list[Ends], Field(min_length=3, max_length=3)]
Window = Annotated[list[Ends], Field(min_length=2, max_length=2)]


class LimitsTable(Table):
    """Largest permitted sizes, mm."""

    PF_mm: Length | None = None
    PS_mm: Length | None = None
    SD_mm: Length | None = None
    F_mm: Length | None = None


class ExpandingTable(Table):
    """What a calibrated length expands by, and the temperature that it is stated at."""

    cte_per_k: Expansion = 0.0
    cte_u95_per_k: Annotated[float, Field(ge=0, le=1e-2)] = 0.0
    calibrated_at_c: Celsius = REFERENCE_C

    def length(self, value_mm: float, u95_mm: float) -> CalibratedLength:
        return CalibratedLength(
            value_mm, u95_mm, self.cte_per_k, self.cte_u95_per_k, self.calibrated_at_c
        )


class BallTable(ExpandingTable):
    """The ball's certificate."""

    diameter_mm: Length
    diameter_u95_mm: Uncertainty = 0.0
    form_mm: Uncertainty = 0.0
    form_u95_mm: Uncertainty = 0.0


class BarTable(ExpandingTable):
    """The ball bar's: distance of its centres."""

    length_mm: Length
    length_u95_mm: Uncertainty = 0.0


class FlatTable(Table):
    """The flat's."""

    flatness_mm: Uncertainty = 0.0
    flatness_u95_mm: Uncertainty = 0.0

    def form(self) -> Form:
        return Form(self.flatness_mm, self.flatness_u95_mm)


class RegionTable(Table):
    """Part of a cloud: ranges of x, y, z in mm, ranges of camera columns and rows."""

    box_mm: Box | None = None
    pixels: Window | None = None

    def region(self) -> Region:
        box, window = self.box_mm, self.pixels
        return Region(
            box_mm=None if box is None else (_pair(box[0]), _pair(box[1]), _pair(box[2])),
            pixels=None if window is None else (_pair(window[0]), _pair(window[1])),
        )


def _pair(ends: list[float]) -> tuple[float, float]:
    return ends[0], ends[1]


class PositionTable(Table):
    """What every position has: a name, and one of a cloud and a capture."""

    name: Name | None = None
    cloud: Source | None = None
    capture: Source | None = None


class BallPosition(PositionTable, RegionTable):
    """The ball somewhere."""

    artefact: Literal["ball"]

    def regions(self) -> tuple[Region, ...]:
        return (self.region(),)


class FlatPosition(PositionTable, RegionTable):
    """The flat somewhere."""

    artefact: Literal["flat"]

    def regions(self) -> tuple[Region, ...]:
        return (self.region(),)


class BarPosition(PositionTable):
    """The ball bar somewhere: where its balls are."""

    artefact: Literal["bar"]
    first: RegionTable
    second: RegionTable

    def regions(self) -> tuple[Region, ...]:
        return self.first.region(), self.second.region()


AnyPosition: TypeAlias = Annotated[
    BallPosition | BarPosition | FlatPosition, Field(discriminator="artefact")
]


class PlanFile(Table):
    """The whole plan."""

    format: Literal["fringeworks-acceptance/1"]
    name: Name | None = None
    rig: Source | None = None
    volume_mm: Annotated[list[Length], Field(min_length=3, max_length=3)]
    temperature_c: Celsius = REFERENCE_C
    temperature_u95_k: Annotated[float, Field(ge=0, le=100)] = 0.0
    trim_per_mille: Annotated[float, Field(ge=0, le=MOST_PER_MILLE)] = MOST_PER_MILLE
    limits: LimitsTable = LimitsTable()
    ball: BallTable | None = None
    bar: BarTable | None = None
    flat: FlatTable | None = None
    position: Annotated[list[AnyPosition], Field(min_length=1, max_length=MOST_POSITIONS)]
