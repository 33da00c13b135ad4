"""``scene.toml`` as it stands in the file: the shapes, their keys and types.

Degrees here, radians in the model. Which values make sense is the twin's to say (`twin.check`);
the bounds here only keep a slip of the finger from filling the memory.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fringeworks.files.nouns import make_noun
from fringeworks.files.validation import Table
from fringeworks.geometry.pose import rotation_matrix
from fringeworks.model import Pose
from fringeworks.twin.scene import (
    MOST_MM,
    Blend,
    Board,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Plane,
    Shape,
    Sphere,
)

SCENE_FORMAT = "fringeworks-scene/1"

MAX_OBJECTS = 1000
MAX_POSES = 1000
MAX_CAPSULES = 1000

Name = Annotated[str, Field(min_length=1)]
Corners = Annotated[int, Field(ge=3, le=1000)]
Length = Annotated[float, Field(ge=-MOST_MM, le=MOST_MM)]
Degrees = Annotated[float, Field(ge=-36000, le=36000)]
Lengths = Annotated[list[Length], Field(min_length=3, max_length=3)]
Turn = Annotated[list[Degrees], Field(min_length=3, max_length=3)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Ends = Annotated[list[Length], Field(min_length=8, max_length=8)]


class PlaceTable(Table):
    """Where a frame stands in the camera's: its origin, and a rotation vector."""

    position_mm: Lengths
    rotation_deg: Turn | None = None

    def pose(self) -> Pose:
        turn = np.radians(self.rotation_deg or [0.0, 0.0, 0.0])
        return Pose(rotation_matrix(turn), np.array(self.position_mm, dtype=np.float64))


class ObjectTable(PlaceTable):
    """What every object has; each subclass adds `shape` and the fields of its noun."""

    name: Name
    velocity_mm_s: Lengths | None = None
    albedo: float | None = None
    dark_albedo: float | None = None
    gloss: float | None = None
    gloss_exponent: float | None = None


class PlaneTable(ObjectTable):
    """A rectangle; unbounded along what is not given."""

    shape: Literal["plane"]
    width_mm: Length | None = None
    height_mm: Length | None = None

    def noun(self) -> Shape:
        return make_noun(Plane, self)


class SphereTable(ObjectTable):
    """See `Sphere`."""

    shape: Literal["sphere"]
    radius_mm: Length

    def noun(self) -> Shape:
        return make_noun(Sphere, self)


class CylinderTable(ObjectTable):
    """See `Cylinder`."""

    shape: Literal["cylinder"]
    radius_mm: Length
    length_mm: Length

    def noun(self) -> Shape:
        return make_noun(Cylinder, self)


class ConeTable(ObjectTable):
    """See `Cone`."""

    shape: Literal["cone"]
    radius_mm: Length
    height_mm: Length

    def noun(self) -> Shape:
        return make_noun(Cone, self)


class BoxTable(ObjectTable):
    """See `Box`."""

    shape: Literal["box"]
    size_mm: Lengths

    def noun(self) -> Shape:
        return make_noun(Box, self)


class BlendTable(ObjectTable):
    """See `Blend`; a capsule is x, y, z, radius of one end and the same of the other."""

    shape: Literal["blend"]
    capsules: Annotated[list[Ends], Field(min_length=1, max_length=MAX_CAPSULES)]
    smooth_mm: Length | None = None

    def noun(self) -> Shape:
        capsules = tuple(
            Capsule((x, y, z), radius, (to_x, to_y, to_z), to_radius)
            for x, y, z, radius, to_x, to_y, to_z, to_radius in self.capsules
        )
        return Blend(capsules) if self.smooth_mm is None else Blend(capsules, self.smooth_mm)


class BoardTable(ObjectTable):
    """See `Board`."""

    shape: Literal["checkerboard", "charuco", "circles"]
    columns: Corners
    rows: Corners
    square_mm: Length
    marker_mm: Length | None = None
    dictionary: Name | None = None
    diameter_mm: Length | None = None
    margin_mm: Length | None = None
    print_scale: Pair | None = None
    print_sigma_mm: Length | None = None
    print_seed: Annotated[int, Field(ge=0)] | None = None
    bow_mm: Annotated[list[Length], Field(min_length=2, max_length=2)] | None = None

    def noun(self) -> Shape:
        return make_noun(Board, self, kind=self.shape)


class MeshTable(ObjectTable):
    """A file of triangles, which whoever knows the folder reads."""

    shape: Literal["mesh"]
    file: str
    scale: Annotated[float, Field(gt=0, le=1e6)] = 1.0


AnyObject = Annotated[
    PlaneTable
    | SphereTable
    | CylinderTable
    | ConeTable
    | BoxTable
    | BlendTable
    | BoardTable
    | MeshTable,
    Field(discriminator="shape"),
]


class PoseTable(PlaceTable):
    """A further place of an object."""

    object: Name


class SceneFile(Table):
    """The whole ``scene.toml``."""

    format: Literal["fringeworks-scene/1"]
    name: Name | None = None
    object: Annotated[list[AnyObject], Field(min_length=1, max_length=MAX_OBJECTS)]
    pose: Annotated[list[PoseTable], Field(max_length=MAX_POSES)] = Field(default_factory=list)
