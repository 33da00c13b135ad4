"""``capture.toml`` as it stands in the file: the kinds of sets, their keys and simple bounds.

Degrees here, radians in the model. What one key alone cannot tell (counts, code edges, matching
sets) is `capture_checks`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence as Items
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from fringeworks.files.validation import Table
from fringeworks.model.capture import Sensor
from fringeworks.model.sequence import (
    PROJECTOR_EDGE_PX,
    Axis,
    Checkerboard,
    Codeword,
    Colour,
    Fringe,
    GrayCode,
    Pattern,
    Picture,
    Speckle,
    Staircase,
    Uniform,
)

CAPTURE_FORMAT = "fringeworks-capture/1"

MAX_EXTENT_PX = 65536
MOST_SETS = 1000  # each is held against all before it
Extent = Annotated[int, Field(ge=1, le=MAX_EXTENT_PX)]
Period = Annotated[float, Field(ge=2, le=MAX_EXTENT_PX * 16)]
Cell = Annotated[float, Field(ge=1, le=MAX_EXTENT_PX)]
Zero = Annotated[float, Field(ge=-MAX_EXTENT_PX * 16, le=MAX_EXTENT_PX * 16)]
Degrees = Annotated[float, Field(ge=-36000, le=36000)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Name = Annotated[str, Field(min_length=1)]
Images = Annotated[list[str], Field(min_length=1)]


def _names(given: object) -> object:
    """One name as a list of it."""
    if not isinstance(given, str | list):
        raise PydanticCustomError("names", "must be an image name or a list of them")
    return [given] if isinstance(given, str) else given


class ImageSet(Table):
    """What every kind of set has; `kind` is first in each subclass, which `pattern` reads."""

    images: Images
    group: Name | None = None
    exposure_ms: Positive | None = None
    repeats: Annotated[int, Field(ge=1, le=10_000)] = 1
    timestamps_s: list[float] | None = None

    def all_images(self) -> list[str]:
        """Names of all images in the order of the set's stack."""
        return self.images

    def pattern(self) -> Pattern:
        """The noun that this set describes."""
        raise NotImplementedError


class FringeSet(ImageSet):
    """Sinusoidal fringes."""

    kind: Literal["fringe"]
    axis: Axis
    period_px: Period
    shifts_deg: list[Degrees]
    zero_px: Zero = PROJECTOR_EDGE_PX

    def pattern(self) -> Fringe:
        return Fringe(self.axis, self.period_px, _radians(self.shifts_deg), self.zero_px)


class GraySet(ImageSet):
    """Reflected binary code; `bits` is counted from the images."""

    kind: Literal["gray"]
    axis: Axis
    cell_px: Cell
    inverted: Images | None = None
    complementary: Annotated[Images, BeforeValidator(_names)] | None = None

    def complementary_images(self) -> list[str]:
        return self.complementary or []

    def all_images(self) -> list[str]:
        return [*self.images, *self.complementary_images(), *(self.inverted or [])]

    def pattern(self) -> GrayCode:
        return GrayCode(
            axis=self.axis,
            bits=len(self.images) // self.repeats,
            cell_px=self.cell_px,
            inverted=self.inverted is not None,
            complementary=self.complementary is not None,
        )


class UniformSet(ImageSet):
    """One flat frame."""

    kind: Literal["uniform"]
    level: Annotated[float, Field(ge=0, le=1)]

    def pattern(self) -> Uniform:
        return Uniform(self.level)


class CodewordSet(ImageSet):
    """The paper's code frame."""

    kind: Literal["codeword"]
    axis: Axis
    period_px: Period
    codewords_px: Annotated[list[Period], Field(min_length=1)]
    sequence: Annotated[list[int], Field(min_length=1)] | None = None
    zero_px: Zero = PROJECTOR_EDGE_PX

    def pattern(self) -> Codeword:
        order = None if self.sequence is None else tuple(self.sequence)
        words = tuple(self.codewords_px)
        return Codeword(self.axis, self.period_px, words, sequence=order, zero_px=self.zero_px)


class CheckerboardSet(ImageSet):
    """A projected checkerboard."""

    kind: Literal["checkerboard"]
    square_px: Positive

    def pattern(self) -> Checkerboard:
        return Checkerboard(self.square_px)


class StaircaseSet(ImageSet):
    """Phase-coded fringe order."""

    kind: Literal["staircase"]
    axis: Axis
    period_px: Period
    levels: Annotated[int, Field(ge=2, le=MAX_EXTENT_PX)]
    shifts_deg: list[Degrees]

    def pattern(self) -> Staircase:
        return Staircase(self.axis, self.period_px, self.levels, _radians(self.shifts_deg))


class ColourSet(ImageSet):
    """Colour-coded fringe order."""

    kind: Literal["colour"]
    axis: Axis
    period_px: Period
    palette: Annotated[list[Name], Field(min_length=1)]

    def pattern(self) -> Colour:
        return Colour(self.axis, self.period_px, tuple(self.palette))


class SpeckleSet(ImageSet):
    """Random dots."""

    kind: Literal["speckle"]
    seed: Annotated[int, Field(ge=0)]
    dot_px: Positive

    def pattern(self) -> Speckle:
        return Speckle(self.seed, self.dot_px)


class PictureSet(ImageSet):
    """Frames of no coded meaning."""

    kind: Literal["image"]

    def pattern(self) -> Picture:
        return Picture(max(1, len(self.images) // self.repeats))


AnySet = Annotated[
    FringeSet
    | GraySet
    | UniformSet
    | CodewordSet
    | CheckerboardSet
    | StaircaseSet
    | ColourSet
    | SpeckleSet
    | PictureSet,
    Field(discriminator="kind"),
]


class ProjectorTable(Table):
    """Size of the projected image, px."""

    width: Extent
    height: Extent


class CameraTable(Table):
    """What is known of the sensor, grey levels; see `Sensor`."""

    full_scale: Annotated[float, Field(gt=0, le=65535)] | None = None
    black_level: NotNegative = 0.0
    gain: Annotated[float, Field(ge=0, le=65535)] | None = None
    read_noise: Annotated[float, Field(ge=0, le=65535)] | None = None
    temperature_c: float | None = None

    def sensor(self, full_scale: float) -> Sensor:
        """With this full scale where the file gives none."""
        return Sensor(
            full_scale=self.full_scale or full_scale,
            black_level=self.black_level,
            gain=self.gain,
            read_noise=self.read_noise,
            temperature_c=self.temperature_c,
        )


class CaptureFile(Table):
    """The whole ``capture.toml``."""

    format: Literal["fringeworks-capture/1"]
    projector: ProjectorTable
    set: Annotated[list[AnySet], Field(min_length=1, max_length=MOST_SETS)]
    camera: CameraTable = CameraTable()
    provenance: dict[str, Any] = Field(default_factory=dict)


def _radians(degrees: Items[float]) -> tuple[float, ...]:
    return tuple(math.radians(value) for value in degrees)
